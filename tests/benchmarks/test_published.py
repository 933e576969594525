"""The protocols of EMPS and of two tanks on records simulated here: terms are found, noise does not bias them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat, savemat

from benchmarks._published_emps import PUBLISHED, TERMS, Record, instrumental, published
from benchmarks._published_tanks import CURVE, FIRST, NONE, UPPER, Tanks, bend, changed, free_runs

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


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_pulses_act_with_the_sign_that_explains_the_record(sign: float, tmp_path: Path) -> None:
    plain = record(tmp_path / "DATA_EMPS.mat", 3e-7)
    data = {k: v for k, v in loadmat(tmp_path / "DATA_EMPS.mat").items() if not k.startswith("__")}
    pulses = 40.0 * (np.arange(12_000) % 4_000 < 500)
    data["vir"] = data["vir"] - sign * pulses / GAIN  # what the pulses push, the drive need not
    savemat(tmp_path / "DATA_EMPS_PULSES.mat", data | {"pulses_N": pulses})
    held = Record(tmp_path / "DATA_EMPS_PULSES.mat")
    assert held.error(published, PUBLISHED) == pytest.approx(plain.error(published, PUBLISHED), rel=1e-6)


def test_an_overflow_and_a_bent_sensor_are_fitted_and_predict_the_other_record(tmp_path: Path) -> None:
    n, knots, rng = 100, np.linspace(2.0, 10.0, len(CURVE)), np.random.default_rng(0)
    true = changed(NONE, {8: 0.3, 9: 6.0, 10: 0.7, 6: 4.0, 7: 6.0} | dict(zip(CURVE, 0.3 * np.sin(knots), strict=True)))
    u = {part: np.repeat(rng.uniform(0.5, 6.0, n // 10), 10) for part in ("Est", "Val")}
    y = {part: free_runs(true[:, None], u[part], 4.0, knots)[:, 0] for part in u}
    table = {f"{name}{part}": some[part] for part in u for name, some in (("u", u), ("y", y))}
    pd.DataFrame(table | {"Ts": 4.0}).to_csv(tmp_path / "dataBenchmark.csv", index=False)
    tanks = Tanks(tmp_path)
    tanks.knots = knots
    found = [tanks.fit(changed(true, {8: 0.2, 9: 7.0} | dict.fromkeys(CURVE, 0.0)), FIRST, UPPER, *more)
             for more in ((), (CURVE,))]  # fmt: skip
    without, bent = (tanks.errors(p)[1] for p in found)
    assert bent < 0.02 < 0.1 < without
    assert found[1][9] == pytest.approx(6.0, rel=0.05)


def test_the_curve_of_a_sensor_goes_on_straight_beyond_its_knots() -> None:
    knots, curve = np.array([2.0, 3.0, 4.0]), np.array([[1.0], [0.0], [0.5]])
    read = [float(bend(np.array([h]), curve, knots)[0]) for h in (1.0, 2.0, 2.5, 3.5, 5.0)]
    assert read == pytest.approx([2.0, 1.0, 0.5, 0.25, 1.0])
