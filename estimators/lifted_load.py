"""Contraction of a muscle under a load in free run: any force model, integrated by Newton's law."""

from __future__ import annotations

import warnings
from dataclasses import KW_ONLY
from typing import Any, Self

import numpy as np
from sklearn.utils.validation import column_or_1d

from pamid.constants import GRAVITY
from pamid.errors import ExcitationWarning, ParameterError, TimeOrderError
from pamid.requirements import check_reads, parameter_count
from pamid.signals.state import State

from ._base import SignalRegressor
from ._checks import check_sizes
from ._inside import ForceInside, state_table
from ._narx import FreeRun
from ._parameters import parameters
from ._sequences import SequenceMixin
from ._streaming import SequenceStreaming
from ._trajectories import trajectory_slices

LIFTED = 0.002
"""Contraction above which a load no longer rests on its stand."""

LONGEST_STEP = 0.01
"""Longest step of the integration, s."""

NUDGE = 1e-4
"""Contraction, and its rate (1/s), by which the slopes of the force are taken."""


@parameters
class LiftedLoad(SequenceStreaming, SequenceMixin, ForceInside, SignalRegressor):
    r"""Contraction of a muscle that lifts a load, in free run: any force model, integrated by Newton's law.

    .. math:: M L_0\,\ddot\varepsilon = F(\varepsilon, \dot\varepsilon, P, \dot P) - M g, \qquad \varepsilon \ge 0

    The fit needs no load cell: where the load is off its stand, its weight and inertia are the force. A prediction
    starts from the first contraction of each run and follows from pressure and load alone. Steps are linearly implicit
    in the model's own stiffness and damping, so that they are stable however stiff the muscle is.

    Parameters
    ----------
    model : estimator, optional
        Force model of single rows of ``eps``, ``P`` and perhaps ``deps``, ``dP``; `ThreeElement` by default.
    load : str or float, default="load"
        Signal of the load M, kg, or one load for all rows.
    time : str or None, default="time"
        Signal of the time, s; None for rows `step` apart.
    step : float, default=0.01
        Spacing of the rows where there is no time, s.
    start : str, optional
        Signal whose first value in a run is the contraction at its start; by default the load rests on its stand.
    margin : float, default=0.1
        Share of the range of contraction of the fit by which a run may leave it.

    Attributes
    ----------
    eps_low_, eps_high_ : float
        Range of contraction of the fit.
    pressure_low_, pressure_high_ : float
        Range of pressure of the fit, Pa.
    n_lifted_ : int
        Rows that determine the force: those whose load was off its stand.

    See Also
    --------
    ForwardModel : Contraction from pressure and load, learnt directly.
    NNARX : Contraction from its own past and that of pressure and load.

    Examples
    --------
    >>> from pamid.bench.single import LiftSettings, simulate_lift
    >>> from pamid.estimators import LiftedLoad
    >>> log = simulate_lift(loads=[20, 40, 80], every=50, settings=LiftSettings(frequency=0.25))
    >>> X = log[["trajectory", "time", "P", "load"]]
    >>> model = LiftedLoad().fit(X, log["eps"])
    >>> bool(model.score(X, log["eps"]) > 0.9)
    True
    """

    model: Any = None
    _: KW_ONLY
    rest_length: float = 0.2
    load: str | float = "load"
    time: str | None = "time"
    step: float = 0.01
    start: str | None = None
    margin: float = 0.1

    equations = ("dynamic",)
    outputs = ("eps",)

    @classmethod
    def settings(cls, equation: str) -> dict[str, dict[str, Any]]:  # noqa: D102
        from .geometric_force import GeometricForce
        from .static_pihm import StaticPIHM
        from .three_element import ThreeElement

        return {
            "ThreeElement": {"model": ThreeElement()},
            "tondu_lopez": {"model": GeometricForce("tondu_lopez")},
            "StaticPIHM": {"model": StaticPIHM(random_state=0)},
        }

    @property
    def reads(self) -> tuple[str, ...]:  # type: ignore[override]  # noqa: D102
        named = (self.time, "P", self.load if isinstance(self.load, str) else None, self.start)
        return tuple(dict.fromkeys(name for name in named if name))

    def _default_model(self) -> Any:
        from .three_element import ThreeElement

        return ThreeElement(rest_length=self.rest_length)

    def fit(self, X: Any, y: Any, groups: Any = None) -> Self:
        """Identify the force model on the weight and inertia of the lifted load.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            Time (s), absolute pressure ``P`` (Pa) and load (kg), the rows of each run in time order.
        y : array_like, shape (n_samples,)
            Contraction ratio.

        Raises
        ------
        MissingTrajectoryError, TimeOrderError, ParameterError
            If nothing names the runs, time does not increase within one, or a load is not positive.
        IncompatibleError
            If the model reads other signals than ``eps``, ``deps``, ``P``, ``dP``, or learns sequences.

        Warns
        -----
        ExcitationWarning
            If all rows have the same load, which hardly determines the force.
        """
        check_sizes(self, rest_length=0.0, step=0.0, margin=0.0)
        reads = check_reads(
            self._own_model(),
            State._fields,
            needed=("P",),
            sequential=False,
            instead="Choose for instance ThreeElement, GeometricForce or StaticPIHM.",
        )
        table, y = self._read(X, y, reset=True)
        eps = np.asarray(column_or_1d(y, warn=True), dtype=float)
        codes = self._codes(X, table, groups)
        slices = trajectory_slices(codes)
        t, P, M = self._motion(table, slices)
        if np.ptp(M) < 0.01 * M.max():
            warnings.warn(
                f"All rows have a load of {M[0]:g} kg. Expected several loads: under one the force hardly varies, "
                "and any model that says its weight everywhere fits. Record runs under other loads.",
                ExcitationWarning,
                stacklevel=3,
            )
        deps, dP = _rates(t, eps, slices), _rates(t, P, slices)
        force = M * (GRAVITY + self.rest_length * _rates(t, deps, slices))
        lifted = eps > LIFTED
        if not lifted.any():
            lifted[:] = True
        self.n_lifted_ = int(lifted.sum())
        self.eps_low_, self.eps_high_ = float(eps.min()), float(eps.max())
        self.pressure_low_, self.pressure_high_ = float(P.min()), float(P.max())
        self._fit_inside(state_table(reads, eps, deps, P, dP)[lifted], force[lifted], groups=codes[lifted])
        self._remember(X, y, groups=groups)
        if (count := parameter_count(self.model_)) is not None:
            self.n_parameters_ = count
        return self

    def predict(self, X: Any, groups: Any = None) -> np.ndarray:
        """Simulate the contraction ratio of each run freely, and warn where it had to be held."""
        return self.simulate(X, groups=groups).told(type(self).__name__, "contractions")

    def simulate(self, X: Any, groups: Any = None) -> FreeRun:
        """Simulate all runs freely, side by side.

        Returns
        -------
        FreeRun
            Contractions, rows at which a run was held at the edge of those of the fit, and rows whose pressure lies
            outside the fit.
        """
        table = self._read_fitted(X, "model_")
        slices = trajectory_slices(self._codes(X, table, groups))
        slices.sort(key=lambda s: s.start - s.stop)  # the longest first: those that still run are then the first ones
        t, P, M = self._motion(table, slices)
        dP = _rates(t, P, slices)
        first = np.array([s.start for s in slices])
        length = np.array([s.stop - s.start for s in slices])
        top = self.eps_high_ + self.margin * (self.eps_high_ - self.eps_low_)
        y, held = np.empty(len(table)), np.zeros(len(table), dtype=bool)
        eps = self._signal(table, self.start)[first] if self.start else np.zeros(len(first))
        eps, v = np.clip(eps, 0.0, top), np.zeros(len(first))
        y[first] = eps
        for k in range(1, int(length.max())):
            going = int((length > k).sum())
            before, after = first[:going] + k - 1, first[:going] + k
            gap = t[after] - t[before]
            n = max(1, int(np.ceil(float(gap.max()) / LONGEST_STEP)))
            eps, v, stopped = eps[:going], v[:going], np.zeros(going, dtype=bool)
            for i in range(n):
                share = (i + 1) / n
                now, rate, mass = (a[before] + share * (a[after] - a[before]) for a in (P, dP, M))
                eps, v = self._advance(eps, v, now, rate, mass, gap / n)
                stopped |= eps > top
                v = np.where((eps < 0.0) | (eps > top), 0.0, v)
                eps = np.clip(eps, 0.0, top)
            y[after], held[after] = eps, stopped
        width = 1e-9 * (self.pressure_high_ - self.pressure_low_)
        low, high = self.pressure_low_ - width, self.pressure_high_ + width
        return FreeRun(y, held, (low > P) | (high < P))

    def _advance(
        self, eps: np.ndarray, v: np.ndarray, P: np.ndarray, dP: np.ndarray, M: np.ndarray, h: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Take a step, linearly implicit in stiffness and damping; a negative one is taken for none."""
        many = state_table(
            tuple(self.model_.reads),
            np.concatenate([eps, eps + NUDGE, eps]),
            np.concatenate([v, v, v + NUDGE]),
            np.tile(P, 3),
            np.tile(dP, 3),
        )
        force, stretched, moved = np.asarray(self.model_.predict(many), dtype=float).reshape(3, -1)
        stiff, damp = (np.minimum((f - force) / NUDGE, 0.0) for f in (stretched, moved))
        inertia = M * self.rest_length - h * damp
        v = (inertia * v + h * (force - M * GRAVITY)) / (inertia - h * h * stiff)
        return eps + h * v, v

    def _motion(self, table: np.ndarray, slices: list[slice]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return time (s), pressure (Pa) and load (kg) of each row."""
        t = self.step * np.arange(len(table)) if self.time is None else self._signal(table, self.time)
        for s in slices:
            if (np.diff(t[s]) <= 0).any():
                raise TimeOrderError("The time does not increase within a run.", "increasing times", "Sort the rows.")
        fixed = not isinstance(self.load, str)
        M = np.full(len(table), float(self.load)) if fixed else self._signal(table, str(self.load))
        if not (np.isfinite(M) & (M > 0)).all():
            raise ParameterError(f"The least load is {M.min():g}.", "masses in kg, above 0", "Correct the load.")
        return t, self._signal(table, "P"), M

    @staticmethod
    def _checked_instances() -> list[LiftedLoad]:
        from .polynomial_force import PolynomialForce

        # each row a run of its own, as predictions must not change with the order of rows
        one: dict[str, Any] = {"signals": {"P": 0}, "trajectory_column": 0, "time": None, "load": 20.0}
        return [LiftedLoad(PolynomialForce(1), **one)]


def _rates(t: np.ndarray, values: np.ndarray, slices: list[slice]) -> np.ndarray:
    """Differentiate within each run; a run of one row rests."""
    out = np.zeros(len(values))
    for s in slices:
        if s.stop - s.start > 1:
            out[s] = np.gradient(values[s], t[s])
    return out
