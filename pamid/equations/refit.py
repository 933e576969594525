"""Refit the parameters of a simulator within their tolerances: what is left then is a gap."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..signals.thinning import whole_trajectories
from .evaluate import residuals

if TYPE_CHECKING:
    import pandas as pd

    from ..bench.parameters import BenchParameters


class Refit(NamedTuple):
    """Parameters refitted within their tolerances.

    Parameters
    ----------
    params : BenchParameters
        The simulator with the refitted values.
    changes : dict of str to float
        Relative change of each parameter that has a tolerance.
    at_bound : tuple of str
        Parameters that ended at a bound of their tolerance.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.equations import refit_within_tolerance
    >>> bench = BenchParameters.for_muscle("B")
    >>> refit = refit_within_tolerance(simulate(bench.replace(rest_diameter=0.02006), [sine(4, 15, 800)]), bench)
    >>> print(f"{1e3 * refit.params.muscle.rest_diameter:.2f} mm")
    20.06 mm
    """

    params: BenchParameters
    changes: dict[str, float]
    at_bound: tuple[str, ...]


def refit_within_tolerance(
    log: pd.DataFrame, params: BenchParameters, equations: Sequence[str] | None = None, max_windows: int = 20_000
) -> Refit:
    """Fit the parameters that have a tolerance to a log, each within its tolerance.

    All equations that the log allows are fitted together, each residual over its noise, by robust least squares.

    Parameters
    ----------
    log : DataFrame
        Log of the bench, see `residuals`.
    params : BenchParameters
        The simulator with its tolerances.
    equations : sequence of str, optional
        Names of the equations; all that the log allows by default.
    max_windows : int, default=20000
        Most windows of each equation that the fit looks at, spread evenly over the log.

    Returns
    -------
    Refit
        The refitted simulator; unchanged if no parameter has a tolerance.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.bench import BenchParameters
    >>> from pamid.equations import refit_within_tolerance
    >>> rest = np.full(200, 300_000.0)
    >>> log = pd.DataFrame({"trajectory": "rest", "time": np.arange(200) * 1e-3, "q": 0.0, "P1": rest, "P2": rest})
    >>> fit = refit_within_tolerance(log.assign(mdot1=0.0, mdot2=0.0), BenchParameters.for_muscle("B"))
    >>> fit.at_bound
    ()
    """
    from scipy.optimize import least_squares

    names = [name for name, tolerance in params.tolerance.items() if tolerance > 0 and params.get(name) != 0]
    if not names:
        return Refit(params, {}, ())
    tolerance = np.array([params.tolerance[name] for name in names])
    log = whole_trajectories(log, 25 * max_windows)
    stride = 1

    def changed(x: np.ndarray) -> BenchParameters:
        return params.replace(
            **{name: params.get(name) * (1 + t * v) for name, t, v in zip(names, tolerance, x, strict=True)}
        )

    def whitened(x: np.ndarray) -> np.ndarray:
        parts = [
            (r.value[::stride] / np.maximum(r.noise[::stride], 1e-300)).ravel()
            for _, _, r in residuals(log, changed(x), equations)
            if np.any(r.noise > 0)
        ]
        return np.concatenate(parts) if parts else np.zeros(1)

    start = whitened(np.zeros(len(names)))
    stride = max(1, round(len(start) / (4 * max_windows)))
    if not np.any(start):
        return Refit(params, dict.fromkeys(names, 0.0), ())
    prior = np.eye(len(names))  # a tolerance is one standard deviation of a prior, and its bound

    def cost(x: np.ndarray) -> np.ndarray:
        return np.concatenate([whitened(x), prior @ x])

    scale = max(1.0, float(1.4826 * np.median(np.abs(start - np.median(start)))))
    fit = least_squares(
        cost, np.zeros(len(names)), bounds=(-1.0, 1.0), loss="soft_l1", f_scale=3.0 * scale, diff_step=1e-3, max_nfev=30
    )
    at_bound = tuple(name for name, v in zip(names, fit.x, strict=True) if abs(v) > 0.999)
    changes = {name: float(t * v) for name, t, v in zip(names, tolerance, fit.x, strict=True)}
    return Refit(changed(fit.x), changes, at_bound)
