"""The signals by which a diagnosis tells where a gap lies: those of the user's log, under their own names."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap.diagnosis import remainder
from pamid.gap.residuals.shooting import ShootingEvidence
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, FunctionSimulator, Port
from pamid.simulators.port_log import port_log


def tanks(gain: float) -> pd.DataFrame:
    """Two tanks in a row, the upper one filled by a pump."""
    t, h = np.arange(0.0, 400.0, 1.0), np.zeros((2, 400))
    u = 1.0 + np.sign(np.sin(t / 30.0))
    for k in range(399):
        h[:, k + 1] = h[:, k] + [gain * 0.02 * u[k] - 0.02 * h[0, k], 0.02 * h[0, k] - 0.01 * h[1, k]]
    noise = 1e-4 * np.random.default_rng(0).standard_normal(h.shape)
    return pd.DataFrame({"trajectory": "a", "time": t, "u0": u, "h1": h[0] + noise[0], "y0": h[1] + noise[1]})


def test_a_number_in_a_name_is_part_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    log = tanks(1.3).assign(h2=lambda table: table["y0"])
    ports = [Port("u0", "input", "V"), Port("h1", "state", "m"), Port("h2", "state", "m")]
    evidence = evidence_of(log, EquationSimulator({"dh1/dt": "0.02*(u0 - h1)", "dh2/dt": "0.02*h1 - 0.01*h2"}, ports))
    assert "h1" in evidence.told("h1") and "h" not in evidence.told("h1")
    monkeypatch.setattr(remainder, "_learned", lambda state, *_: {"depends_on": list(state)})
    monkeypatch.setattr(remainder, "_formula", lambda *_: {})
    found = remainder.leftover(evidence, "h1", evidence.raw(evidence.z0))
    assert set(found["depends_on"]) == {"h1", "h2", "u0"}


def test_states_within_a_system_tell_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    ports = [Port("u0", "input"), Port("x0", "state"), Port("x1", "state"), Port("y0", "output")]
    equations = {"dx0/dt": "0.02*(u0 - x0)", "dx1/dt": "0.02*x0 - 0.01*x1", "y0": "x1"}
    evidence = evidence_of(tanks(1.1), EquationSimulator(equations, ports))
    assert {"u0", "x0"} <= set(evidence.told("y0"))
    monkeypatch.setattr(EquationSimulator, "hidden_states", ("x0", "x1"))
    assert set(evidence.told("y0")) == {"u0", "y0"}


def test_a_hidden_state_that_takes_up_a_gap_tells_no_place():
    rng, t = np.random.default_rng(8), np.arange(0.0, 200.0, 0.2)
    current = np.repeat(rng.uniform(-4.0, 8.0, 50), 20)

    def rates(t, x, u, p):
        return [-u.current / 9000.0, (0.015 * u.current - x.v1) / 13.5]

    def terminal(t, x, u, p):
        return {"voltage": 3.2 + 0.75 * x.soc - p.R0 * u.current - x.v1}

    soc, v1, voltage = 0.85, 0.0, []
    for i in current:
        voltage.append(3.2 + 0.75 * soc - 0.06 * i - v1)
        soc, v1 = soc - 0.2 * i / 9000.0, v1 + (1.0 - np.exp(-0.2 / 13.5)) * (0.015 * i - v1)
    log = pd.DataFrame({"time": t, "current": current, "voltage": voltage + 0.0003 * rng.standard_normal(len(t))})
    ports = [Port("current", "input", "A"), Port("voltage", "output", "V"),
             Port("soc", "state", "-", start=0.85), Port("v1", "state", "V")]  # fmt: skip
    wrong, right = (
        ShootingEvidence(port_log(log, simulator), simulator, longest=25)
        for simulator in (FunctionSimulator(rates, ports, {"R0": r}, output=terminal) for r in (0.02, 0.06))
    )
    assert "v1" in wrong.undetermined() and "v1" not in wrong.told("voltage")
    assert right.undetermined() == []
