"""Columns in units of their own for ports in SI: converted, told or refused, by the commands as they are printed."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.cli import main
from pamid.errors import PamidError
from pamid.signals import LogMapping, read_log
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.structure import joints_of

PAGE = """
kind = "equations"
[equations]
"dphi/dt" = "omega"
"domega/dt" = "(k*u - d*omega)/J"
"dx/dt" = "v"
"dv/dt" = "(A*(P - 1e5) - c*v - s*x)/m"
[ports]
u = { kind = "input", unit = "V" }
P = { kind = "input", unit = "Pa" }
phi = { kind = "state", unit = "rad" }
omega = { kind = "state", unit = "rad/s" }
x = { kind = "state", unit = "m" }
v = { kind = "state", unit = "m/s" }
[parameters]
k = 0.05
d = 0.002
J = 2e-3
A = 1e-4
c = 20.0
s = 400.0
m = 2.0
"""
DEG, RPM = 180 / np.pi, 30 / np.pi
CASES: dict[str, tuple[str, str, float]] = {
    f"{header} by {factor:.4g}": (port, header, factor)
    for port, cases in {
        "phi": [
            ("phi [deg]", DEG), ("phi_deg", DEG), ("phi (°)", DEG), ("phi", DEG), ("phi [mrad]", 1e3), ("phi", 1e3),
            ("phi [counts]", 4096 / (2 * np.pi)), ("phi_counts", 4096 / (2 * np.pi)), ("phi [%]", 20.0), ("phi", 20.0),
        ],
        "omega": [
            ("omega [rpm]", RPM), ("omega_rpm", RPM), ("omega", RPM), ("omega [1/min]", RPM), ("omega [deg/s]", DEG),
            ("omega_dps", DEG), ("omega", DEG), ("omega [%]", 5.0), ("omega", 5.0),
        ],
        "x": [
            ("x [mm]", 1e3), ("x_mm", 1e3), ("x", 1e3), ("x [cm]", 1e2), ("x", 1e2), ("x [in]", 1 / 0.0254),
            ("x [%]", 500.0), ("x_counts", 20_000.0),
        ],
        "v": [("v [mm/s]", 1e3), ("v_mm_s", 1e3), ("v", 1e3), ("v [km/h]", 3.6), ("v", 1e2)],
        "P": [
            ("P [bar]", 1e-5), ("P_bar", 1e-5), ("P", 1e-5), ("P [mbar]", 1e-2), ("P [kPa]", 1e-3), ("P", 1e-3),
            ("P [psi]", 1 / 6894.757), ("P [MPa]", 1e-6), ("P", 1e-6), ("P [%]", 3e-4),
        ],
        "u": [("u [mV]", 1e3), ("u_mV", 1e3), ("u", 1e3), ("u [%]", 20.0), ("u_percent", 20.0), ("u", 819.0)],
    }.items()
    for header, factor in cases
}  # fmt: skip
"""What a column is called, and by what the port's SI values are multiplied in it."""
QUICK = ("phi_deg", "omega_rpm", "P [bar]", "x [%]", "u [mV]", "phi by")


@pytest.fixture(scope="module")
def whole() -> pd.DataFrame:
    """Return two runs of the system, with a little noise."""
    dt, parts, rng = 0.01, [], np.random.default_rng(0)
    for run in range(2):
        t = dt * np.arange(600)
        u, P = 4.0 * np.sin((1.3 + run) * t), 2e5 + 8e4 * np.sin((0.9 + run) * t)
        state, rows = np.zeros(4), []
        for k in range(len(t)):
            rows.append(state)
            for _ in range(10):
                _phi, omega, x, v = state
                rate = np.array([omega, (0.05 * u[k] - 0.002 * omega) / 2e-3, v,
                                 (1e-4 * (P[k] - 1e5) - 20 * v - 400 * x) / 2])  # fmt: skip
                state = state + 0.1 * dt * rate
        states = np.array(rows) + rng.normal(0, [1e-4, 1e-2, 1e-5, 1e-4], (len(t), 4))
        names = dict(zip(("phi", "omega", "x", "v"), states.T, strict=True))
        parts.append(pd.DataFrame({"trajectory": f"run {run}", "time": t, "u": u, "P": P, **names}))
    return pd.concat(parts, ignore_index=True)


def outcome(port: str, header: str, factor: float, whole: pd.DataFrame, folder: Path, capsys) -> str:
    """Run init and what it prints, and say what became of the unit."""
    (folder / "sim.toml").write_text(PAGE)
    changed = whole.assign(**{port: factor * whole[port]}).rename(columns={port: header})
    changed.to_csv(folder / "log.csv", index=False)
    code = main(
        ["init", str(folder / "log.csv"), "--sim", str(folder / "sim.toml"), "--out", str(folder / "o"), "--yes"]
    )
    said = capsys.readouterr()
    if code:
        assert code == 2, said.err
        return f"refused: {said.err}"
    given = ["--sim", str(folder / "sim.toml"), "--columns", str(folder / "o" / "columns.toml")]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            mapping = LogMapping.load(folder / "o" / "columns.toml", own=list(whole.columns))
            log = read_log(folder / "log.csv", mapping, check_units=False)
        read = log[port].to_numpy() if port in log else np.full(len(whole), np.nan)
    except PamidError as error:
        return f"refused: {error}"
    if np.allclose(read, whole[port], rtol=1e-3, atol=1e-6 * np.ptp(whole[port])):
        return "converted"
    doubts = [line for line in (said.out + said.err).splitlines() if header in line or port in line]
    told = ("ASSUMED", "assumed", "looks like", "seems to be", "doubt", "?", "has no column")
    if any(word in line for line in doubts for word in told):
        return f"told: {doubts}"
    for command in ("check", "evaluate"):
        code = main([command, str(folder / "log.csv"), *given])
        said = capsys.readouterr()
        assert code in (0, 2), said.err
        text = " ".join((said.out + said.err).split())
        words = (f"{header} look", f"{port} look", f"{port} or ", f"{header} seems", f"{port} seems")
        if code == 2 or any(word in text for word in words):
            return f"told by {command}: {text[-300:]}"
    return "silent"


def quick(name: str) -> bool:
    return name.startswith(QUICK)


def case(name: str):
    marks = [] if quick(name) else [pytest.mark.slow]
    return pytest.param(name, marks=marks)


@pytest.mark.parametrize("name", [case(name) for name in CASES])
def test_a_unit_is_converted_told_or_refused(name: str, whole: pd.DataFrame, tmp_path: Path, capsys) -> None:
    found = outcome(*CASES[name], whole, tmp_path, capsys)
    assert found != "silent"


def test_there_are_forty() -> None:
    assert len(CASES) >= 40


def test_what_acts_at_a_joint_has_the_unit_of_what_it_is_added_to() -> None:
    ports = [Port("u", "input", "V"), Port("q", "state", "rad"), Port("w", "state", "rad/s")]
    for through, unit in (("", "rad/s^2"), ("u", "V")):
        joint = Port("shaft", "joint", "N m", position="q", velocity="w", through=through)
        simulator = FunctionSimulator(lambda t, x, u, p: [x.w, 80.0 * u.u], [*ports, joint])
        assert [j.unit for j in joints_of(simulator, {"q": "w"}, {("u", "w"): 80.0})] == [unit]
