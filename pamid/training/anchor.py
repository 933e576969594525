"""Fit the geometric anchor of a hybrid model: few parameters, physical bounds, a weak prior where data are silent."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from ..constants import ATMOSPHERIC_PRESSURE
from ..laws.base import Law
from ..signals.state import State
from ..volume.contact import ContactVolume

Share = tuple[Law, State, np.ndarray, np.ndarray]
"""One law with the state, the measured values and the sample weights that it is to explain."""

FIRST_STRENGTH = 0.02
"""Weight of the prior in the first pass: a parameter one prior width away costs like a misfit of 2 % of the spread."""

STRENGTH, STRENGTH_OF_FLOW = 1.5, 0.15
"""Weight of the prior in the second pass, relative to what the first one could not explain.

What a geometry leaves of a force is friction and hysteresis, which hold on for whole runs, so that many samples tell
little more than one; what it leaves of a flow is the noise of rates, which every further sample averages out.
"""

ROWS = 5000
"""Samples that the few parameters are fitted on; more would not tell more."""

BAR = 1e5
COMPLIANCE = 1e-8
"""Unit of the threads' compliance in the fit, 1/Pa."""

_SHARED = {
    "log_area": (0.0, 1.0, -4.0, 4.0),
    "log_rest_volume": (0.0, 0.5, -3.0, 3.0),
    "log_width_bar": (np.log(0.15), 0.7, np.log(0.02), np.log(2.0)),
    "compliance": (0.0, 5.0, 0.0, 100.0),
}

FAMILIES = {
    "braided": {
        **_SHARED,
        "max_contraction": (0.33, 0.06, 0.05, 0.8),
        "curvature": (-0.2, 0.15, -0.95, 8.0),
        "contact_bar": (0.3, 0.5, 0.0, 20.0),
        "log_contact_contraction": (np.log(0.05), 0.7, np.log(0.003), np.log(0.5)),
    },
    "fabric": {
        **_SHARED,
        "max_contraction": (0.18, 0.03, 0.05, 0.8),
        "curvature": (1.5, 0.4, -0.95, 8.0),
        "contact_bar": (4.0, 3.0, 0.0, 20.0),
        "log_contact_contraction": (np.log(0.055), 0.4, np.log(0.003), np.log(0.5)),
    },
}
"""Priors of the two ways to build a muscle, (centre, width, lower, upper) for each parameter of the fit.

A McKibben muscle has a thin bladder inside a braid: the centres are those of braids of 20° to 35°. A fluidic muscle has
its fabric vulcanised into a thick tube: the centres are typical of muscles of 10 mm bore. The family that explains
the data at less cost is taken, so the choice is the data's.
"""

_CONTACT = ("contact_bar", "log_contact_contraction", "log_width_bar")

FIRM = 100.0
"""Width of the contact where no force tells of it, Pa: narrow, so that the geometry alone fills the muscle with gas."""


def fit_anchor(
    shares: Sequence[Share],
    *,
    rest_length: float,
    rest_diameter: float,
    atmospheric_pressure: float = ATMOSPHERIC_PRESSURE,
    random_state: np.random.RandomState,
) -> ContactVolume:
    """Fit a `ContactVolume` to one or several laws by bounded least squares."""
    families = [
        _fit_family(prior, shares, rest_length, rest_diameter, atmospheric_pressure, random_state)
        for prior in FAMILIES.values()
    ]
    return min(families, key=lambda outcome: outcome[0])[1]


def _fit_family(
    prior: dict[str, tuple[float, float, float, float]],
    shares: Sequence[Share],
    rest_length: float,
    rest_diameter: float,
    atmospheric_pressure: float,
    random_state: np.random.RandomState,
) -> tuple[float, ContactVolume]:
    """Return the penalised misfit and the volume of one family."""
    has_force = any(law.equation == "force" for law, *_ in shares)
    free = [name for name in prior if has_force or name not in _CONTACT]
    centre, width, lower, upper = (np.array([prior[name][k] for name in free]) for k in range(4))
    cylinder = np.pi * rest_diameter**2 / 4.0
    # A braid at 25° pulls with about eight times the pressure on its cross-section.
    typical_area, typical_volume = 8.0 * cylinder, cylinder * rest_length

    def model(q: np.ndarray) -> ContactVolume:
        v = dict(zip(free, q, strict=True))
        return ContactVolume(
            rest_length=rest_length,
            area=float(typical_area * np.exp(v["log_area"])),
            max_contraction=float(v["max_contraction"]),
            curvature=float(v["curvature"]),
            contact_pressure=float(v.get("contact_bar", 0.0) * BAR),
            contact_contraction=float(np.exp(v.get("log_contact_contraction", prior["log_contact_contraction"][0]))),
            contact_width=float(np.exp(v["log_width_bar"]) * BAR) if has_force else FIRM,
            rest_volume=float(typical_volume * np.exp(v["log_rest_volume"])),
            thread_compliance=float(v["compliance"] * COMPLIANCE),
            atmospheric_pressure=atmospheric_pressure,
        )

    thinned = [_thin(*share, random_state) for share in shares]

    def misfit(q: np.ndarray) -> np.ndarray:
        volume = model(q)
        out = np.concatenate([root * (_predict(law, volume, state) - y) for law, state, y, root in thinned])
        return np.where(np.isfinite(out), out, 1e6)

    def pull(q: np.ndarray) -> np.ndarray:
        return np.asarray((q - centre) / width / np.sqrt(len(q)))

    q, strength = centre, FIRST_STRENGTH
    for _ in range(2):
        # One misfit's worth of prior: weak where the data are rich and exact, decisive where they leave a gap.
        fit = least_squares(
            lambda v, s=strength: np.concatenate([s * pull(v), misfit(v)]),
            q,
            bounds=(lower, upper),
            x_scale=width,
            xtol=1e-9,
            ftol=1e-11,
            gtol=1e-9,
            max_nfev=100,
        )
        left = float(np.sqrt(np.sum(misfit(fit.x) ** 2) / len(shares)))
        q, strength = np.clip(fit.x, lower, upper), (STRENGTH if has_force else STRENGTH_OF_FLOW) * left
    return float(fit.cost), model(q)


def _predict(law: Law, volume: ContactVolume, state: State) -> np.ndarray:
    """Apply a law; one that reads the slope alone is spared the quadrature over ε."""
    if law.equation == "force":
        return np.asarray(
            law.coefficients(state).V_eps * volume.slope(state.eps, state.P - volume.atmospheric_pressure)
        )
    return np.asarray(law.predict(*volume.jet(state), state))


def _thin(
    law: Law, state: State, y: np.ndarray, weight: np.ndarray, random_state: np.random.RandomState
) -> tuple[Law, State, np.ndarray, np.ndarray]:
    """Draw at most `ROWS` samples and turn weights into factors of residuals in units of the target's spread."""
    counted = np.flatnonzero((weight > 0) & np.isfinite(y))
    if len(counted) > ROWS:
        counted = np.sort(random_state.choice(counted, ROWS, replace=False))
    y, weight = y[counted], weight[counted]
    spread = np.sqrt(np.average((y - np.average(y, weights=weight)) ** 2, weights=weight)) or 1.0
    return law, State(*(s[counted] for s in state)), y, np.sqrt(weight / weight.sum()) / spread
