"""The signals by which a diagnosis tells where a gap lies: those of the user's log, under their own names."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap.diagnosis import remainder
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, Port


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
    evidence = evidence_of(tanks(1.3), EquationSimulator(equations, ports))
    assert {"u0", "x0"} <= set(evidence.told("y0"))
    monkeypatch.setattr(EquationSimulator, "hidden_states", ("x0", "x1"))
    assert set(evidence.told("y0")) == {"u0", "y0"}
