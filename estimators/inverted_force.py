"""The inverse of a force model: the pressure at which it gives the desired force."""

import warnings
from collections.abc import Callable
from dataclasses import KW_ONLY
from typing import Any, Self

import numpy as np

from pamid.errors import ExtrapolationWarning
from pamid.requirements import check_reads, formulas_of
from pamid.signals.state import State

from ._base import SignalRegressor
from ._checks import check_counts, check_option
from ._inside import ForceInside, state_table
from ._parameters import parameters
from ._streaming import Streaming
from ._trajectories import trajectory_codes
from .inverse_model import POLICIES, PressureAnswer, answer_within, checked_limits

_CHUNK = 20_000
_STEPS = 120


def narrowed(
    off: Callable[[np.ndarray], np.ndarray],
    ends: tuple[np.ndarray, np.ndarray],
    values: tuple[np.ndarray, np.ndarray],
    rounding: float,
) -> np.ndarray:
    """Return roots between brackets, all at once: false position (Illinois), and a halving every third step."""
    (a, b), (at_a, at_b) = ends, values
    rooted = (at_a <= 0.0) != (at_b <= 0.0)
    below, x, was = at_a <= 0.0, a, None
    enough = 1e-12 * float(np.abs(b).max())
    for step in range(1, _STEPS):
        slope = at_b - at_a
        x = 0.5 * (a + b) if step % 3 == 0 else b - at_b * (b - a) / np.where(slope, slope, 1.0)
        value = off(x)
        if ((np.abs(value) <= rounding) | (b - a <= enough) | ~rooted).all():
            break
        left = (value <= 0.0) == below
        if was is not None:  # an end that stays twice counts half, so that it moves at last
            at_a, at_b = np.where(~left & ~was, 0.5 * at_a, at_a), np.where(left & was, 0.5 * at_b, at_b)
        a, at_a = np.where(left, x, a), np.where(left, value, at_a)
        b, at_b = np.where(left, b, x), np.where(left, at_b, value)
        was = left
    return x


