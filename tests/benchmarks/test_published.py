"""The protocol of EMPS on an axis simulated here: terms are found, instruments agree, noise does not bias them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from benchmarks._published_emps import TERMS, Record, instrumental, published

MASS, COULOMB, FORWARD, BACKWARD, GAIN = 95.0, 20.0, 165.0, 240.0, 35.0


def record(path: Path, noise: float) -> Record:
    """Write and read a closed loop at 1 kHz with viscous friction that differs by direction."""
    t = 1e-3 * np.arange(12_000)
    wanted = 0.12 * np.sin(0.9 * t) + 0.04 * np.sin(2.7 * t)
    speed = np.gradient(wanted, 1e-3)
    rng, x, v, q, volts = np.random.default_rng(0), 0.0, float(speed[0]), [], []
    for k in range(len(t)):
        seen = x + noise * rng.standard_normal()
        u = 4e4 * (wanted[k] - seen) / GAIN * 0.5 + 200.0 * (speed[k] - v) / GAIN * 4
        q.append(seen)
        volts.append(u)
        for _ in range(5):
            slope = FORWARD if v > 0 else BACKWARD
            v += 2e-4 * (GAIN * u - COULOMB * np.sign(v) - slope * v) / MASS
            x += 2e-4 * v
    savemat(path, {"t": t, "qm": np.array(q), "qg": wanted, "vir": np.array(volts), "gtau": GAIN})
    return Record(path)


@pytest.mark.parametrize("way", ["least squares", "instruments"])
def test_named_terms_say_what_the_offset_hid(way: str, tmp_path: Path) -> None:
    axis = record(tmp_path / "DATA_EMPS.mat", 3e-7)

    def named(a: np.ndarray, v: np.ndarray) -> list[np.ndarray]:
        return [a, *TERMS["coulomb_friction"]({})(a, v), *TERMS["directional_damping"]({})(a, v)]

    fit = axis.least_squares if way == "least squares" else lambda terms: instrumental(axis, terms)
    theta = fit(named)
    assert theta == pytest.approx([MASS, COULOMB, FORWARD, BACKWARD], rel=0.05)
    plain = fit(published)
    assert plain[3] < -1.0, "friction that differs by direction looks like an offset"
    assert axis.error(named, theta) < 0.7 * axis.error(published, plain)
