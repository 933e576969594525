"""A servo logged by its angle alone: smoothing its speed makes no gap, and readings are compared without its forces."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap.readings import KinematicEvidence
from pamid.gap.residuals import direct
from pamid.gap.residuals.direct import DirectEvidence
from pamid.gap.residuals.states import measured_states
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.port_log import port_log

INERTIA, STIFFNESS, DAMPING, FRICTION = 0.15, 50.0, 5.0, 0.3
ENCODER = 2.0 * np.pi / 4096


def rates(t, x, u, p):
    torque = STIFFNESS * (u.command - x.q) - DAMPING * x.dq - FRICTION * np.tanh(x.dq / 0.01)
    return [x.dq, torque / INERTIA]


def direct_evidence(table: pd.DataFrame, simulator: FunctionSimulator) -> DirectEvidence:
    log = port_log(table, simulator)
    return DirectEvidence(log, simulator, measured_states(simulator, log))


def servo() -> FunctionSimulator:
    ports = [Port("command", "input", "rad"), Port("q", "state", "rad"), Port("dq", "state", "rad/s")]
    return FunctionSimulator(rates, ports)


@pytest.fixture(scope="module")
def log() -> pd.DataFrame:
    """Two minutes of commands that are held for 10 ms each, read by an encoder of 12 bits."""
    h, m, n = 0.01, 40, 12_000
    q = v = 0.0
    rows = np.empty((n, 4))
    for k in range(n):
        t = k * h
        command = 0.4 * np.sin(1.9 * t) + 0.2 * np.sin(3.7 * t + 1.0)
        rows[k] = t, command, np.round(q / ENCODER) * ENCODER, v
        for _ in range(m):
            a = (STIFFNESS * (command - q) - DAMPING * v - FRICTION * np.tanh(v / 0.01)) / INERTIA
            v += h / m * a
            q += h / m * v
    return pd.DataFrame(rows, columns=["time", "command", "q", "dq"]).assign(trajectory="record")


def test_what_smoothing_takes_from_a_speed_is_no_gap(log: pd.DataFrame, monkeypatch: pytest.MonkeyPatch) -> None:
    """A damping is straight in the speed, so that its residuals are the same however smooth the speed is made."""
    ports = [Port("command", "input", "rad"), Port("q", "state", "rad"), Port("dq", "state", "rad/s")]
    damping = {"viscous_friction@q": {"coefficient": 20.0}}
    damped = FunctionSimulator(lambda t, x, u, p: [x.dq, STIFFNESS * (u.command - x.q) - DAMPING * x.dq], ports)
    table = log.iloc[:2000].drop(columns="dq")
    left = direct_evidence(table, damped)
    derivative = DirectEvidence._derivative

    def smoother(self: DirectEvidence, name: str, x: np.ndarray) -> np.ndarray:
        return np.convolve(derivative(self, name, x), np.full(9, 1 / 9), "same")

    monkeypatch.setattr(DirectEvidence, "_derivative", smoother)
    again = direct_evidence(table, damped)
    inner = slice(5, -5)  # at its ends a log has no neighbours to be smoothed with
    assert left.n == again.n
    more = [e.z(damping) * e.noise - e.value for e in (left, again)]
    assert np.std((more[1] - more[0])[inner]) < 0.02 * np.std(more[0])
    moved = np.std((again.value - left.value)[inner])
    monkeypatch.setattr(direct, "speed_slopes", lambda simulator, *_: np.zeros((len(simulator.states), 1)))
    assert moved < 0.1 * np.std((direct_evidence(table, damped).value - left.value)[inner])


def test_readings_are_compared_without_asking_for_forces(log: pd.DataFrame, monkeypatch: pytest.MonkeyPatch) -> None:
    simulator, asked = servo(), []
    rate = simulator.rate
    monkeypatch.setattr(simulator, "rate", lambda t, x, u, p: (asked.append(x.shape[1]), rate(t, x, u, p))[1])
    found = KinematicEvidence(port_log(log, simulator), simulator, {})
    asked.clear()
    found.z({"sensor_lag@dq": {"time_constant": 0.02}})
    assert found.equations == ["dq"] and max(asked, default=0) < 100
    assert "drive of dq" in found.free  # what the servo does within a step is no disagreement
