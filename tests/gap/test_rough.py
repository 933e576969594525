"""Simulators whose runs are rough in their parameters: a servo that sticks, moved slowly by a limited command."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.gap.inference.rough import compass, longer
from pamid.simulators import FunctionSimulator, Port

DT, STEP = 0.04, 0.005


def bumps(x: np.ndarray) -> np.ndarray:
    """Noise that is a function of numbers."""
    return np.random.default_rng(np.abs(np.asarray(x).view(np.int64)).astype(np.uint64)).standard_normal(400)


def servo(time: np.ndarray, command: np.ndarray) -> np.ndarray:
    """A position servo whose rest friction exceeds its sliding friction, by fixed steps."""
    when = np.arange(round((time[-1] - time[0]) / STEP) + 1) * STEP
    given = command[np.clip(np.searchsorted(time - time[0], when + 1e-6, side="right") - 1, 0, None)]
    q, v, out = float(command[0]), 0.0, np.empty(len(when))
    for k, target in enumerate(given):
        push = 60.0 * (target - q) - 8.0 * v
        if v == 0.0 and abs(push) <= 2.0:
            out[k] = q
            continue
        slide = 0.8 * (np.sign(v) if v else np.sign(push))
        new = v + STEP * (push - slide)
        v = 0.0 if v * new < 0.0 else new
        q += STEP * v
        out[k] = q
    return out[np.clip(np.round((time - time[0]) / STEP).astype(int), 0, len(out) - 1)]


def limited(command: np.ndarray, rate: float, lag: float) -> np.ndarray:
    out, x, y = np.empty(len(command)), command[0], command[0]
    for k, u in enumerate(command):
        x += np.clip(u - x, -rate * DT, rate * DT)
        y += (1.0 - np.exp(-DT / lag)) * (x - y)
        out[k] = y
    return out


def test_a_smooth_change_needs_no_longer_difference():
    assert longer(0.01, 1.0, 0.0, 9.0, lambda h: np.array([h, h * h])) == 0.0


def test_a_rough_change_needs_one_that_exceeds_the_roughness():
    far = longer(0.01, 1.0, 0.0, 9.0, lambda h: 20.0 * h + bumps(1.0 + h) - bumps(1.0))
    assert far >= 0.09


def test_a_limit_out_of_reach_is_looked_for_within_reach():
    assert longer(0.01, 1.0, 0.0, 9.0, lambda h: np.array([min(h + 0.2, 0.0)])) > 0.01


def test_the_compass_finds_a_hill_that_chance_makes_rough():
    def value(x: np.ndarray) -> float:
        return -500.0 * float(np.sum(np.square(np.log(x / np.array([3.0, 0.2]))))) + 5.0 * float(bumps(x[:1])[0])

    x, chance = compass(value, np.array([1.0, 1.0]), np.array([1e-3, 1e-3]), np.array([10.0, 10.0]))
    assert x == pytest.approx([3.0, 0.2], rel=0.25)
    assert chance > 0.0


def test_the_compass_stays_within_bounds():
    assert compass(lambda x: float(x[0]), np.array([1.0]), np.array([0.1]), np.array([1.7]))[0] == pytest.approx([1.7])


def test_a_limited_command_of_a_servo_that_sticks_is_found_beside_its_lag():
    rng = np.random.default_rng(906)
    rate, lag = rng.uniform(0.4, 1.6), rng.uniform(0.03, 0.15)
    logs = []
    for name in "ab":
        t = np.arange(750) * DT
        held = 0.6 * np.repeat(rng.uniform(-1.0, 1.0, 50), 15)
        moved = held + 0.5 * np.sin(2 * np.pi * rng.uniform(0.2, 0.8) * t)
        q = servo(t, limited(moved, rate, lag)) + 0.0003 * rng.standard_normal(len(t))
        logs.append(pd.DataFrame({"trajectory": name, "time": t, "command": moved, "angle": q}))
    ports = [Port("command", "input", "rad"), Port("angle", "output", "rad")]
    simulator = FunctionSimulator(
        lambda u, p, x0: servo(np.asarray(u.time), np.asarray(u.command))[None], ports, form="run"
    )
    effects = [
        "actuator_slew_rate@command",
        "actuator_lag@command",
        "actuator_delay@command",
        "actuator_bias@command",
        "sensor_backlash@angle",
    ]
    found = diagnose_simulator(pd.concat(logs, ignore_index=True), simulator, effects, seed=0)
    named = {n: v for n, _, v in found.corrected.effects}
    assert set(named) == {"actuator_slew_rate", "actuator_lag"}
    assert named["actuator_slew_rate"]["rate"] == pytest.approx(rate, rel=0.02)
    assert named["actuator_lag"]["time_constant"] == pytest.approx(lag, abs=DT / 2)
