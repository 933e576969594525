"""Force models with a closed formula of few parameters, most of them linear: their fit and what they say of it."""

from collections.abc import Mapping
from dataclasses import KW_ONLY, field
from typing import Any, ClassVar, Self

import numpy as np
from scipy.optimize import lsq_linear

from pamid.constants import ATMOSPHERIC_PRESSURE
from pamid.errors import ParameterError, UnknownOptionError
from pamid.fitting.least_squares import cluster_covariance, fit_nonlinear
from pamid.signals.plausibility import check_units
from pamid.signals.state import State
from pamid.volume import FitParameter

from ._base import SignalRegressor, state_of
from ._classical import BoundedFit, warn_of_still_signals
from ._parameters import parameters
from ._streaming import Streaming
from ._trajectories import trajectory_codes

Values = Mapping[str, Any]
_AT_REST = 1e-6  # rate of contraction, 1/s, below which nothing moves
_NORMAL_95 = 1.959963984540054


@parameters
class EmpiricalForce(Streaming, BoundedFit, SignalRegressor):
    """A force as a formula of the state; subclasses give the formula, its parameters and where the search starts.

    Parameters
    ----------
    fixed : mapping of str to float, optional
        Parameters that are held, and their values, SI units.

    Attributes
    ----------
    intervals_ : dict of str to tuple of two floats
        Their 95 % intervals.
    """

    equations = ("force",)
    _nonlinear: ClassVar[tuple[str, ...]] = ()
    """Parameters in which the force is not linear; in all others it is, for given values of these."""
    _moving: ClassVar[tuple[str, ...]] = ("eps", "P")
    """Signals that an experiment must move."""

    _: KW_ONLY
    fixed: Mapping[str, float] | None = None
    atmospheric_pressure: float = ATMOSPHERIC_PRESSURE
    max_iter: int = field(default=200, init=False)

    # --- what a subclass gives ----------------------------------------------------------------------------------
    _parameters: ClassVar[tuple[FitParameter, ...]] = ()
    """Parameters of the formula, where they do not depend on the settings."""
    _positive: ClassVar[tuple[str, ...]] = ("rest_length",)
    """Settings that must be above 0."""

    def _declared(self) -> dict[str, FitParameter]:
        """Return every parameter by name."""
        for name in self._positive:
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ParameterError(f"{name} is {value!r}.", "a finite number above 0", f"Correct {name}.")
        return {p.name: p for p in self._parameters}

    def _force(self, values: Values, state: State) -> Any:
        """Return the force, N, for values that may be complex."""
        raise NotImplementedError

    def parameter_bounds(self) -> dict[str, tuple[float, float]]:
        """Bounds of every parameter, SI units."""
        return {name: (p.lower, p.upper) for name, p in self._declared().items()}

    def _grid(self) -> list[dict[str, float]]:
        """Return values of the nonlinear parameters from which the search starts."""
        return [{}]

    def _prepare(self, state: State, weight: np.ndarray) -> None:
        """Note what the formula needs to know of the data, before the fit."""

    # --- fit ----------------------------------------------------------------------------------------------------
    def fit(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> Self:
        """Identify the parameters by bounded least squares.

        Parameters
        ----------
        y : array_like, shape (n_samples,)
            Tension, N.
        groups : array_like, shape (n_samples,), optional
            Run of each row. It does not change the fit, only its standard errors: residuals of one
            run are then taken as dependent.
        """
        clusters = None if groups is None else trajectory_codes(X, groups)
        table, y, weight = self._read_weighted(X, y, sample_weight, reset=True, ensure_min_samples=2)
        state = state_of(self, table)
        if np.abs(state.deps).max(initial=0.0) < _AT_REST:  # rounding of a filter, which must not enter a damping
            state = state._replace(deps=np.zeros(len(table)))
        check_units({name: self._signal(table, name) for name in self.reads} | {"F": y})
        warn_of_still_signals(state, self._moving, type(self).__name__)
        self._prepare(state, weight)
        declared = self._declared()
        held = {n: float(v) for n, v in dict(self.fixed or {}).items()}
        if unknown := sorted(set(held) - set(declared)):
            raise UnknownOptionError(
                f"fixed names {', '.join(unknown)}, which {type(self).__name__} does not have.",
                f"names among {', '.join(declared)}",
                "Correct the names.",
            )
        names = tuple(n for n in declared if n not in held)
        self.parameters_, covariance, at_bound, self.n_iter_ = self._identify(
            names, held, declared, state, y, weight, clusters
        )
        self.fitted_names_ = list(names)
        self.at_bound_ = [n for n, b in zip(names, at_bound, strict=True) if b]
        self.covariance_ = covariance
        self.units_ = {n: p.unit for n, p in declared.items()}
        errors = np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist() if names else []
        self.standard_errors_ = dict.fromkeys(declared, 0.0) | dict(zip(names, errors, strict=True))
        self.intervals_ = {
            n: (v - _NORMAL_95 * self.standard_errors_[n], v + _NORMAL_95 * self.standard_errors_[n])
            for n, v in self.parameters_.items()
        }
        self._remember(X, y, sample_weight, groups)
        return self

    def _identify(
        self,
        names: tuple[str, ...],
        held: dict[str, float],
        declared: dict[str, FitParameter],
        state: State,
        y: np.ndarray,
        weight: np.ndarray,
        clusters: np.ndarray | None,
    ) -> tuple[dict[str, float], np.ndarray, np.ndarray, int]:
        """Solve the linear parameters on a grid of the others, then polish all together."""
        linear = [n for n in names if n not in self._nonlinear]
        lower, upper = (np.array([getattr(declared[n], side) for n in names]) for side in ("lower", "upper"))
        best, least = None, np.inf
        for start in self._grid():
            values = dict.fromkeys(declared, 0.0) | start | held
            columns, rest = self._columns_of(linear, values, state)
            solved = _bounded(columns, y - rest, weight, [declared[n] for n in linear])
            error = y - rest - columns @ solved
            cost = float(np.sum(weight * error * error))
            if best is None or cost < least:
                best, least = values | dict(zip(linear, solved.tolist(), strict=True)), cost
        assert best is not None
        if not names:
            return best, np.zeros((0, 0)), np.zeros(0, dtype=bool), 1
        if all(n in linear for n in names):
            columns, rest = self._columns_of(linear, best, state)
            x = np.array([best[n] for n in names])
            bound = (x <= lower) | (x >= upper)
            covariance = np.diag(np.where(bound, np.inf, 0.0))
            free = np.flatnonzero(~bound)
            if free.size:
                part = clusters if clusters is not None else np.arange(len(y))
                own = cluster_covariance(columns[:, free], y - rest - columns @ x, weight, part)
                covariance[np.ix_(free, free)] = own
            return best, covariance, bound, 1

        def predict(x: np.ndarray) -> np.ndarray:
            return np.asarray(self._force(best | dict(zip(names, x, strict=True)), state))

        solution = fit_nonlinear(
            predict,
            y,
            weight,
            np.array([best[n] for n in names]),
            lower,
            upper,
            clusters=clusters,
            max_iter=self.max_iter,
        )
        found = best | dict(zip(names, solution.x.tolist(), strict=True))
        return found, solution.covariance, solution.at_bound, solution.n_iter

    def _columns_of(self, linear: list[str], values: dict[str, float], state: State) -> tuple[np.ndarray, np.ndarray]:
        """Return the regressors of the linear parameters, shape (n, n_linear), and the force without them."""
        none = values | dict.fromkeys(linear, 0.0)
        rest = np.broadcast_to(np.asarray(self._force(none, state), dtype=float), state.eps.shape)
        columns = [np.asarray(self._force(none | {n: 1.0}, state), dtype=float) - rest for n in linear]
        return (np.stack(columns, axis=1) if columns else np.zeros((len(rest), 0))), rest

    # --- prediction ---------------------------------------------------------------------------------------------
    def predict(self, X: Any) -> np.ndarray:
        """Predict the tension, N."""
        table = self._read_fitted(X, "parameters_")
        force = np.asarray(self._force(self.parameters_, state_of(self, table)), dtype=float)
        return np.broadcast_to(force, (len(table),)).copy()

    def formulas(self, signals: Mapping[str, Any]) -> dict[str, tuple[str, Any]]:
        """Return the predictions as formulas of the signals, which may be symbols: what an export writes."""
        state = State(*(signals.get(s, 0.0) for s in State._fields))
        return {"force": ("N", self._force(self.parameters_, state))}

    def _gauge(self, state: State) -> Any:
        return state.P - self.atmospheric_pressure


def _bounded(columns: np.ndarray, y: np.ndarray, weight: np.ndarray, declared: list[FitParameter]) -> np.ndarray:
    """Solve bounded linear least squares; what the rows do not tell stays at the bound, or zero, nearest to it."""
    out = np.array([min(max(0.0, p.lower), p.upper) for p in declared])
    root = np.sqrt(weight)[:, None]
    size = np.linalg.norm(root * columns, axis=0)
    told = np.flatnonzero(size > 0)
    if not told.size:
        return out
    lower = np.array([declared[k].lower for k in told]) * size[told]
    upper = np.array([declared[k].upper for k in told]) * size[told]
    rows = np.column_stack([root * columns[:, told] / size[told], root[:, 0] * y])
    triangle = np.asarray(np.linalg.qr(rows, mode="r"))
    solution = lsq_linear(triangle[:, :-1], triangle[:, -1], (lower, upper), method="bvls")
    out[told] = solution.x / size[told]
    return out
