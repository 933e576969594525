"""The three-element model: contractile element, spring and damper in parallel, each a function of the pressure."""

from collections.abc import Mapping
from dataclasses import KW_ONLY
from typing import Any, ClassVar, NamedTuple

import numpy as np
from sklearn.utils.validation import check_is_fitted

from pamid.constants import GRAVITY
from pamid.errors import ParameterError, ShapeError, TimeOrderError
from pamid.signals.state import State
from pamid.volume import FitParameter

from ._checks import check_counts
from ._empirical import EmpiricalForce, Values
from ._parameters import parameters

_PHASES = ("fill", "vent")
_MARGIN = 0.1  # of the range of contraction of the fit, by which a free run may leave it


class LiftRun(NamedTuple):
    """A free run of a muscle that lifts a load.

    Parameters
    ----------
    eps : ndarray, shape (n_samples,)
        Contraction ratio.
    deps : ndarray, shape (n_samples,)
        Its rate, 1/s.
    F : ndarray, shape (n_samples,)
        Tension, N.
    held : ndarray of bool, shape (n_samples,)
        Samples at which the run would have left the contractions of the fit and was held at their edge.
    extrapolated : ndarray of bool, shape (n_samples,)
        Samples whose pressure lies outside that of the fit; the fit's end value of each element holds there.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.estimators import ThreeElement
    >>> rng = np.random.default_rng(0)
    >>> eps, deps = rng.uniform(0, 0.2, 400), rng.normal(0, 0.2, 400)
    >>> P, dP = rng.uniform(1.1e5, 7e5, 400), rng.choice([-1e6, 1e6], 400)
    >>> F = 2e-3 * (P - 101325) - 1e3 * eps - 20.0 * deps
    >>> run = ThreeElement().fit(np.c_[eps, deps, P, dP], F).simulate([0.0, 0.1, 0.2], [3e5, 3e5, 9e5], load=30.0)
    >>> run.eps.shape, run.extrapolated.tolist()
    ((3,), [False, False, True])
    """

    eps: np.ndarray
    deps: np.ndarray
    F: np.ndarray
    held: np.ndarray
    extrapolated: np.ndarray


