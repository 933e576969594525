"""An input that acts against the direction of a speed or a level: what adds to it has the other sign."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.simulators import EquationSimulator, Port

STATES = [Port("u", "input", "V"), Port("x", "state", "m"), Port("v", "state", "m/s")]
JOINT = Port("slide", "joint", "V", position="x", velocity="v", through="u")


def drive(ports):
    return EquationSimulator({"dx/dt": "v", "dv/dt": "-2*u - 30*x - 0.4*v"}, ports, {})


def rubbing(friction=1.5, dt=5e-3, rows=1500):
    rng, runs = np.random.default_rng(0), []
    for run in range(2):
        t = dt * np.arange(rows)
        w = 2 * np.pi * rng.uniform(0.2, 2.0, 5)
        u = 3 * np.sin(w * t[:, None] + rng.uniform(0, 6, 5)).sum(axis=1)
        x, v, read = 0.0, 0.0, []
        for now in u:
            read.append((x, v))
            for _ in range(20):
                v += dt / 20 * (-2 * now - 30 * x - 0.4 * v - friction * np.tanh(v / 1e-3))
                x += dt / 20 * v
        read = np.array(read) + [1e-4, 1e-3] * rng.standard_normal((rows, 2))
        runs.append(pd.DataFrame({"trajectory": str(run), "time": t, "u": u, "x": read[:, 0], "v": read[:, 1]}))
    return pd.concat(runs, ignore_index=True)


@pytest.mark.parametrize("ports", [STATES, [*STATES, JOINT]], ids=["seen", "declared"])
def test_friction_opposes_the_motion_where_the_input_does(ports):
    found = diagnose_simulator(rubbing(), drive(ports), ["coulomb_friction", "hysteresis", "sensor_gain"])
    (cause,) = found.causes
    assert cause.effects[0] == "coulomb_friction"
    amplitude = cause.parameters["amplitude"]
    assert amplitude.unit == "m/s^2" and amplitude.value == pytest.approx(1.5, rel=0.05)


def test_a_leak_empties_a_store_that_its_port_empties_too():
    ports = [Port("out", "input", "m^3/s"), Port("h", "state", "m"),
             Port("tank", "chamber", "m^3/s", level="h", through="out")]  # fmt: skip
    tank, dt, h, rows = EquationSimulator({"dh/dt": "2e-3 - out"}, ports, {}), 1.0, 1.0, []
    out = 2e-3 + 1e-3 * np.sin(np.arange(800) / 30)
    for q in out:
        rows.append(h)
        h += dt * (2e-3 - q - 4e-4 * np.sqrt(max(h, 0.0)))
    h = np.array(rows) + 1e-4 * np.random.default_rng(0).standard_normal(len(rows))
    log = pd.DataFrame({"trajectory": "1", "time": dt * np.arange(len(h)), "out": out, "h": h})
    found = diagnose_simulator(log, tank, ["leakage", "sensor_gain"])
    (cause,) = found.causes
    assert cause.effects[0] == "leakage"
    assert found.closure[0].closed_share > 0.9
