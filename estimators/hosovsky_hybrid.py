"""Force of a muscle as a measured static surface within Hill's structure, damping beside it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pamid.constants import ATMOSPHERIC_PRESSURE
from pamid.signals.state import State
from pamid.volume import FitParameter

from ._base import Signals
from ._empirical import EmpiricalForce, Values, check_positive


class HosovskyHybrid(EmpiricalForce):
    r"""Tension of a muscle: an empirical static surface, and a damper beside it whose strength depends on pressure.

    .. math:: F = (a_1 p + a_2)\, e^{a_3 \varepsilon} + a_4\, p\, \varepsilon + a_5\, p + a_6
        - (b_0 + b_1 p)\, L_0\, \dot\varepsilon

    with the gauge pressure p. The structure is Hill's, of a contractile element and a damper in parallel; the
    contractile element is a surface fitted to data: hybrid between a mechanical model and a map. Signals: ``eps``,
    ``deps`` and ``P``.

    Parameters
    ----------
    rest_length : float, default=0.2
        L₀, m.
    fixed : mapping of str to float, optional
        Parameters that are held, and their values, SI units.
    atmospheric_pressure : float, default=101325
        Pa, absolute.
    max_iter : int, default=200
        Maximum number of evaluations of the model.
    signals : mapping of str to (str or int), optional
        Which column holds which signal.

    Attributes
    ----------
    parameters_ : dict of str to float
        Every parameter, fitted or held, SI units.
    standard_errors_ : dict of str to float
        Their standard errors: 0 for a held parameter, infinite for one that the data do not determine or that lies
        on a bound. With `groups`, cluster-robust.
    intervals_ : dict of str to tuple of two floats
        Their 95 % intervals.
    units_ : dict of str to str
        Their units.
    fitted_names_ : list of str
        The parameters that were fitted, in the order of `covariance_`.
    covariance_ : ndarray, shape (n_fitted, n_fitted)
        Covariance of the fitted parameters.
    at_bound_ : list of str
        Fitted parameters that lie on a bound.
    n_iter_ : int
        Evaluations used.
    signal_columns_ : dict of str to int
        Column of each signal.
    n_features_in_ : int
        Columns of X.
    feature_names_in_ : ndarray of str
        Their names, if X had names.

    See Also
    --------
    ThreeElement : Spring, damper and contractile element, each a function of the pressure.
    ResidualHybrid : A geometry and a network for what it leaves.

    Notes
    -----
    The surface is Sárosi's of six parameters, which Hošovský and co-workers use for Festo muscles; the two are combined
    here as later papers quote them; the originals were not available.

    References
    ----------
    A. Hošovský, J. Piteľ, K. Židek, M. Tóthová, J. Sárosi, L. Cveticanin, "Dynamic characterization and simulation of
    two-link soft robot arm with pneumatic muscles", Mechanism and Machine Theory 103, 2016.
    https://doi.org/10.1016/j.mechmachtheory.2016.04.013

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.estimators import HosovskyHybrid
    >>> rng = np.random.default_rng(0)
    >>> eps, deps, P = rng.uniform(0, 0.2, 200), rng.normal(0, 0.2, 200), rng.uniform(2e5, 6e5, 200)
    >>> p = P - 101325
    >>> F = (2e-3 * p + 30) * np.exp(-9 * eps) - 1e-3 * p * eps + 3e-4 * p - 20 - (50 + 1e-4 * p) * 0.2 * deps
    >>> fit = HosovskyHybrid(rest_length=0.2).fit(np.c_[eps, deps, P], F)
    >>> round(fit.parameters_["a3"], 4), round(fit.parameters_["b0"], 2), fit.units_["b0"]
    (-9.0, 50.0, 'N s/m')
    """

    _nonlinear = ("a3",)
    reads = ("eps", "deps", "P")

    def __init__(
        self,
        *,
        rest_length: float = 0.2,
        fixed: Mapping[str, float] | None = None,
        atmospheric_pressure: float = ATMOSPHERIC_PRESSURE,
        max_iter: int = 200,
        signals: Signals | None = None,
    ) -> None:
        self.rest_length = rest_length
        self.fixed = fixed
        self.atmospheric_pressure = atmospheric_pressure
        self.max_iter = max_iter
        self.signals = signals

    def _declared(self) -> dict[str, FitParameter]:
        check_positive(self, "rest_length")
        inf = np.inf
        found = (
            FitParameter("a1", "N/Pa", -inf, inf, True, "rise of the exponential with pressure"),
            FitParameter("a2", "N", -inf, inf, True, "exponential without pressure"),
            FitParameter("a3", "-", -200.0, -0.05, True, "decay with contraction"),
            FitParameter("a4", "N/Pa", -inf, inf, True, "pressure times contraction"),
            FitParameter("a5", "N/Pa", -inf, inf, True, "pressure"),
            FitParameter("a6", "N", -inf, inf, True, "constant"),
            FitParameter("b0", "N s/m", -inf, inf, True, "damping without pressure"),
            FitParameter("b1", "N s/(m Pa)", -inf, inf, True, "its rise with pressure"),
        )
        return {p.name: p for p in found}

    def _grid(self) -> list[dict[str, float]]:
        return [{"a3": -float(a)} for a in np.geomspace(0.3, 100.0, 12)]

    def _force(self, values: Values, state: State) -> Any:
        p = self._gauge(state)
        decay = np.exp(np.clip(np.real(values["a3"] * state.eps), -50.0, 50.0))
        decay = decay * (1.0 + 1j * np.imag(values["a3"]) * state.eps) if np.iscomplexobj(values["a3"]) else decay
        static = (values["a1"] * p + values["a2"]) * decay + values["a4"] * p * state.eps + values["a5"] * p
        damping = (values["b0"] + values["b1"] * p) * self.rest_length * state.deps
        return static + values["a6"] - damping

    @staticmethod
    def _checked_instances() -> list[HosovskyHybrid]:
        # with one column for all three signals only these terms are distinguishable
        apart = dict.fromkeys(("a1", "a4", "a5", "b1", "b0"), 0.0)
        one = {"eps": 0, "deps": 0, "P": 0}
        return [HosovskyHybrid(signals=one, fixed=apart, atmospheric_pressure=0.0, max_iter=20)]
