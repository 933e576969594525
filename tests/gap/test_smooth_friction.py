"""Dry friction whose sign a simulator smooths: it fades below a transition speed."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.effects import Signals
from pamid.effects.dry_friction import CoulombFriction
from pamid.gap import diagnose_simulator
from pamid.simulators import FunctionSimulator, Port

MASS, FRICTION, TRANSITION, DT = 2.0, 3.0, 0.02, 4e-3
SLIDE = FunctionSimulator(
    lambda t, x, u, p: [x.v, (u.force - p.k * x.x - p.d * x.v) / p.m],
    [
        Port("force", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s"),
        Port("slide", "joint", "N", position="x", velocity="v"),
    ],
    {"m": (MASS, 0.03, "kg"), "k": (400.0, 0.05, "N/m"), "d": (6.0, 0.1, "N s/m")},
)  # fmt: skip


def slide_log(breakaway: float) -> pd.DataFrame:
    """Return what sensors see of the slide with friction, by Euler's steps of 0.2 ms."""
    rng, frames = np.random.default_rng(3), []
    for k in range(2):
        t = np.arange(0.0, 5.0, DT)
        force = 14.0 * np.sin(2 * np.pi * (0.8 + 0.3 * k) * t) + 8.0 * np.sin(2 * np.pi * (2.1 - 0.3 * k) * t + k)
        x, v, rows = 0.0, 0.0, []
        for now in force:
            rows.append((x, v))
            for _ in range(20):
                dry = (FRICTION + breakaway * np.exp(-((v / 0.05) ** 2))) * np.tanh(v / TRANSITION)
                v += DT / 20 * (now - 400.0 * x - 6.0 * v - dry) / MASS
                x += DT / 20 * v
        x, v = np.array(rows).T + rng.standard_normal((2, len(t))) * np.array([[1e-5], [5e-4]])
        frames.append(pd.DataFrame({"trajectory": f"run {k}", "time": t, "force": force, "x": x, "v": v}))
    return pd.concat(frames, ignore_index=True)


@pytest.mark.parametrize(("breakaway", "law"), [(0.0, "coulomb_friction"), (2.0, "stribeck_friction")])
def test_smoothed_friction_is_found_with_its_transition(breakaway: float, law: str) -> None:
    found = diagnose_simulator(slide_log(breakaway), SLIDE, ["coulomb_friction", "stribeck_friction", "creep"])
    assert [c.effects for c in found.causes] == [(law,)]
    fitted = found.causes[0].parameters
    size = fitted["amplitude" if law == "coulomb_friction" else "coulomb"]
    assert size.value == pytest.approx(FRICTION / MASS, rel=0.03)
    assert fitted["transition"].value == pytest.approx(TRANSITION, rel=0.05)
    assert "transition 0.0" in str(found)  # a simulator needs it, too
    slide = found.closure[0]
    assert slide.rmse_after < 1.6 * slide.noise_floor < 0.1 * slide.rmse_before


def test_friction_fades_below_its_transition_and_files_without_one_load() -> None:
    v = np.array([-1.0, -0.02, 0.0, 0.02, 1.0])
    s = Signals(position=np.zeros(5), velocity=v, pressure=np.zeros(5))
    bristles = np.sign(v)[None]
    smooth = CoulombFriction(amplitude=5.0, transition=0.02).force(s, bristles, None)
    np.testing.assert_allclose(smooth, -5.0 * np.tanh(v / 0.02))
    before = CoulombFriction.in_units(amplitude=5.0, per_pressure=0.0, presliding=1e-6, exponent=1.0)
    np.testing.assert_allclose(before.force(s, bristles, None), -5.0 * np.sign(v))
