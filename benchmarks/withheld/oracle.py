"""Could anybody tell: the generator's own form, refitted on the log, against the best wrong hypothesis.

The oracle knows what the effect leaves in each window, and fits one factor and the parameters that have a tolerance.
Where even its evidence is less than `DECIDABLE` nats ahead of the best hypothesis without the true effect, the log does
not tell, and nobody can be blamed for another name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .excitation import DT
from .generator import Case

DECIDABLE = 5.0
"""Lead in evidence, in nats, from which a case is decidable: odds of 150 to one."""


def oracle(case: Case, params: Any) -> float | None:
    """Return the gain in evidence of the true effects in their true form; None without an effect.

    Parameters
    ----------
    case : Case
        The case.
    params : BenchParameters
        Its nominal simulator.
    """
    if not case.spec.targets:
        return None
    from pamid.gap.inference.gauss_newton import Fitter
    from pamid.gap.residuals.bench import Evidence

    evidence = Evidence(case.log, params)
    fitter = Fitter(evidence)
    column = evidence.white(_at_windows(case, evidence) / evidence.noise)[:, None]
    x = np.zeros(len(evidence.free))
    spread = evidence.spread({}, x)
    without = fitter.linear(evidence.z0, iterations=20, soft=spread)
    # What an effect adds to the measured side is in the residual already: the oracle takes it off.
    bounds = np.array([-3.0]), np.array([3.0])
    with_it = fitter.linear(evidence.z0, column, *bounds, iterations=20, soft=spread)
    return float(with_it.loglik - without.loglik - 0.5 * len(case.spec.targets) * np.log(max(len(evidence.z0), 2)))


def _at_windows(case: Case, evidence: Any) -> np.ndarray:
    """Return what the effects leave in the windows of the library, from those of the generator by the time of each."""
    sizes = case.log.groupby("trajectory", sort=False).size()
    first = dict(zip(sizes.index, np.concatenate([[0], np.cumsum(sizes)[:-1]]), strict=True))
    begin = np.array([first[name] for name in evidence.trajectories])
    rows = begin[evidence.block] + evidence.time / DT
    out = np.zeros(len(evidence.noise))
    for name, part in zip(evidence.equations, evidence.parts, strict=True):
        centres, found = case.centres[name], case.contributions[name]
        for side in np.unique(evidence.side[part]):
            mine = np.flatnonzero(evidence.side[part] == side) + part.start
            out[mine] = np.interp(rows[mine], centres, found[:, min(int(side), found.shape[1] - 1)])
    return out


def lead(result: Mapping[str, Any]) -> float | None:
    """Return how far the oracle of a written case is ahead of the best hypothesis that lacks a true effect."""
    if result.get("oracle") is None or "diagnosis" not in result:
        return None
    true = set(result["key"]["effects"])
    wrong = [h["gain"] for h in result["diagnosis"]["hypotheses"] if not true <= set(h["effects"])]
    return float(result["oracle"]) - max([*wrong, 0.0])


def decidable(results: Sequence[Mapping[str, Any]]) -> set[str]:
    """Return the names of the cases that can be decided."""
    leads = {r["name"]: lead(r) for r in results}
    return {name for name, nats in leads.items() if nats is None or nats >= DECIDABLE}
