"""The nominal equation of a system with the effects that its simulator file adds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..effects import EffectSpec
from ..gap.one_equation import sampling_interval
from ..gap.residuals.rates import with_rates
from ..gap.residuals.single import SignalEvidence, Table
from ..simulators.placement import Scales
from ..simulators.problem import Problem

if TYPE_CHECKING:
    import pandas as pd


class WithEffects:
    """What a nominal equation says once effects are added, which in a sense of -1 add to the target."""

    def __init__(self, problem: Problem, effects: Sequence[EffectSpec], sense: int) -> None:
        self.problem, self.effects, self.sense = problem, effects, sense
        self._codes = problem.codes
        self._dt = sampling_interval({"time": problem.X["time"].to_numpy(dtype=float)}, self._codes, 1.0)

    def __call__(self, X: pd.DataFrame) -> np.ndarray:
        """Return the modelled target of some rows, of whole runs where an effect has memory."""
        problem, codes = self.problem, self._codes_of(X)
        columns = {role: column for role, column in problem.roles.items() if column in X.columns}
        read = {role: X[column].to_numpy(dtype=float) for role, column in columns.items()}
        modelled = np.asarray(problem.nominal(X), dtype=float)

        def nominal(table: Table) -> np.ndarray:
            return np.asarray(
                problem.nominal(X.assign(**{columns[role]: table[role] for role in columns})), dtype=float
            )

        signals, scales = with_rates(read, codes, self._dt), Scales(target=float(self.sense))
        evidence = SignalEvidence(signals, modelled, nominal, codes, self._dt, problem.equation, problem.plant, scales)
        made = [evidence.placements[name].made(values) for name, values in self.effects]
        return np.asarray(modelled + evidence.added_by(made))

    def _codes_of(self, X: pd.DataFrame) -> np.ndarray:
        """Return the run of each row: all of the log's, some of them by their label, or else one."""
        if len(X) == len(self._codes):
            return self._codes
        at = self.problem.X.index.get_indexer(X.index)
        return self._codes[at] if (at >= 0).all() else np.zeros(len(X), dtype=int)
