"""Could anybody tell: the generator's own form, refitted on the log, against the best wrong hypothesis.

The oracle knows what the effect leaves in each window, and fits one factor and the parameters that have a tolerance.
Where even its evidence is less than `DECIDABLE` nats ahead of the best hypothesis without the true effect, the log does
not tell, and nobody can be blamed for another name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from . import several
from .excitation import DT
from .generator import Case

DECIDABLE = several.DECIDABLE
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
    told = _Told(case, params)
    gain = told.loglik([told.column(case.contributions)]) - told.loglik([])
    return float(gain - 0.5 * len(case.spec.targets) * np.log(max(told.windows, 2)))


def oracle_each(case: Case, params: Any) -> dict[str, float]:
    """Return the gain in evidence of each true effect in its true form, over the others alone, each free in its size.

    Parameters
    ----------
    case : Case
        The case.
    params : BenchParameters
        Its nominal simulator.
    """
    told = _Told(case, params)
    columns = {name: told.column(part) for name, part in case.each.items()}
    # What all leave together is exactly known; where the motion was another one, the parts are nearly so.
    between = told.column(case.contributions) - sum(columns.values())
    price = 0.5 * float(np.log(max(told.windows, 2)))
    every = told.loglik([*columns.values(), between])
    return {
        name: every - told.loglik([*(c for n, c in columns.items() if n != name), between]) - price for name in columns
    }


class _Told:
    """A log as the oracle fits it: columns of true forms, each with a factor, beside what has a tolerance."""

    def __init__(self, case: Case, params: Any) -> None:
        from pamid.gap.inference.gauss_newton import Fitter
        from pamid.gap.residuals.bench import Evidence

        self.case, self.evidence = case, Evidence(case.log, params)
        self.fitter = Fitter(self.evidence)
        self.spread = self.evidence.spread({}, np.zeros(len(self.evidence.free)))
        self.windows = len(self.evidence.z0)

    def column(self, contributions: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return what effects leave in the windows of the log, in units of the noise."""
        return np.asarray(
            self.evidence.white(_at_windows(self.case, self.evidence, contributions) / self.evidence.noise)
        )

    def loglik(self, columns: Sequence[np.ndarray]) -> float:
        """Return the likelihood with columns, each times a factor between −3 and 3."""
        z, J, n = self.evidence.z0, self.evidence.J, len(columns)
        if not n:
            return float(self.fitter.linear(z, J, iterations=20, soft=self.spread).loglik)
        # What an effect adds to the measured side is in the residual already: the oracle takes it off.
        bounds = np.full(n, -3.0), np.full(n, 3.0)
        D = np.column_stack(columns)
        return float(self.fitter.linear(z, J, D, *bounds, iterations=20, soft=self.spread).loglik)


def _at_windows(case: Case, evidence: Any, contributions: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return what effects leave in the windows of the library, from those of the generator by the time of each."""
    sizes = case.log.groupby("trajectory", sort=False).size()
    first = dict(zip(sizes.index, np.concatenate([[0], np.cumsum(sizes)[:-1]]), strict=True))
    begin = np.array([first[name] for name in evidence.trajectories])
    rows = begin[evidence.block] + evidence.time / DT
    out = np.zeros(len(evidence.noise))
    for name, part in zip(evidence.equations, evidence.parts, strict=True):
        centres, found = case.centres[name], contributions[name]
        for side in np.unique(evidence.side[part]):
            mine = np.flatnonzero(evidence.side[part] == side) + part.start
            out[mine] = np.interp(rows[mine], centres, found[:, min(int(side), found.shape[1] - 1)])
    return out


def lead(result: Mapping[str, Any]) -> float | None:
    """Return how far the oracle of a written case is ahead of the best hypothesis that lacks a true effect.

    Of several effects at once it is that of the least certain one of those that have to be named.
    """
    if result.get("oracle") is None or "diagnosis" not in result:
        return None
    if result["key"]["suite"] == "several":
        leads = [several.lead(result, name) for _, name in several.effects([result])]
        return min((nats for nats in leads if nats is not None), default=None)
    true = set(result["key"]["effects"])
    wrong = [h["gain"] for h in result["diagnosis"]["hypotheses"] if not true <= set(h["effects"])]
    return float(result["oracle"]) - max([*wrong, 0.0])


def decidable(results: Sequence[Mapping[str, Any]]) -> set[str]:
    """Return the names of the cases that can be decided."""
    leads = {r["name"]: lead(r) for r in results}
    return {name for name, nats in leads.items() if nats is None or nats >= DECIDABLE}
