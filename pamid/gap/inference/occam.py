r"""The price of an effect's freedom: Laplace's approximation of its evidence.

Schwarz charges every parameter alike. But a presliding distance that the log hardly determines, or the split of a fault
over two similar muscles, changes nothing and should cost nothing, while an amplitude costs the full price. The
posterior volume of the parameters over the prior volume says how much each one matters:

.. math:: c = \tfrac{1}{2} \log n + \tfrac{1}{2} \log\det(I + S H S) - \tfrac{1}{2} \log(1 + 2 G)

with H the curvature of the likelihood, tolerances projected out, S the prior widths and G the gain. The prior width of
an amplitude is about its own size, so that an effect of one amplitude costs Schwarz's price.

References
----------
D. J. C. MacKay, "Bayesian interpolation", Neural Computation 4(3), 1992. https://doi.org/10.1162/neco.1992.4.3.415
"""

from collections.abc import Sequence

import numpy as np

from ...effects import Parameter
from ..settings import OF_ITS_OWN


def width(p: Parameter, value: float) -> float:
    """Return the prior width of a nonlinear parameter: its distance from the start, or a uniform spread."""
    if p.share or p.skew:
        return OF_ITS_OWN
    if p.lower >= 0.0 and value > p.lower:
        return value - p.lower
    return (p.upper - p.lower) / np.sqrt(12.0)


def occam(
    D: np.ndarray,
    J: np.ndarray,
    weights: np.ndarray,
    parameters: Sequence[Parameter],
    values: Sequence[float],
    gain: float,
) -> float:
    """Return the penalty of an effect's parameters in log-likelihood."""
    n, k = D.shape
    if k < 2:
        return 0.5 * float(np.log(max(n, 2))) * k
    Dw = D * weights[:, None]
    H = D.T @ Dw
    if J.shape[1]:
        cross = J.T @ Dw
        H = H - cross.T @ np.linalg.lstsq(J.T @ (J * weights[:, None]) + 3.0 * np.eye(J.shape[1]), cross, rcond=None)[0]
    return occam_of(H, n, parameters, values, gain)


def occam_of(H: np.ndarray, n: float, parameters: Sequence[Parameter], values: Sequence[float], gain: float) -> float:
    """Return the penalty of an effect's parameters where the curvature of the likelihood is known."""
    one, k = 0.5 * float(np.log(max(n, 2))), len(H)
    if k < 2:
        return one * k
    S = possible(H, parameters, values, gain)
    bends = 0.5 * float(np.linalg.slogdet(np.eye(k) + H * np.outer(S, S))[1])
    return float(np.clip(one + bends - 0.5 * np.log1p(2.0 * max(gain, 1.0)), one, one * k))


def possible(H: np.ndarray, parameters: Sequence[Parameter], values: Sequence[float], gain: float) -> np.ndarray:
    """Return the prior width of each parameter; an amplitude's is about the effect's size."""
    curvature = np.diag(H)
    # One whose square underflows changes nothing.
    acts = curvature > np.finfo(float).tiny / np.finfo(float).eps
    amplitude = np.where(acts, np.sqrt(2.0 * max(gain, 1.0) / np.where(acts, curvature, 1.0)), 0.0)
    return np.array([a if p.linear else width(p, v) for p, v, a in zip(parameters, values, amplitude, strict=True)])
