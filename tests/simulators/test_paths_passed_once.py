"""A path that is passed once tells little of what follows a position: a fall is braked by its speed."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pamid.gap import diagnose_simulator
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, Port

FALL = EquationSimulator(
    {"dh/dt": "v", "dv/dt": "-g"}, [Port("h", "state", "m"), Port("v", "state", "m/s")], {"g": (9.81, 0.0, "m/s^2")}
)


def drops(drag: float = 0.5) -> pd.DataFrame:
    """Three balls that fall from 50 m, read at 15 Hz with 0.1 m of noise, drag in 1/s."""
    rng, t, runs = np.random.default_rng(4), np.arange(48) / 15.0, []
    for k in range(3):
        fallen = 9.81 / drag * (t - (1 - np.exp(-drag * t)) / drag)
        h = 50.0 - fallen + 0.1 * rng.standard_normal(len(t))
        runs.append(pd.DataFrame({"trajectory": f"drop {k}", "time": t, "h": h}))
    return pd.concat(runs, ignore_index=True)


def test_a_spring_is_not_expected_where_nothing_turns_back():
    swing = drops().assign(h=lambda d: np.sin(3.0 * d["time"]))
    falls, swings = evidence_of(drops(), FALL), evidence_of(swing, FALL)
    names = ("nonlinear_stiffness@h", "maxwell@h", "viscous_friction@h", "sensor_gain@h")
    assert [falls.prior(name) < swings.prior(name) for name in names] == [True, True, False, False]


def test_drag_of_a_fall_is_named_beside_a_spring():
    library = ["viscous_friction", "quadratic_drag", "nonlinear_stiffness", "maxwell", "sensor_gain"]
    found = diagnose_simulator(drops(), FALL, library)
    assert (found.verdict, [c.effects for c in found.causes]) == ("cause", [("viscous_friction",)])
    assert abs(found.causes[0].parameters["coefficient"].value - 0.5) < 0.025


def test_no_lever_turns_along_a_travel():
    placed = evidence_of(drops(), FALL).placements
    assert "viscous_friction@h" in placed and "gravity@h" not in placed


def test_effects_of_a_path_act_where_runs_are_predicted_and_no_position_is_a_state():
    ports = [Port("u", "input", "N"), Port("v", "state", "m/s"), Port("a", "output", "m/s^2")]
    cart = EquationSimulator({"dv/dt": "(u - v) / m", "a": "(u - v) / m"}, ports, {"m": (2.0, 0.0, "kg")})
    t, v, rows = np.arange(0.0, 8.0, 0.02), 0.0, []
    u = 3.0 * np.sin(1.3 * t) + np.sin(4.1 * t)
    for force in u:
        rows.append((force - v) / 2.0)
        v = force + (v - force) * np.exp(-0.01)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(len(t))
    evidence = evidence_of(pd.DataFrame({"trajectory": "0", "time": t, "u": u, "a": rows + noise}), cart)
    assert evidence.touched(["hysteresis@v"]) == evidence.touched(["viscous_friction@v"]) == ["a"]
