"""Sparse dynamics from runs, by PySINDy: rates of change, and their simulation."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY
from typing import Any, Self

import numpy as np
import pandas as pd
from sklearn.metrics import r2_score
from sklearn.utils.validation import check_is_fitted, column_or_1d

from pamid.errors import (
    DivergedError,
    MissingColumnError,
    ParameterError,
    SamplingError,
    ShapeError,
    ShortTrajectoryError,
    TimeOrderError,
)

from ._base import SignalRegressor
from ._checks import warn_of_still_columns
from ._parameters import parameters
from ._pysindy import differentiate
from ._sparse_polynomial import PolynomialLibraryMixin
from ._trajectories import run_codes, trajectory_slices

Inputs = Callable[[float], Any]


@parameters
class SINDyModel(PolynomialLibraryMixin, SignalRegressor):
    r"""Sparse dynamics of a muscle or a bench, learnt from runs.

    .. math:: \dot x_i = \sum_k \Xi_{ik}\, \theta_k(x, u), \quad \Xi \text{ sparse}

    with monomials :math:`\theta_k` of states and inputs. The rates are differentiated within each run, or
    given as y. `predict` gives the rates; `simulate` integrates them.

    Parameters
    ----------
    states : sequence of str, default=("P",)
        Signals whose rates are learnt, for instance the absolute pressure (Pa), or ``("q", "dq", "P1", "P2")``.
    inputs : sequence of str, default=("eps", "deps", "mdot")
        Further signals that drive them: contraction ratio (dimensionless), its rate (1/s), mass flow (kg/s).
    sign_of : sequence of str, default=()
        Signals whose sign enters the library too (Coulomb friction, valves that fill and vent differently).
    sampling_period : float, optional
        Time between rows, s. Without it the time is read from a column.
    time : str or int, default="time"
        Column of the time (s), by name or position; read only if there is no sampling period.
    smoothing_window : int, default=11
        Rows of the smoothing before differentiation, odd; below 5 nothing is smoothed.

    Attributes
    ----------
    coef_ : ndarray, shape (n_states, n_terms)
        Coefficient of each term in each rate, in units of the state per second over units of the term.
    coefficients_ : dict of str to dict
        For each state the terms that were kept, and their coefficients.
    equations_ : list of str
        The dynamics, written out.

    See Also
    --------
    SINDyRegressor : Static force or flow with the same libraries.

    References
    ----------
    S. L. Brunton, J. L. Proctor, J. N. Kutz, "Sparse identification of nonlinear dynamics with control (SINDYc)",
    IFAC-PapersOnLine 49(18), 2016. https://doi.org/10.1016/j.ifacol.2016.10.249

    Examples
    --------
    A chamber that fills towards 6 bar with a time constant of 0.2 s:

    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import SINDyModel
    >>> t = np.linspace(0, 1, 201)
    >>> run = pd.DataFrame({"time": t, "P": 6e5 - 5e5 * np.exp(-t / 0.2)})
    >>> model = SINDyModel(("P",), (), degree=1, one_trajectory=True).fit(run)
    >>> {term: round(c, -5) if term == "1" else round(c, 2) for term, c in model.coefficients_["P"].items()}
    {'1': 3000000.0, 'P': -5.0}
    >>> bool(abs(model.simulate([1e5], t)[-1, 0] - run["P"].iloc[-1]) < 500)
    True
    """

    states: Sequence[str] = ("P",)
    inputs: Sequence[str] = ("eps", "deps", "mdot")
    _: KW_ONLY
    degree: int = 2
    sampling_period: float | None = None
    time: str | int = "time"
    smoothing_window: int = 11
    one_trajectory: bool = False

    _checked = (
        {"states": ("x",), "inputs": (), "sampling_period": 0.1, "smoothing_window": 5, "one_trajectory": True},
        {"inputs": ("eps",), "sampling_period": 1.0, "degree": 1, "one_trajectory": True},
    )

    @property
    def reads(self) -> tuple[str, ...]:  # type: ignore[override]  # noqa: D102
        return (*self.states, *self.inputs)

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.target_tags.required = False
        tags.target_tags.multi_output = len(self.states) > 1
        return tags

    def fit(self, X: Any, y: Any = None, groups: Any = None) -> Self:
        """Learn the dynamics.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            States and inputs, SI units, in time order within each run.
        y : array_like, shape (n_samples,) or (n_samples, n_states), optional
            Rates of the states, in their units per second, if they are known; time order then plays no part.

        Raises
        ------
        MissingTrajectoryError
            If rates have to be differentiated and nothing says which rows form a run.
        ShortTrajectoryError
            If a run is shorter than the smoothing window.
        """
        signals, rates, weights = self._rows(X, y, groups, reset=True, ensure_min_samples=2)
        warn_of_still_columns(signals, self.reads, type(self).__name__)
        self._fit_library(signals, self.reads, rates, weights)
        return self._named()

    def partial_fit(self, X: Any, y: Any = None, groups: Any = None) -> Self:
        """Take in further runs: after any number of batches the dynamics are those of one `fit` on all.

        Rates are differentiated within the batch; its rows are then compressed into a triangular factor of fixed size,
        which gives the sparse regression the same information as the rows.

        Parameters
        ----------
        groups : array_like, shape (n_samples,), optional
            Run of each row; no run continues from one call to the next.
        """
        if not hasattr(self, "factor_"):
            return self.fit(X, y, groups)
        self._take_in(*self._rows(X, y, groups, reset=False))
        return self._named()

    def _rows(self, X: Any, y: Any, groups: Any, **how: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return states and inputs, rates and weights."""
        columns, y = self._read(X, y, **how)
        self._check_library(self.reads)
        rates = self._rates(X, columns, groups) if y is None else self._as_rates(y)
        return self._signals(columns, self.reads), rates, np.ones(len(columns))

    def _named(self) -> Self:
        """Set what the coefficients are called."""
        self.coef_ = self._physical_coefficients()
        self.coefficients_ = {
            str(state): {t: float(c) for t, c in zip(self.terms_, row, strict=True) if c != 0}
            for state, row in zip(self.states, self.coef_, strict=True)
        }
        self.equations_ = self._equations([f"d{state}/dt" for state in self.states])
        return self

    def predict(self, X: Any) -> np.ndarray:
        """Give the rates of the states.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            States and inputs, SI units; rows in any order.

        Returns
        -------
        ndarray, shape (n_samples,) or (n_samples, n_states)
            Rates, in the states' units per second; one-dimensional for one state.
        """
        rates = self._evaluate(self._signals(self._read_fitted(X, "coef_"), self.reads))
        return rates[:, 0] if rates.shape[1] == 1 else rates

    def score(self, X: Any, y: Any = None, sample_weight: Any = None, groups: Any = None) -> float:
        """Coefficient of determination of the rates, the mean over the states.

        Parameters
        ----------
        y : array_like, shape (n_samples,) or (n_samples, n_states), optional
            Rates of the states; if None they are differentiated as in fit.
        groups : array_like, shape (n_samples,), optional
            Run of each row, needed if y is None.
        """
        predicted = self.predict(X)
        if y is None:
            columns, _ = self._read(X, reset=False)
            y = self._rates(X, columns, groups)
        return float(r2_score(y, predicted, sample_weight=sample_weight))

    def simulate(
        self, x0: Any, t: Any, u: Any = None, *, method: str = "LSODA", rtol: float = 1e-6, atol: Any = None
    ) -> np.ndarray:
        """Integrate the dynamics from an initial state.

        Parameters
        ----------
        x0 : array_like, shape (n_states,), or mapping of str to float
            Initial state, in the units of fit.
        t : array_like, shape (n_times,)
            Times (s), increasing, at which the states are wanted.
        u : array_like, shape (n_times, n_inputs), DataFrame, or callable, optional
            Inputs at these times, interpolated linearly between them, or a function of time (s).
        method : str, default="LSODA"
            Method of ``scipy.integrate.solve_ivp``.
        rtol : float, default=1e-6
            Relative tolerance, dimensionless.
        atol : float or array_like, optional
            Absolute tolerance in the states' units; by default 1e-8 of each state's root mean square.

        Returns
        -------
        ndarray, shape (n_times, n_states)
            States over time, in the units of fit.

        Raises
        ------
        DivergedError
            If the states become infinite.
        """
        from scipy.integrate import solve_ivp

        check_is_fitted(self)
        t = np.asarray(t, dtype=float).ravel()
        if len(t) < 2 or not (np.diff(t) > 0).all():
            raise TimeOrderError(
                "t does not increase, or has fewer than two entries.", "increasing times in s", "Sort t."
            )
        start = np.array([x0[s] for s in self.states] if isinstance(x0, Mapping) else x0, dtype=float).ravel()
        if start.shape != (len(self.states),):
            raise ShapeError(
                f"x0 has {start.size} entries.", f"{len(self.states)} ({', '.join(self.states)})", "Pass one per state."
            )
        drive = self._drive(t, u)
        limit = 1e6 * np.maximum(self.signal_scales_[: len(start)], np.abs(start))

        def rate(time: float, x: np.ndarray) -> np.ndarray:
            return self._evaluate(np.concatenate([x, drive(time)])[None])[0]

        def escapes(time: float, x: np.ndarray) -> float:
            return float(np.min(limit - np.abs(x)))

        escapes.terminal = True  # type: ignore[attr-defined]
        tolerance = 1e-8 * self.signal_scales_[: len(start)] if atol is None else atol
        with np.errstate(over="ignore", invalid="ignore"):
            done = solve_ivp(
                rate, (t[0], t[-1]), start, method=method, t_eval=t, rtol=rtol, atol=tolerance, events=escapes
            )
        if done.status != 0 or not np.isfinite(done.y).all():
            raise DivergedError(
                f"The simulation of {', '.join(self.states)} left the range of the fit a million times over, or "
                f"stopped, at t = {done.t[-1] if len(done.t) else t[0]:.4g} s.",
                "states that stay bounded",
                "Raise the threshold, lower the degree, or start within the range of the fit.",
            )
        return np.asarray(done.y.T)

    def _drive(self, t: np.ndarray, u: Any) -> Inputs:
        """Inputs as a function of time."""
        n = len(self.inputs)
        if n == 0:
            return lambda time: np.empty(0)
        if callable(u):
            return lambda time: np.asarray(u(time), dtype=float).ravel()
        if isinstance(u, pd.DataFrame):
            u = u[list(self.inputs)]
        table = np.empty((0, 0)) if u is None else np.asarray(u, dtype=float).reshape(-1, n)
        if table.shape != (len(t), n):
            raise ShapeError(
                f"u has {len(table)} rows for {len(t)} times.",
                f"{n} inputs ({', '.join(self.inputs)}) at each time, or a function of time",
                "Pass u with one row per time.",
            )
        return lambda time: np.array([np.interp(time, t, column) for column in table.T])

    def _as_rates(self, y: np.ndarray) -> np.ndarray:
        if len(self.states) == 1 and y.ndim == 2 and y.shape[1] == 1:
            y = column_or_1d(y, warn=True)
        rates = np.asarray(y, dtype=float)
        rates = rates[:, None] if rates.ndim == 1 else rates
        if rates.shape[1] != len(self.states):
            raise ShapeError(
                f"y has {rates.shape[1]} columns.",
                f"the rates of {len(self.states)} states ({', '.join(self.states)})",
                "Pass one column per state, or no y to have the rates differentiated.",
            )
        return rates

    def _rates(self, X: Any, columns: np.ndarray, groups: Any) -> np.ndarray:
        """Differentiate the states within each run."""
        states = self._signals(columns, self.states)
        rates = np.empty_like(states)
        time = self._times(columns)
        least = max(int(self.smoothing_window), 3)
        for number, rows in enumerate(trajectory_slices(run_codes(self, X, groups))):
            n = rows.stop - rows.start
            if n < least:
                raise ShortTrajectoryError(
                    f"Run number {number} has {n} rows.",
                    f"at least {least} for differentiation with smoothing_window={self.smoothing_window}",
                    "Use a smaller odd smoothing_window, leave the run out, or pass the rates as y.",
                )
            t = np.arange(n) * float(self.sampling_period) if self.sampling_period is not None else time[rows]
            if not (np.diff(t) > 0).all():
                raise TimeOrderError(
                    f"Time does not increase in run number {number}.",
                    "increasing times in s",
                    "Sort the rows of each run by time and drop repeated rows.",
                )
            rates[rows] = differentiate(states[rows], t, int(self.smoothing_window))
        return rates

    def _times(self, columns: np.ndarray) -> np.ndarray:
        if self.sampling_period is not None:
            if not np.isfinite(self.sampling_period) or self.sampling_period <= 0:
                raise ParameterError(
                    f"sampling_period is {self.sampling_period!r}.", "a positive time in s", "Correct it."
                )
            return np.empty(0)
        names = [str(name) for name in getattr(self, "feature_names_in_", ())]
        if isinstance(self.time, str) and self.time in names:
            return columns[:, names.index(self.time)]
        if not isinstance(self.time, str) and 0 <= self.time < columns.shape[1]:
            return columns[:, self.time]
        if isinstance(self.time, str) and not names:
            raise SamplingError(
                "X is an array without names, and no sampling_period is set.",
                "a sampling period in s, or a column of times",
                "Set sampling_period=, or time= to the position of the column of times.",
            )
        raise MissingColumnError(
            f"X has no column {self.time!r} of times; it has {', '.join(names) or columns.shape[1]}.",
            "a sampling period in s, or a column of times",
            "Set sampling_period=, or time= to the column of times.",
        )
