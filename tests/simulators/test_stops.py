"""A joint that runs into its stops: named with stiffness and place, at the end of the travel where it is."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, Port

CART = EquationSimulator(
    {"dx/dt": "v", "dv/dt": "(u - b * v) / m"},
    [Port("u", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")],
    {"m": (1.0, 0.0, "kg"), "b": (0.5, 0.0, "N s/m")},
)
LIBRARY = ["upper_stop", "lower_stop", "nonlinear_stiffness", "coulomb_friction", "viscous_friction", "actuator_gain"]


def log(centre: float = 0.0, stop: float = np.inf) -> pd.DataFrame:
    """Return three runs about a place, with a stop of 4 kN/m and 60 N s/m that far below it."""
    rng, t, dt, runs = np.random.default_rng(0), np.arange(0.0, 8.0, 0.005), 0.00025, []
    for k in range(3):
        x, v, rows = centre, 0.0, []
        for now in t:
            u = 2.2 * np.sin((2.0 + 0.5 * k) * now) + 1.3 * np.sin(4.3 * now + k) - 6.0 * (x - centre)
            rows.append((u, x, v))
            for _ in range(20):
                pen = centre - stop - x
                v += dt * (u - 0.5 * v + (4000.0 * pen - 60.0 * v if pen > 0.0 else 0.0))
                x += dt * v
        u, x, v = np.array(rows).T
        x, v = x + 2e-4 * rng.standard_normal(len(t)), v + 5e-3 * rng.standard_normal(len(t))
        runs.append(pd.DataFrame({"trajectory": str(k), "time": t, "u": u, "x": x, "v": v}))
    return pd.concat(runs, ignore_index=True)


def test_a_stop_is_named_with_its_place_and_size() -> None:
    found = diagnose_simulator(log(0.4, 0.15), CART, LIBRARY)
    assert [c.effects[0] for c in found.causes] == ["lower_stop"]
    size = found.causes[0].parameters
    assert size["stiffness"].value == pytest.approx(4000.0, rel=0.1) and size["stiffness"].unit == "N/m"
    assert size["damping"].value == pytest.approx(60.0, rel=0.3) and size["damping"].unit == "N s/m"
    [(_, where, values)] = found.corrected.effects
    assert where == "x" and values["limit"] == pytest.approx(0.25, abs=2e-3)


def test_a_travel_without_stops_has_none() -> None:
    assert diagnose_simulator(log(), CART, LIBRARY).verdict == "none"


def test_the_offset_of_a_sensor_is_not_told_as_a_force() -> None:
    held = EquationSimulator(CART.equations | {"dv/dt": "(u - b * v - k * x) / m"}, CART.ports,
                             {"m": (1.0, 0.0, "kg"), "b": (0.5, 0.0, "N s/m"), "k": (6.0, 0.0, "N/m")})  # fmt: skip
    free = log()
    off = free.assign(u=free["u"] + 6.0 * free["x"], x=free["x"] + 0.02)
    [cause] = diagnose_simulator(off, held, ["sensor_bias", "viscous_friction"]).causes
    offset = cause.parameters["offset"]
    assert (cause.effects, offset.physical) == (("sensor_bias",), "") and offset.value == pytest.approx(0.02, rel=0.1)


def test_a_stop_is_sought_in_the_half_of_the_travel_that_it_ends() -> None:
    places = evidence_of(log(0.4), CART).placements
    tops = {n: places[f"{n}@x"].effect.parameters[2] for n in ("upper_stop", "lower_stop")}
    assert tops["lower_stop"].upper == pytest.approx(tops["upper_stop"].lower)
    assert tops["lower_stop"].lower < tops["upper_stop"].upper
