"""Force of a muscle as a measured static surface within Hill's structure, damping beside it."""

from dataclasses import KW_ONLY
from typing import Any, ClassVar

import numpy as np

from pamid.signals.state import State
from pamid.volume import FitParameter

from ._empirical import EmpiricalForce, Values
from ._parameters import parameters


@parameters
class HosovskyHybrid(EmpiricalForce):
    r"""Tension of a muscle: an empirical static surface, and a damper beside it whose strength depends on pressure.

    .. math:: F = (a_1 p + a_2)\, e^{a_3 \varepsilon} + a_4\, p\, \varepsilon + a_5\, p + a_6
        - (b_0 + b_1 p)\, L_0\, \dot\varepsilon

    with the gauge pressure p. The structure is Hill's, of a contractile element and a damper in parallel; the
    contractile element is a surface fitted to data: hybrid between a mechanical model and a map. Signals: ``eps``,
    ``deps`` and ``P``.

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

    _: KW_ONLY
    rest_length: float = 0.2
    max_iter: int = 200

    _nonlinear = ("a3",)
    reads = ("eps", "deps", "P")
    # with one column for all three signals only the other terms are distinguishable
    _apart: ClassVar = dict.fromkeys(("a1", "a4", "a5", "b1", "b0"), 0.0)
    _checked = ({"fixed": _apart, "atmospheric_pressure": 0.0, "max_iter": 20},)
    _parameters = (
        FitParameter("a1", "N/Pa", -np.inf, np.inf, True, "rise of the exponential with pressure"),
        FitParameter("a2", "N", -np.inf, np.inf, True, "exponential without pressure"),
        FitParameter("a3", "-", -200.0, -0.05, True, "decay with contraction"),
        FitParameter("a4", "N/Pa", -np.inf, np.inf, True, "pressure times contraction"),
        FitParameter("a5", "N/Pa", -np.inf, np.inf, True, "pressure"),
        FitParameter("a6", "N", -np.inf, np.inf, True, "constant"),
        FitParameter("b0", "N s/m", -np.inf, np.inf, True, "damping without pressure"),
        FitParameter("b1", "N s/(m Pa)", -np.inf, np.inf, True, "its rise with pressure"),
    )

    def _grid(self) -> list[dict[str, float]]:
        return [{"a3": -float(a)} for a in np.geomspace(0.3, 100.0, 12)]

    def _force(self, values: Values, state: State) -> Any:
        p = self._gauge(state)
        decay = np.exp(np.clip(np.real(values["a3"] * state.eps), -50.0, 50.0))
        decay = decay * (1.0 + 1j * np.imag(values["a3"]) * state.eps) if np.iscomplexobj(values["a3"]) else decay
        static = (values["a1"] * p + values["a2"]) * decay + values["a4"] * p * state.eps + values["a5"] * p
        damping = (values["b0"] + values["b1"] * p) * self.rest_length * state.deps
        return static + values["a6"] - damping