@parameters
class InvertedForce(Streaming, ForceInside, SignalRegressor):
    r"""Inverse of a force model by bounded root finding: the pressure at which it gives the desired force.

    .. math:: F(\varepsilon, \dot\varepsilon, P^\ast) = F_\mathrm{wanted}, \quad
        P_\mathrm{low} \le P^\ast \le P_\mathrm{high}

    The range of pressure is searched on a grid for a change of sign of F − F_wanted, which is then narrowed to
    rounding. Where the force is not monotonic the lowest root is taken; without a root the answer is the grid pressure
    with the closest force, flagged.

    Parameters
    ----------
    model : estimator, optional
        Force model that reads ``eps``, ``P`` and perhaps ``deps``, ``dP``; `GeometricForce` by default. It is fitted
        with the inverse; ``sklearn.frozen.FrozenEstimator(model)`` keeps one that is fitted already.
    grid : int, default=33
        Pressures at which roots are searched for.
    on_unreachable : {"warn", "clip", "raise"}, default="warn"
        What `predict` does about pairs that no pressure within the limits brings about: bound the answer and warn,
        bound it silently, or raise `UnreachableError`.

    Attributes
    ----------
    pressure_low_, pressure_high_ : float
        Range of pressure of the fit, Pa.
    eps_low_, eps_high_ : float
        Range of contraction of the fit.

    See Also
    --------
    InverseModel : The inverse learnt directly.

    Notes
    -----
    A model that reads the rate of the pressure is evaluated at constant pressure, ``dP`` = 0: the rate of the desired
    pressure is not known.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import GeometricForce, InvertedForce
    >>> from pamid.volume.braided import chou_hannaford
    >>> eps, P = (a.ravel() for a in np.meshgrid(np.linspace(0.0, 0.2, 8), np.linspace(2e5, 6e5, 8)))
    >>> X = pd.DataFrame({"F": chou_hannaford(P, eps, rest_diameter=0.021, braid_angle=0.45), "eps": eps})
    >>> inverse = InvertedForce(GeometricForce()).fit(X, P)
    >>> bool(abs(inverse.predict(X) - P).max() < 1.0)
    True
    >>> bool(inverse.assess(pd.DataFrame({"F": [1e5], "eps": [0.1]})).saturated[0])
    True
    """

    model: Any = None
    _: KW_ONLY
    grid: int = 33
    pressure_limits: tuple[float, float] | None = None
    on_unreachable: str = "warn"

    equations = ("inverse",)

    @classmethod
    def settings(cls, equation: str) -> dict[str, dict[str, Any]]:  # noqa: D102
        from .geometric_force import GeometricForce
        from .polynomial_force import PolynomialForce
        from .static_pihm import StaticPIHM

        return {
            "chou_hannaford": {"model": GeometricForce(), "on_unreachable": "clip"},
            "tondu_lopez": {"model": GeometricForce("tondu_lopez"), "on_unreachable": "clip"},
            "surface": {"model": PolynomialForce(3, "surface"), "on_unreachable": "clip"},
            "StaticPIHM": {"model": StaticPIHM(random_state=0), "on_unreachable": "clip"},
        }

    @property
    def reads(self) -> tuple[str, ...]:  # type: ignore[override]  # noqa: D102
        return ("F", "eps", *(("deps",) if "deps" in self._read_by_model() else ()))

    def _default_model(self) -> Any:
        from .geometric_force import GeometricForce

        return GeometricForce()

    def fit(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> Self:
        """Fit the force model, and note the range of the pressure.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            Columns ``F`` (N), ``eps`` (dimensionless) and, if the model reads it, ``deps`` (1/s).
        y : array_like, shape (n_samples,)
            Absolute pressure, Pa.
        groups : array_like, shape (n_samples,), optional
            Run of each row, handed on to the model.

        Raises
        ------
        IncompatibleError
            If the model reads signals that an inverse does not have.
        """
        check_counts(self, "grid")
        check_option(self, "on_unreachable", POLICIES)
        checked_limits(self.pressure_limits)
        model = self._own_model()
        check_reads(
            model,
            State._fields,
            needed=("P",),
            sequential=bool(getattr(model, "one_trajectory", True)),
            otherwise=("eps", "P"),
            instead="Choose for instance GeometricForce, PolynomialForce, StaticForceMap or StaticPIHM.",
        )
        clusters = None if groups is None else trajectory_codes(X, groups)
        table, pressure, weight = self._read_weighted(X, y, sample_weight, reset=True)
        eps, deps = self._motion(table)
        given = None if sample_weight is None else weight
        self._fit_inside(self._inputs(eps, deps, pressure), self._signal(table, "F"), given, clusters)
        self._remember(X, y, sample_weight, groups)
        used = weight > 0
        self.pressure_low_, self.pressure_high_ = float(pressure[used].min()), float(pressure[used].max())
        self.eps_low_, self.eps_high_ = float(eps[used].min()), float(eps[used].max())
        return self

    def predict(self, X: Any) -> np.ndarray:
        """Return the absolute pressure, Pa, within the limits, that brings the desired force about."""
        return answer_within(*self.assess(X), self.on_unreachable, type(self).__name__)

    def assess(self, X: Any) -> PressureAnswer:
        """Answer within the limits, and flag rows whose answer is unreliable.

        Returns
        -------
        PressureAnswer
            Pressure (Pa, absolute) and flags: ``saturated`` where there is no root, ``extrapolated`` where the
            contraction or the answer lies outside those of the fit.
        """
        table = self._read_fitted(X, "model_")
        if len(table) <= _CHUNK:
            return self._roots(table)
        parts = [self._roots(table[k : k + _CHUNK]) for k in range(0, len(table), _CHUNK)]
        return PressureAnswer(*(np.concatenate(p) for p in zip(*parts, strict=True)))

    def _roots(self, table: np.ndarray) -> PressureAnswer:
        wanted = self._signal(table, "F")
        eps, deps = self._motion(table)
        low, high = checked_limits(self.pressure_limits) or (self.pressure_low_, self.pressure_high_)
        margin = 0.02 * (self.eps_high_ - self.eps_low_)
        beyond = (eps < self.eps_low_ - margin) | (eps > self.eps_high_ + margin)
        n, size = len(wanted), max(int(self.grid), 2)
        levels = low + (high - low) / (size - 1) * np.arange(size)
        levels[-1] = high
        whole = np.zeros((size, 1))  # one row of the table at each level
        at = ((whole + eps).ravel(), (whole + deps).ravel(), np.repeat(levels, n))
        force = self._force(*at).reshape(size, n)
        off = force - wanted
        signs = off <= 0.0
        crossing = signs[:-1] != signs[1:]
        rooted, first, columns = crossing.any(axis=0), crossing.argmax(axis=0), np.arange(n)
        scale = max(float(np.abs(force).max()), 1e-12)
        missed = np.zeros(n, dtype=bool)
        if every := rooted.all():
            answer = levels[first]
        else:
            nearest = np.abs(off).argmin(axis=0)
            first = np.where(rooted, first, np.minimum(nearest, size - 2))
            missed = ~rooted & (np.abs(off[nearest, columns]) > 1e-3 * scale)
            answer = levels[nearest]
        if every or rooted.any():
            ends = (levels[first], levels[first + 1]), (off[first, columns], off[first + 1, columns])
            found = narrowed(lambda P: self._force(eps, deps, P) - wanted, *ends, rounding=1e-14 * scale)
            answer = found if every else np.where(rooted, found, answer)
        margin = 0.02 * (self.pressure_high_ - self.pressure_low_)
        beyond |= (answer < self.pressure_low_ - margin) | (answer > self.pressure_high_ + margin)
        return PressureAnswer(answer, missed, beyond)

    def _force(self, eps: np.ndarray, deps: np.ndarray, P: np.ndarray) -> np.ndarray:
        """Ask the force model; a pressure of the search beyond its fit is no matter until it is the answer."""
        # A formula needs no table, which would take longer than the model.
        signals = {"eps": eps, "deps": deps, "P": P}
        found = formulas_of(self.model_, {n: signals[n] if n in signals else 0.0 * P for n in self._read_by_model()})
        if len(found) == 1:
            ((_, force),) = found.values()
            return np.asarray(force) if np.shape(force) == P.shape else np.broadcast_to(force, P.shape)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ExtrapolationWarning)
            return np.asarray(self.model_.predict(self._inputs(eps, deps, P)))

    def _motion(self, table: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        eps = self._signal(table, "eps")
        return eps, self._signal(table, "deps") if "deps" in self.reads else np.zeros_like(eps)

    def _inputs(self, eps: np.ndarray, deps: np.ndarray, P: np.ndarray) -> Any:
        """Return the table that the force model reads."""
        return state_table(self._read_by_model(), eps, deps, P, np.zeros_like(P))

    @classmethod
    def _checked_instances(cls) -> list[Any]:
        from .polynomial_force import PolynomialForce

        one = {"F": 0, "eps": 0}
        return [cls(signals=one), cls(PolynomialForce(1), signals=one, grid=5)]
