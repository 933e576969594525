"""Chambers of simulators of whole runs, whose levels are outputs."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pamid.gap import diagnose_simulator
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port

TANK = [Port("q", "input", "m^3/s"), Port("more", "input", "m^3/s"), Port("h", "output", "m"),
        Port("h0", "state", "m"), Port("tank", "chamber", "m^3/s", level="h", through="more")]  # fmt: skip


def fill(u, p, x0):
    """A tank of 0.5 m² whose outflow grows with its level."""
    dt, h = float(np.diff(u["time"])[0]), [float(x0.h0)]
    for q in np.asarray(u.q + u.more)[:-1]:
        h.append(h[-1] + dt * (q - 0.02 * h[-1]) / 0.5)
    return {"h": np.array(h)}


def tank_log(leak: float) -> tuple[pd.DataFrame, FunctionSimulator]:
    rng, parts, t = np.random.default_rng(3), [], np.arange(0.0, 120.0, 0.5)
    for k in range(3):
        u = {"time": t, "q": 0.01 + 0.008 * np.sign(np.sin(0.1 * t + k)), "more": 0.0 * t, "h0": 0.0}
        h = [0.4]
        for q in u["q"][:-1]:
            h.append(h[-1] + 0.5 * (q - (0.02 + leak) * h[-1]) / 0.5)
        read = np.array(h) + 1e-3 * rng.standard_normal(len(t))
        parts.append(pd.DataFrame({"trajectory": f"run{k}", "time": t, "q": u["q"], "h": read}))
    simulator = FunctionSimulator(fill, [*TANK[:3], Port("h0", "state", "m", column="", start=0.4), TANK[4]])
    return pd.concat(parts, ignore_index=True), simulator


def test_what_overflows_at_a_level_that_is_an_output_is_asked_for() -> None:
    log, simulator = tank_log(0.0)
    evidence = evidence_of(log, simulator)
    place = evidence.placements["overflow@tank"]
    level = next(p for p in place.effect.parameters if p.name == "level")
    found = evidence.reached(level)
    assert level.lower <= found.lower < found.nominal < found.upper <= level.upper
    assert found.upper < float(log["h"].max()) * place.scales.pressure + place.scales.offset
    assert diagnose_simulator(log, simulator).verdict == "none"
