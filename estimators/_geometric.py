"""A named volume model whose parameters are fitted by bounded nonlinear least squares, whatever the law."""

import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import KW_ONLY, field, fields, replace
from functools import lru_cache
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from pamid.constants import ATMOSPHERIC_PRESSURE
from pamid.errors import ParameterError, UnknownOptionError, VolumeWarning
from pamid.fitting.least_squares import Solution, fit_nonlinear
from pamid.signals.state import State
from pamid.volume import ClassicalVolume, FitParameter, VolumeJet, all_volumes

from ._classical import BoundedFit, ClassicalRegressor, warn_of_still_signals
from ._parameters import parameters
from ._streaming import Streaming

IMPLAUSIBLE = 2.0
"""Factor between fitted and stated diameter beyond which the fit is implausible: four times the force."""


@lru_cache(maxsize=64)  # a controller asks row by row
def _made(
    cls: type[ClassicalVolume], length: float, diameter: float, angle: float, atmospheric_pressure: float
) -> ClassicalVolume:
    """Return the volume of a muscle of a geometry."""
    nominal = cls.from_geometry(length, diameter, angle)
    if "atmospheric_pressure" in {f.name for f in fields(nominal)}:
        nominal = replace(nominal, atmospheric_pressure=atmospheric_pressure)  # type: ignore[call-arg]
    return nominal


@lru_cache(maxsize=64)
def _changed(nominal: ClassicalVolume, values: tuple[tuple[str, float], ...]) -> ClassicalVolume:
    """Return a volume with other values of its parameters; those of the law are passed over."""
    known = set(nominal.parameter_names())
    return replace(nominal, **{name: value for name, value in values if name in known})


