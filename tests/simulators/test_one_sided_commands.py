"""Faults of a command with one sign may be as large, compared with its largest value, as those of one with both."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port


def room(t, x, u, p):
    return [(20.0 * u.heat - (x.warmth - 15.0)) / 30.0]


@pytest.mark.parametrize("low", [-1.0, -0.25, 0.0])
def test_a_dead_zone_may_be_half_of_the_largest_command(low) -> None:
    rng = np.random.default_rng(3)
    heat = np.repeat(np.append(rng.uniform(low, 1.0, 38), [low, 1.0]), 10)
    warmth = 15.0 + np.cumsum(heat) / 30.0 + rng.normal(0.0, 5e-3, 400)
    log = pd.DataFrame({"trajectory": "run", "time": np.arange(400.0), "heat": heat, "warmth": warmth})
    simulator = FunctionSimulator(room, [Port("heat", "input", "V"), Port("warmth", "state", "K")])
    placed = evidence_of(log, simulator).placements["actuator_dead_zone@heat"]
    [width] = [p for p in placed.effect.parameters if p.name == "width"]
    assert placed.outward({"width": width.upper})["width"] == pytest.approx(0.5)
