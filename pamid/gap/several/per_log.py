r"""Parameters of causes log by log, and whether a cause changed between logs.

A log may hold few runs, so that intervals are based on stretches of time as units: with the residuals' sensitivities
A, their weights W and the score g_s of each stretch,

.. math:: \operatorname{cov} \hat\theta = H^{-1} \Big(\sum_s g_s g_s^\top\Big) H^{-1}, \qquad H = A^\top W A + \Lambda

References
----------
H. White, "Maximum likelihood estimation of misspecified models", Econometrica 50(1), 1982.
https://doi.org/10.2307/1912526
"""

from collections.abc import Mapping

import numpy as np

from ...effects import Effect
from ..diagnosis.findings import ParameterEstimate
from ..inference.gauss_newton import Fit, Fitter, slots_of
from ..residuals.bench import Evidence
from ..settings import FORM_LOCAL, NU, TOLERANCE

STRETCH = 0.5
"""Length of the stretches of time that count as units, s."""
Estimates = dict[str, dict[str, ParameterEstimate]]


def fitted_alone(evidence: Evidence, spec: Mapping[str, Mapping[str, float]], near: np.ndarray) -> Fit:
    """Return causes refitted to one log, starting from their values over all logs."""
    return Fitter(evidence).refine(spec, near=near) if spec else Fitter(evidence).base()


def estimates(evidence: Evidence, fit: Fit) -> Estimates:
    """Return the parameters of a fit with 90 % intervals."""
    from scipy.stats import t as student

    fitter, slots, m = Fitter(evidence), slots_of(evidence.effects, fit.spec), evidence.J.shape[1]
    if not slots:
        return {}
    phi = np.array([fit.spec[name][p.name] for name, p in slots])
    z, J = evidence.tangent(fit.spec, fit.x), evidence.slopes(fit.spec, fit.x)
    D, _, _ = fitter.jacobian(slots, phi, z, fit.x)
    A, left = np.column_stack([J, D]), z + J @ fit.x
    w = np.empty(len(left))
    for part, s in zip(evidence.parts, fit.scales, strict=True):
        w[part] = (NU + 1.0) / (NU + np.square(left[part] / s)) / s**2
    size = np.maximum(np.sqrt(np.einsum("ij,ij,i->j", A, A, w)), 1e-100)  # its square divides a variance
    A = A / size
    prior = np.concatenate([TOLERANCE / size[:m] ** 2, np.full(len(slots), 1e-9)])
    H = A.T @ (A * w[:, None]) + np.diag(prior)
    stretch = np.floor(evidence.time / STRETCH).astype(int)
    _, unit = np.unique(np.column_stack([evidence.run, stretch]), axis=0, return_inverse=True)
    n = int(unit.max()) + 1
    scores = np.zeros((n, A.shape[1]))
    np.add.at(scores, unit.ravel(), A * (w * left)[:, None])
    bread = np.linalg.pinv(H, rcond=1e-10)
    # Neither stretches alone nor the curvature alone: few stretches may agree by chance.
    spread = bread @ (scores.T @ scores * n / max(n - A.shape[1], 1)) @ bread
    variance = np.maximum(np.diag(spread), np.diag(bread))[m:] / size[m:] ** 2
    reach = float(student.ppf(0.95, max(n - A.shape[1], 2)))
    found: Estimates = {}
    for k, (name, p) in enumerate(slots):
        value = float(phi[k])
        wide = reach * float(np.hypot(np.sqrt(variance[k]), FORM_LOCAL * p.size(value)))
        known = bool(np.any(D[:, k]))
        ci = p.interval(value, wide) if known else (-np.inf, np.inf)
        found.setdefault(name, {})[p.name] = ParameterEstimate(value, p.unit, ci)
    return found


def main_parameter(effect: type[Effect], spec: Mapping[str, float]) -> str:
    """Return the parameter that gives the size of an effect: the linear one that is largest beside its typical size."""
    parameters = [p for p in effect.parameters if p.name in spec]
    # A share between two forms is no size.
    sizes = [p for p in parameters if p.linear] or [p for p in parameters if not p.share] or parameters
    return max(sizes, key=lambda p: abs(spec[p.name]) / (abs(p.nominal) or abs(p.upper) or 1.0)).name
