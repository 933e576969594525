"""The nominal equation of a system with the effects that its simulator file adds."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from ..effects import EffectSpec
from ..gap.one_equation import equation_of, sampling_interval
from ..simulators.placement import Scales
from ..simulators.problem import Problem


class WithEffects:
    """What a nominal equation says once effects are added, which in a sense of -1 add to the target."""

    def __init__(self, problem: Problem, effects: Sequence[EffectSpec], sense: int) -> None:
        self.problem, self.effects, self.sense = problem, effects, sense
        self._codes = problem.codes
        self._dt = sampling_interval({"time": problem.X["time"].to_numpy(dtype=float)}, self._codes, 1.0)

    def __call__(self, X: pd.DataFrame) -> np.ndarray:
        """Return the modelled target of some rows, of whole runs where an effect has memory."""
        found = equation_of(self.problem._replace(X=X, groups=self._codes_of(X)), self.sense, dt=self._dt)
        places = found.placements(Scales())
        return found.modelled([(places[name], places[name].made(values)) for name, values in self.effects])

    def _codes_of(self, X: pd.DataFrame) -> np.ndarray:
        """Return the run of each row: all of the log's, some of them by their label, or else one."""
        if len(X) == len(self._codes):
            return self._codes
        at = self.problem.X.index.get_indexer(X.index)
        return self._codes[at] if (at >= 0).all() else np.zeros(len(X), dtype=int)