@parameters
class ThreeElement(EmpiricalForce):
    r"""Three-element model of a muscle: tension of a contractile element less that of a spring and a damper.

    .. math:: F = F_c(p) - K(p)\,x - B(p)\,\dot x, \quad x = L_0\,\varepsilon, \qquad
        M \ddot x + B(p)\,\dot x + K(p)\,x = F_c(p) - M g

    F_c, K and B are piecewise linear in the gauge pressure p, with values at the knots as parameters, and K and B
    differ between filling and venting, with a smooth transition over the rate of the pressure. Signals: ``eps``,
    ``deps``, ``P`` and ``dP``.

    Parameters
    ----------
    pieces : int, default=2
        Pieces of the range of pressure between knots.
    turn_rate : float, default=20000
        Rate of the pressure over which filling passes into venting, Pa/s.

    Attributes
    ----------
    knots_ : ndarray, shape (pieces + 1,)
        Gauge pressures of the knots, Pa: the range of the fit in equal pieces.
    parameters_ : dict of str to float
        ``F0``, ``F1``, ... (N), ``K_fill0``, ``K_vent0``, ... (N/m), ``B_fill0``, ``B_vent0``, ...
        (N s/m) at the knots.
    eps_low_, eps_high_ : float
        Range of contraction of the fit.

    See Also
    --------
    HosovskyHybrid : A static surface in place of spring and contractile element.

    References
    ----------
    D. B. Reynolds, D. W. Repperger, C. A. Phillips, G. Bandry, "Modeling the dynamic characteristics of pneumatic
    muscle", Annals of Biomedical Engineering 31(3), 2003. https://doi.org/10.1114/1.1554921

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.estimators import ThreeElement
    >>> rng = np.random.default_rng(0)
    >>> eps, deps = rng.uniform(0, 0.2, 400), rng.normal(0, 0.2, 400)
    >>> P, dP = rng.uniform(1.1e5, 7e5, 400), rng.choice([-1e6, 1e6], 400)
    >>> F = 2e-3 * (P - 101325) - 5e3 * 0.2 * eps - np.where(dP > 0, 150.0, 80.0) * 0.2 * deps
    >>> fit = ThreeElement(rest_length=0.2).fit(np.c_[eps, deps, P, dP], F)
    >>> round(fit.parameters_["K_fill0"]), round(fit.parameters_["B_vent1"]), fit.units_["B_vent1"]
    (5000, 80, 'N s/m')
    >>> t = np.arange(0, 2, 0.01)
    >>> run = fit.simulate(t, np.full(len(t), 6e5), load=90.0)
    >>> round(float(run.eps[-1]), 3), bool(run.held.any())
    (0.115, False)
    """

    _: KW_ONLY
    rest_length: float = 0.2
    pieces: int = 2
    turn_rate: float = 2e4

    reads = ("eps", "deps", "P", "dP")
    _positive = ("rest_length", "turn_rate")
    # with one column for all four signals only the other terms are distinguishable
    _apart: ClassVar = dict.fromkeys(("K_vent0", "K_fill1", "K_vent1", "B_fill0", "B_vent0", "B_fill1", "B_vent1"), 0.0)
    _checked = ({"pieces": 1, "fixed": _apart, "atmospheric_pressure": 0.0},)

    def _declared(self) -> dict[str, FitParameter]:
        super()._declared()
        check_counts(self, "pieces")
        found = []
        for k in range(int(self.pieces) + 1):
            found.append(FitParameter(f"F{k}", "N", -np.inf, np.inf, True, "contractile element at a knot"))
            for phase in _PHASES:
                found.append(FitParameter(f"K_{phase}{k}", "N/m", 0.0, np.inf, True, "stiffness at a knot"))
                found.append(FitParameter(f"B_{phase}{k}", "N s/m", 0.0, np.inf, True, "damping at a knot"))
        return {p.name: p for p in found}

    def _prepare(self, state: State, weight: np.ndarray) -> None:
        check_counts(self, "pieces")
        p, eps = self._gauge(state)[weight > 0], state.eps[weight > 0]
        self.knots_ = np.linspace(float(p.min()), max(float(p.max()), float(p.min()) + 1.0), int(self.pieces) + 1)
        self.eps_low_, self.eps_high_ = float(eps.min()), float(eps.max())

    def _elements(self, values: Values, p: Any, dP: Any) -> tuple[Any, Any, Any]:
        """Return F_c (N), K (N/m) and B (N s/m); beyond the knots the value at the last one holds."""
        filling = 0.5 * (1.0 + np.tanh(dP / self.turn_rate))

        def element(name: str) -> Any:
            return np.interp(p, self.knots_, [values[f"{name}{k}"] for k in range(len(self.knots_))])

        K, B = (filling * element(f"{e}_fill") + (1.0 - filling) * element(f"{e}_vent") for e in "KB")
        return element("F"), K, B

    def _force(self, values: Values, state: State) -> Any:
        Fc, K, B = self._elements(values, self._gauge(state), state.dP)
        return Fc - K * self.rest_length * state.eps - B * self.rest_length * state.deps

    def lift_formulas(self, signals: Mapping[str, Any]) -> tuple[tuple[Any, Any, Any], dict[str, float]]:
        """Return the elements as formulas of the signals, which may be symbols, and the numbers of `simulate`.

        Parameters
        ----------
        signals : mapping of str to array or symbol
            ``P`` (Pa, absolute) and ``dP`` (Pa/s).

        Returns
        -------
        elements : tuple of array or symbol
            F_c (N), K (N/m) and B (N s/m).
        numbers : dict of str to float
            ``rest_length`` (m), ``top`` (contraction at which a lift is held), ``gravity`` (m/s²).
        """
        elements = self._elements(self.parameters_, signals["P"] - self.atmospheric_pressure, signals["dP"])
        return elements, {"rest_length": float(self.rest_length), "top": self._top(), "gravity": GRAVITY}

    def _top(self) -> float:
        """Return the contraction at which a lift is held."""
        return self.eps_high_ + _MARGIN * (self.eps_high_ - self.eps_low_)

    def simulate(self, time: Any, P: Any, load: float, *, start: float | None = None) -> LiftRun:
        """Integrate the lift of a load under a given pressure, from rest.

        The load rests on a stand at ε = 0 until the muscle lifts it. A run that leaves the contractions of the fit
        by more than a tenth of their range is held there and flagged, so that it stays bounded.

        Parameters
        ----------
        time : array_like, shape (n_samples,)
            Time, s, increasing.
        P : array_like, shape (n_samples,)
            Absolute pressure, Pa.
        load : float
            M, kg.
        start : float, optional
            Contraction at the first sample; by default that at which the load would rest.

        Returns
        -------
        LiftRun
            Contraction, its rate (1/s), tension (N), and flags.

        Raises
        ------
        TimeOrderError
            If the time does not increase.
        ShapeError
            If there is not one pressure per time.
        ParameterError
            If the load is not positive.
        """
        check_is_fitted(self, "parameters_")
        t, P = np.asarray(time, dtype=float).ravel(), np.asarray(P, dtype=float).ravel()
        if t.shape != P.shape or len(t) < 2 or not np.isfinite(P).all():
            raise ShapeError(
                f"There are {len(t)} times and {len(P)} pressures.", "as many finite pressures as times, 2 or more", ""
            )
        if not (np.isfinite(t).all() and (np.diff(t) > 0).all()):
            raise TimeOrderError("The time does not increase.", "increasing times", "Sort the samples.")
        if not (np.isfinite(load) and load > 0):
            raise ParameterError(f"load is {load!r}.", "a mass in kg, above 0", "Correct it.")
        p = P - self.atmospheric_pressure
        Fc, K, B = self._elements(self.parameters_, p, np.gradient(P, t))
        L0, weight = float(self.rest_length), float(load) * GRAVITY
        top = L0 * self._top()
        x = L0 * start if start is not None else (Fc[0] - weight) / K[0] if K[0] > 0 else 0.0
        x, v = min(max(x, 0.0), top), 0.0
        out = np.empty((3, len(t)))
        held = np.zeros(len(t), dtype=bool)
        for k in range(len(t)):
            tension = Fc[k] - K[k] * x - B[k] * v
            out[:, k] = x / L0, v / L0, tension
            if k + 1 == len(t):
                break
            step = t[k + 1] - t[k]
            n = max(1, int(np.ceil(step * np.sqrt(max(K[k], K[k + 1]) / load) / 0.2)), int(np.ceil(step / 1e-3)))
            h = step / n
            for i in range(n):
                s = (i + 0.5) / n
                f, stiff, damp = (e[k] + s * (e[k + 1] - e[k]) for e in (Fc, K, B))
                v = (v + h * (f - weight - stiff * x) / load) / (1.0 + h * damp / load)
                x += h * v
                if x < 0.0:
                    x, v = 0.0, max(v, 0.0)
                elif x > top:
                    x, v = top, min(v, 0.0)
                    held[k + 1] = True
        width = 1e-9 * float(np.ptp(self.knots_))
        return LiftRun(out[0], out[1], out[2], held, (p < self.knots_[0] - width) | (p > self.knots_[-1] + width))