@parameters
class GeometricRegressor(Streaming, BoundedFit, ClassicalRegressor):
    """From the name of a volume model to its parameters with units and errors, whatever the law.

    Parameters
    ----------
    model : {"chou_hannaford", "tondu_lopez", "bou_saba", "cylinder"}
        Name of the volume model; every model with scalar parameters in `pamid.volume.all_volumes` will do.
    rest_diameter : float
        D₀, m: start of the fit, or the value held.
    braid_angle : float
        θ₀ to the axis at rest, rad: start of the fit, or the value held.
    start : mapping of str to float, optional
        Starting or held values of the model's other parameters, such as ``{"end_cap": 1.1}``.
    free : "auto", "all" or list of str
        Parameters to fit. "auto" takes those that the model declares as free.
    bounds : mapping of str to (float, float), optional
        Bounds that replace the model's own, in SI units.
    """

    model: str = "chou_hannaford"
    _: KW_ONLY
    rest_length: float = 0.2
    rest_diameter: float = 0.02
    braid_angle: float = 0.4363
    start: Mapping[str, float] | None = None
    free: str | Iterable[str] = "auto"
    bounds: Mapping[str, tuple[float, float]] | None = None
    max_iter: int = 200

    atmospheric_pressure: float = field(default=ATMOSPHERIC_PRESSURE, init=False)
    _silent: ClassVar[tuple[str, ...]] = ()
    """Parameters of volume models that the law cannot see, and which are never freed by default."""
    _moving: ClassVar[tuple[str, ...]] = ("eps", "P")
    """Signals that an experiment must move."""

    @classmethod
    def settings(cls, equation: str) -> dict[str, dict[str, Any]]:
        return {name: {"model": name} for name, volume in all_volumes().items() if volume.parameters}

    def _nominal(self) -> ClassicalVolume:
        """Return the model at the starting values."""
        cls = all_volumes().get(self.model)
        if cls is None or not cls.parameters:
            offered = [name for name, volume in all_volumes().items() if volume.parameters]
            raise UnknownOptionError(f"model is {self.model!r}.", f"one of {', '.join(offered)}", "Correct the name.")
        for name in ("rest_length", "rest_diameter", "braid_angle"):
            value = getattr(self, name)
            if not (isinstance(value, (int, float, np.number)) and 0.0 < float(value) < np.inf):
                raise ParameterError(f"{name} is {value!r}.", "a positive number (m, m, rad)", "Correct it.")
        nominal = _made(cls, self.rest_length, self.rest_diameter, self.braid_angle, self.atmospheric_pressure)
        if not self.start:
            return nominal
        given = dict(self.start)
        return replace(nominal, **{n: float(given[n]) for n in cls.parameter_names() if n in given})

    def _declared(self) -> dict[str, FitParameter]:
        """Return every parameter that may be fitted, by name."""
        return {p.name: p for p in all_volumes()[self.model].parameters}

    def _starting_values(self) -> dict[str, float]:
        nominal = self._nominal()
        return {name: float(getattr(nominal, name)) for name in nominal.parameter_names()}

    def _chosen(self) -> tuple[str, ...]:
        """Return the names of the parameters to fit."""
        declared = self._declared()
        if isinstance(self.free, str):
            if self.free == "all":
                return tuple(n for n in declared if n not in self._silent)
            if self.free != "auto":
                raise UnknownOptionError(
                    f"free is {self.free!r}.",
                    "'auto', 'all' or a list of names",
                    f"{self.model} has {', '.join(declared)}.",
                )
            return tuple(n for n, p in declared.items() if p.free and n not in self._silent)
        names = tuple(self.free)
        self._refuse_unknown(names, "free", declared)
        return names

    def _refuse_unknown(self, names: Iterable[str], where: str, declared: dict[str, FitParameter]) -> None:
        unknown = [n for n in names if n not in declared]
        if unknown:
            raise UnknownOptionError(
                f"{where} names {', '.join(map(str, unknown))}, which {self.model} does not have.",
                f"names among {', '.join(declared)}",
                "Correct the names.",
            )

    def _bounds_of(self, name: str, declared: dict[str, FitParameter]) -> tuple[float, float]:
        low, high = (self.bounds or {}).get(name, (declared[name].lower, declared[name].upper))
        if not low < high:
            raise ParameterError(
                f"The bounds of {name} are {low:.6g} to {high:.6g} {declared[name].unit}.",
                "a lower bound below the upper one",
                "Correct them; to hold a parameter, leave it out of free.",
            )
        return float(low), float(high)

    def parameter_bounds(self) -> dict[str, tuple[float, float]]:
        """Bounds of every parameter that may be fitted, SI units."""
        declared = self._declared()
        return {name: self._bounds_of(name, declared) for name in declared}

    def _warn_of_size(self) -> None:
        """Warn of a fitted diameter that is not that of the muscle."""
        fitted, stated = self.parameters_.get("rest_diameter", self.rest_diameter), float(self.rest_diameter)
        if not stated / IMPLAUSIBLE <= fitted <= stated * IMPLAUSIBLE:
            warnings.warn(
                f"The fitted rest_diameter is {1e3 * fitted:.3g} mm, and the muscle's is stated as "
                f"{1e3 * stated:.3g} mm. Expected the two within a factor of {IMPLAUSIBLE:g}. Check the units of force "
                "and pressure, state the muscle's diameter as rest_diameter, or hold it by leaving it out of free.",
                VolumeWarning,
                stacklevel=4,
            )

    def _predict_with(self, nominal: ClassicalVolume, values: Mapping[str, Any], state: State) -> np.ndarray:
        """Predict with given values of all parameters, real or complex."""
        fields = {n: values[n] for n in nominal.parameter_names()}
        return self.laws()[0].predict(*replace(nominal, **fields).jet(state), state)

    def fit(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> Self:
        """Identify the free parameters.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            Those of ``eps`` (dimensionless), ``deps`` (1/s), ``P`` (Pa, absolute) and ``dP`` (Pa/s) that it reads.
        y : array_like, shape (n_samples,)
            Tension, N, or mass flow into the muscle, kg/s.
        groups : array_like, shape (n_samples,), optional
            Run of each row. It does not change the fit, only its standard errors: residuals of one
            run are then taken as dependent.
        """
        state, y_, weight, clusters = self._training(X, y, sample_weight, groups)
        nominal = self._nominal()
        declared = self._declared()
        self._refuse_unknown(self.start or {}, "start", declared)
        self._refuse_unknown(self.bounds or {}, "bounds", declared)
        values: dict[str, Any] = dict(self._starting_values())
        names = self._chosen()
        warn_of_still_signals(state, self._moving, type(self).__name__)

        def predict(x: np.ndarray) -> np.ndarray:
            return self._predict_with(nominal, values | dict(zip(names, x, strict=True)), state)

        limits = [self._bounds_of(n, declared) for n in names]
        at_bound: list[str] = []
        errors = dict.fromkeys(values, 0.0)
        self.covariance_ = np.zeros((len(names), len(names)))
        self.n_iter_ = 1
        if names:
            lower, upper = (np.array(b, dtype=float) for b in zip(*limits, strict=True))
            begin = np.array([values[n] for n in names], dtype=float)
            search = _GeometrySearch(predict, y_, weight, names, begin, lower, upper)
            solution = search.best({"clusters": clusters, "max_iter": self.max_iter})
            values |= dict(zip(names, solution.x.tolist(), strict=True))
            errors |= dict(zip(names, np.sqrt(np.maximum(np.diag(solution.covariance), 0.0)).tolist(), strict=True))
            at_bound = [n for n, b in zip(names, solution.at_bound, strict=True) if b]
            self.covariance_ = solution.covariance
            self.n_iter_ = solution.n_iter
        self.parameters_ = values
        self.standard_errors_ = errors
        self.units_ = {n: p.unit for n, p in declared.items()}
        self.fitted_names_ = list(names)
        self.at_bound_ = at_bound
        self._warn_of_size()
        self._remember(X, y, sample_weight, groups)
        return self

    def _jet(self, state: State) -> VolumeJet:
        return _changed(self._nominal(), tuple(self.parameters_.items())).jet(state)


class _GeometrySearch(NamedTuple):
    """A bounded least-squares problem of named parameters, and the user's start."""

    predict: Callable[[np.ndarray], np.ndarray]
    y: np.ndarray
    weight: np.ndarray
    names: tuple[str, ...]
    begin: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    def best(self, how: dict[str, Any]) -> Solution:
        """Fit from the user's start and from the best bare geometry; keep the better fit."""
        found = [self.fit(self.begin, **how)]
        geometry = np.array([n in ("rest_diameter", "braid_angle") for n in self.names])
        if geometry.all() and not found[0].at_bound.any():
            return found[0]
        scan = self.scan()
        if geometry.any() and not geometry.all():
            scan = self.fit(scan, held=~geometry, max_iter=how["max_iter"]).x
        found.append(self.fit(scan, **how))
        return min(found, key=lambda s: s.cost)

    def fit(self, start: np.ndarray, **how: Any) -> Solution:
        """Fit from a start."""
        return fit_nonlinear(self.predict, self.y, self.weight, start, self.lower, self.upper, **how)

    def scan(self) -> np.ndarray:
        """Return the best of some braid angles, each with the diameter that suits it (force and flow go as D₀²)."""
        best, least = self.begin, np.inf
        angle, diameter = (self.names.index(n) if n in self.names else None for n in ("braid_angle", "rest_diameter"))
        for theta in (0.2, 0.35, 0.5, 0.65, 0.8, 0.9) if angle is not None else (0.0,):
            x = self.begin.copy()
            if angle is not None:
                x[angle] = np.clip(theta, self.lower[angle], self.upper[angle])
            if diameter is not None:
                f = self.predict(x)
                norm = float(np.sum(self.weight * f * f))
                scale = float(np.sum(self.weight * f * self.y)) / norm if norm > 0 else 1.0
                wanted = x[diameter] * np.sqrt(max(scale, 1e-6))
                x[diameter] = np.clip(wanted, self.lower[diameter], self.upper[diameter])
            cost = float(np.sum(self.weight * (self.predict(x) - self.y) ** 2))
            if cost < least:
                best, least = x, cost
        return best
