"""Refit the parameters of a simulator within their tolerances, as a diagnosis does: the rest is a gap."""

from typing import Annotated, Any, NamedTuple

import numpy as np
import pandas as pd

from ..bench.parameters import BenchParameters
from ..equations.log import BenchLog
from ..explained import explained_fields
from ..simulators.base import Simulator
from .inference.gauss_newton import Fitter
from .residuals.bench import Evidence
from .settings import MAX_ROWS
from .simulated import evidence_of


@explained_fields
class Refit(NamedTuple):
    """Parameters refitted within their tolerances.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.gap import refit_within_tolerance
    >>> bench = BenchParameters.for_muscle("B")
    >>> refit = refit_within_tolerance(simulate(bench.replace(rest_diameter=0.02006), [sine(4, 15, 800)]), bench)
    >>> print(f"{1e3 * refit.params.muscle.rest_diameter:.2f} mm")
    20.06 mm
    """

    params: Annotated[Any, "The BenchParameters or Simulator with the refitted values."]
    changes: Annotated[dict[str, float], "Relative change of each parameter that has a tolerance."]
    at_bound: Annotated[tuple[str, ...], "Parameters that ended at a bound of their tolerance."]


def refit_within_tolerance(log: pd.DataFrame, params: BenchParameters | Simulator) -> Refit:
    """Fit the parameters that have a tolerance to a log, each within its tolerance.

    All equations that the log allows are fitted together, each residual over its noise, under the robust likelihood of
    a diagnosis, which starts from this refit.

    Parameters
    ----------
    log : DataFrame
        Log of the bench, see `pamid.equations.residuals`; of a long log, whole runs spread over it are used. For a
        simulator with ports, the columns that these name.
    params : BenchParameters or Simulator
        The simulator with its tolerances.

    Returns
    -------
    Refit
        The refitted simulator; unchanged if no parameter has a tolerance.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.bench import BenchParameters
    >>> from pamid.gap import refit_within_tolerance
    >>> rest = np.full(200, 300_000.0)
    >>> log = pd.DataFrame({"trajectory": "rest", "time": np.arange(200) * 1e-3, "q": 0.0, "P1": rest, "P2": rest})
    >>> fit = refit_within_tolerance(log.assign(mdot1=0.0, mdot2=0.0), BenchParameters.for_muscle("B"))
    >>> fit.at_bound
    ()
    """
    if not any(t > 0 and params.get(name) != 0 for name, t in params.tolerance.items()):
        return Refit(params, {}, ())
    if isinstance(params, Simulator):
        evidence: Any = evidence_of(log, params, refit=True)
    else:
        evidence = Evidence(BenchLog.of(log).whole(MAX_ROWS), params)
    if not evidence.equations:
        return Refit(params, dict.fromkeys(params.tolerance, 0.0), ())
    fitter = Fitter(evidence)
    # A parameter that ends at a bound is exactly there, without the slack of a diagnosis.
    about = dict(zip(evidence.free, map(float, evidence.about), strict=True))
    x = dict(zip(evidence.free, map(float, fitter.unwhitened(fitter.base()).x), strict=True))
    found = {n: float(np.clip(v + about[n], -1.0, 1.0)) for n, v in x.items() if n in params.tolerance}
    return Refit(
        evidence.deviated({name: v - about[name] for name, v in found.items()}),
        {name: params.tolerance[name] * v for name, v in found.items()},
        tuple(name for name, v in found.items() if abs(v) > 0.999),
    )
