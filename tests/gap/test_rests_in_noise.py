"""A carriage that moves at constant speeds and rests between them, of which only a noisy position is logged."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pamid.gap import diagnose_simulator
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, Port

DT, STEPS, MASS, DAMPING = 0.02, 10, 12.0, 30.0
SIMULATOR = EquationSimulator(
    {"dx/dt": "v", "dv/dt": "(F - b*v)/m"},
    [Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")],
    {"m": (MASS, 0.05, "kg"), "b": (DAMPING, 0.1, "N s/m")},
)
SPEEDS, REST, MOVE = (0.05, -0.1, 0.2, -0.05, 0.1, -0.2), 60, 60


def driven(friction: float, noise: float, seed: int, share: float = 1.0, rows: int = 2000) -> pd.DataFrame:
    """Return a log of a carriage under a controller, with dry friction that holds it while it rests."""
    speed = share * np.resize(np.concatenate([np.r_[np.zeros(REST), np.full(MOVE, v)] for v in SPEEDS]), rows)
    speed = np.convolve(speed, [0.5, 0.5], "same")
    wanted, x, v, h, out = np.cumsum(speed) * DT, 0.0, 0.0, DT / STEPS, []
    for k, target in enumerate(wanted):
        force = 4000.0 * (target - x) + 300.0 * (speed[k] - v)
        out.append((k * DT, x, force))
        for _ in range(STEPS):
            free = (v + h * force / MASS) / (1.0 + h * DAMPING / MASS)
            held = h * friction / MASS / (1.0 + h * DAMPING / MASS)
            v = float(np.sign(free) * max(abs(free) - held, 0.0))
            x += h * v
    log = pd.DataFrame(out, columns=["time", "x", "F"])
    return log.assign(x=log["x"] + noise * np.random.default_rng(seed).standard_normal(len(log)))


def test_dry_friction_that_holds_a_carriage_is_told_from_a_dead_zone_as_wide():
    effects = ["coulomb_friction", "actuator_dead_zone", "actuator_hysteresis", "parameter_deviation"]
    found = diagnose_simulator(driven(20.0, 1e-4, 0), SIMULATOR, effects, seed=0)
    assert [cause.effects[0] for cause in found.causes] == ["coulomb_friction"] and not found.with_reserve
    assert abs(found.causes[0].parameters["amplitude"].value / 20.0 - 1.0) < 0.05


def test_a_ripple_that_is_undone_changes_the_noise_of_each_rest_by_its_slope_there():
    log = driven(0.0, 1e-3, 6)
    evidence = evidence_of(log, SIMULATOR)
    place, ripple = evidence.placements["sensor_ripple@x"], {"sine": 7e-4, "cosine": 0.0, "rate": 700.0}
    spread = evidence.spread({"sensor_ripple@x": place.inward(ripple)}, np.zeros(len(evidence.free)))
    assert spread is not None
    slope = 1.0 / (1.0 + 0.49 * np.cos(700.0 * log["x"].to_numpy()))
    rests = [w for w, at in enumerate(evidence.first) if np.ptp(log["x"].to_numpy()[at : at + 3 * evidence.n]) < 6e-3]
    expected = [np.sqrt(np.mean(np.square(slope[evidence.first[w] :][: 3 * evidence.n]))) for w in rests]
    assert len(rests) > 10 and np.corrcoef(spread[rests], np.minimum(expected, 1.0))[0, 1] > 0.8
    assert np.min(spread) < 0.8 * np.max(spread) < 0.85  # what is louder than motion costs elsewhere


def test_slow_moves_between_rests_show_dry_friction_and_no_heavy_carriage():
    effects = ["coulomb_friction", "actuator_dead_zone", "actuator_hysteresis", "parameter_deviation"]
    found = diagnose_simulator(driven(20.0, 1e-4, 5, 0.2, 1200), SIMULATOR, effects, seed=0)
    assert [cause.effects for cause in found.causes] == [("coulomb_friction",)]
    assert abs(found.causes[0].parameters["amplitude"].value / 20.0 - 1.0) < 0.05
