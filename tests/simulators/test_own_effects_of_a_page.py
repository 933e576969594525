"""A page's own effects act as it says, on whatever log, or are refused with the ports that there are."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.errors import ImplausibleParameterError, UnknownOptionError
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port


def cart(*effects: tuple[str, str, dict[str, float]]) -> FunctionSimulator:
    ports = [Port("u", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]
    made = FunctionSimulator(lambda t, x, u, p: [x.v, u.u / 2.0], ports, {})
    return made.with_({}, list(effects))


def log(size: float) -> pd.DataFrame:
    """Return a cart that is pushed as by a drive with a dead zone of 0.3 N."""
    t = np.arange(0.0, 8.0, 0.01)
    u = size * (np.sin(1.3 * t) + 0.5 * np.sin(3.1 * t))
    force = np.sign(u) * np.maximum(np.abs(u) - 0.3, 0.0)
    v = np.concatenate([[0.0], np.cumsum(0.005 * force[:-1])])
    x = np.concatenate([[0.0], np.cumsum(0.005 * (v[1:] + v[:-1]))])
    return pd.DataFrame({"trajectory": "0", "time": t, "u": u, "x": x, "v": v})


@pytest.mark.parametrize("size", [2.0, 0.6, 0.3])
def test_a_width_is_what_the_page_says_on_small_logs_too(size: float) -> None:
    evidence = evidence_of(log(size), cart(("actuator_dead_zone", "u", {"width": 0.3})))
    [(place, made)] = evidence.active({})
    assert place.outward(made.values)["width"] == pytest.approx(0.3)
    drive = place.drive(made, np.array([0.2, -0.25, 0.5, -0.7]), 0.01, np.array([0]))
    assert drive == pytest.approx([0.0, 0.0, 0.2, -0.4])


def test_a_wrong_sign_is_refused() -> None:
    with pytest.raises(ImplausibleParameterError, match=r"actuator_dead_zone at u is -0\.3 N"):
        evidence_of(log(2.0), cart(("actuator_dead_zone", "u", {"width": -0.3})))


def test_an_unknown_port_is_refused_with_those_that_the_effect_can_have() -> None:
    with pytest.raises(UnknownOptionError, match="'w', which is no port") as error:
        evidence_of(log(2.0), cart(("viscous_friction", "w", {"coefficient": 1.0})))
    assert "one of x" in str(error.value)
