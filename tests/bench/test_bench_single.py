"""The single muscle that lifts a load."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.bench.sensors import Sensor
from pamid.bench.single import SENSORS, LiftSettings, festo_like, simulate_lift
from pamid.constants import GRAVITY
from pamid.errors import ParameterError

IDEAL = {channel: Sensor() for channel in SENSORS}
QUICK = LiftSettings(frequency=0.5)


@pytest.fixture(scope="module")
def lift():
    return simulate_lift(loads=(15.0, 60.0, 100.0), settings=QUICK, sensors=IDEAL, every=2)


def test_columns_and_rows(lift):
    assert list(lift.columns) == ["trajectory", "time", "P_ref", "P", "L", "eps", "F", "u", "load"]
    assert lift.groupby("trajectory").size().to_dict() == {"lift-15": 1000, "lift-60": 1000, "lift-100": 1000}


def test_pressure_follows_the_wanted_one_from_0_to_7_bar(lift):
    assert lift["P_ref"].min() == pytest.approx(101_325) and lift["P_ref"].max() == pytest.approx(801_325, rel=1e-4)
    light = lift[lift["load"] == 15]
    assert np.sqrt(np.mean((light["P"] - light["P_ref"]) ** 2)) < 0.05 * np.ptp(light["P_ref"])


def test_heavier_loads_are_lifted_later_and_less(lift):
    reached = lift.groupby("load")["eps"].max()
    assert reached.is_monotonic_decreasing and 0.2 < reached.iloc[0] < 0.27 and reached.iloc[-1] > 0.02
    start = lift[lift["eps"] > 0.005].groupby("load")["P"].first()
    assert start.is_monotonic_increasing


def test_a_hanging_load_weighs_what_it_weighs():
    slow = simulate_lift(loads=(30.0,), settings=LiftSettings(frequency=0.1), sensors=IDEAL)
    top = slow[(slow["time"] > 4.5) & (slow["time"] < 5.5)]
    assert top["F"].mean() == pytest.approx(30.0 * GRAVITY, rel=2e-3)
    up, down = slow[slow["time"] < 5], slow[slow["time"] >= 5]
    P = np.linspace(4.5e5, 7e5, 20)
    loop = np.interp(P, down["P"][::-1], down["eps"][::-1]) - np.interp(P, up["P"], up["eps"])
    assert loop.min() > 1e-3  # hysteresis: more contraction on the way down


def test_a_seed_gives_one_log():
    a, b, c = (simulate_lift(loads=(30.0,), periods=0.1, settings=QUICK, seed=s) for s in (1, 1, 2))
    pd.testing.assert_frame_equal(a, b)
    assert not np.array_equal(a["P"], c["P"])


@pytest.mark.parametrize(
    "bad",
    [
        {"loads": []},
        {"loads": [0.0]},
        {"loads": [30.0, 30.0]},
        {"every": 0},
        {"periods": 0},
        {"effects": ["angle_gain"]},
    ],
)
def test_errors(bad):
    with pytest.raises(ParameterError):
        simulate_lift(**{"loads": [30.0], "periods": 0.01, **bad})


def test_festo_like_is_about_as_strong_as_the_market():
    params = festo_like()
    plant = params.plant()
    force = 6e5 * plant.volume_slope(0.0) / plant.rest_length
    assert 1300 < force < 1700
