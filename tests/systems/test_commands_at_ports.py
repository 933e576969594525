"""Every command that takes a simulator takes one with ports: equations, functions, control systems, MuJoCo models."""

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from support.pictures import leave_out

from pamid.cli import main
from pamid.simulators import EquationSimulator, ModelParameter, Port, page_text

pytestmark = pytest.mark.filterwarnings("ignore::pamid.errors.PamidWarning")
KINDS = ("ode", "equations", "function", "control", "mujoco")
MASS, RUB = 2.0, 1.5
RAIL = [Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]
PORTS = (
    '[ports]\nF = { kind = "input", unit = "N" }\nx = { kind = "state", unit = "m" }\n'
    'v = { kind = "state", unit = "m/s" }\n[parameters]\nm = { value = 2.0, tolerance = 0.05, unit = "kg" }\n'
)
CODE = """import numpy as np
def rate(t, x, u, p):
    return [x.v, u.F / p.m]
def push(u, p):
    return p.m * u.a
def system():
    import control
    return control.ss([[0, 1], [0, 0]], [[0], [0.5]], [[0, 1]], [[0]])
"""
MODEL = """<mujoco><option timestep="0.01" gravity="0 0 0"/><worldbody><body>
<joint name="rail" type="slide" axis="1 0 0"/><geom type="box" size=".1 .1 .1" mass="2"/></body></worldbody>
<actuator><motor name="push" joint="rail"/></actuator></mujoco>"""


def recorded(seed: int, folder: Path, name: str) -> str:
    """A mass on a rail with viscous friction, finely integrated, in the columns of every kind."""
    rng, runs = np.random.default_rng(seed), []
    for k in range(2):
        t, x, v = np.arange(0, 5, 0.01), [0.0], [0.0]
        force = 5.0 * np.sin((1.0 + k + 0.3 * seed) * t) + 3.0 * np.sin(0.7 * t)
        for f in force[:-1]:
            now = v[-1]
            for _ in range(10):
                now += 0.001 * (f - RUB * now) / MASS
            v.append(now)
            x.append(x[-1] + 0.005 * (v[-1] + v[-2]))
        x, v = x + 1e-5 * rng.standard_normal(len(t)), v + 1e-3 * rng.standard_normal(len(t))
        a = np.gradient(np.array(v), t)
        columns = {"F": force, "x": x, "v": v, "a": a, "u0": force, "y0": v, "push": force, "rail": x, "rail_dq": v}
        runs.append(pd.DataFrame({"trajectory": f"{k}", "time": t, **columns}))
    pd.concat(runs).to_csv(folder / name, index=False)
    return str(folder / name)


def fmu(folder: Path) -> Path:
    pytest.importorskip("fmpy")
    if not shutil.which("cc"):
        pytest.skip("needs a C compiler")
    from pamid.export.ode_fmu import ode_fmu

    made = ode_fmu(
        "rail", lambda t, x, u, p: [x.dq, u.F / p.m], {"q": 0.0, "dq": 0.0}, {"F": 0.0}, {"m": MASS},
        outputs=lambda t, x, u, p: {"x": x.q, "v": x.dq}, units={"F": "N", "x": "m", "v": "m/s", "m": "kg"},
    )  # fmt: skip
    (folder / "rail.fmu").write_bytes(made)
    joint = 'rail = { kind = "joint", unit = "N", position = "x", velocity = "v", through = "F" }\n'
    (folder / "sim.toml").write_text(f'kind = "fmu"\n[fmu]\nfmu = "rail.fmu"\n[ports]\n{joint}')
    return folder / "sim.toml"


def page(kind: str, folder: Path) -> str:
    (folder / "rail.py").write_text(CODE)
    file = folder / "sim.toml"
    if kind == "mujoco":
        file = folder / "rail.xml"
        file.write_text(MODEL)
    elif kind == "equations":
        pytest.importorskip("sympy")
        made = EquationSimulator({"dx/dt": "v", "dv/dt": "F / m"}, RAIL, {"m": ModelParameter(2.0, 0.05, "kg")})
        file.write_text(page_text(made, folder))
    elif kind == "ode":
        file.write_text(f'kind = "ode"\n[ode]\nfunction = "rail.py:rate"\n{PORTS}')
    elif kind == "function":
        file.write_text(
            'kind = "function"\n[function]\nfunction = "rail.py:push"\n[ports]\n'
            'a = { kind = "input", unit = "m/s^2" }\n'
            'F = { kind = "output", unit = "N" }\n[parameters]\nm = { value = 2.0, tolerance = 0.05, unit = "kg" }\n'
        )
    else:
        pytest.importorskip("control")
        file.write_text(
            'kind = "control"\n[control]\nsystem = "rail.py:system"\n[ports]\nu0 = { kind = "input", unit = "N" }\n'
            'y0 = { kind = "output", unit = "m/s" }\n'
        )
    return str(file)


@pytest.mark.parametrize("kind", KINDS)
def test_commands_take_every_kind_of_simulator(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    log, more, sim = recorded(1, tmp_path, "one.csv"), recorded(2, tmp_path, "two.csv"), page(kind, tmp_path)
    given, out = ["--sim", sim, "--trust"], str(tmp_path / "out")

    def told(*argv: str) -> dict:
        assert main([*argv, "--json", "--quiet"]) == 0, capsys.readouterr().err
        return json.loads(capsys.readouterr().out)

    checked = told("check", log, *given)
    units = {one["name"]: one["unit"] for one in checked["channels"]}
    assert checked["sampling"]["runs"] == 2 and (kind != "equations" or units["v"] == "m/s")
    assert told("evaluate", log, *given)["equations"]
    if kind == "equations":  # what follows from an evaluation is of no kind of its own
        assert told("evaluate", log, *given, "--refit")["equations"]
        assert told("evaluate", log, *given, "--piece-rows", "500")["equations"]
    assert told("resid", log, *given, "--lags", "10")["equations"]
    few = ["--effects", "viscous_friction,actuator_gain,sensor_gain,sensor_bias"]
    first = told("diagnose", log, *given, *few, "--out", out)
    assert {"report.html", "diagnosis.json", "state.json", "logs.parquet"} <= set(first["files"])
    leave_out(monkeypatch)
    both = told("diagnose", log, more, *given, *few, "--out", str(tmp_path / "both"))
    assert [f["log"] for f in both["logs"]] == ["one", "two"]
    assert told("next", out, "--trust", "--designs", "16")["purpose"] in (
        "parameters",
        "discriminate",
        "unseen",
        "none",
    )
    second = told("diagnose", more, "--since", out, *given, "--out", str(tmp_path / "second"))
    assert len(second["rounds"]) == 2
    if kind in ("ode", "equations", "mujoco"):
        for found in (first, both, second):
            assert [c["effects"][0] for c in found["causes"]] == ["viscous_friction"], found["verdict"]
        again = told("evaluate", log, "--sim", str(tmp_path / "out" / "corrected.toml"), "--trust")["equations"]
        before = told("evaluate", log, *given)["equations"]
        assert max(e["rmse"] for e in again.values()) < 0.2 * max(e["rmse"] for e in before.values())


@pytest.mark.slow
def test_several_logs_of_an_fmu_are_diagnosed_together(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sim, logs = fmu(tmp_path), []
    for seed in (1, 2):
        whole = pd.read_csv(recorded(seed, tmp_path, f"day{seed}.csv"))
        logs.append(str(tmp_path / f"day{seed}.csv"))
        whole[whole["time"] < 1.5].to_csv(logs[-1], index=False)
    given = [
        "--sim",
        str(sim),
        "--trust",
        "--effects",
        "viscous_friction,actuator_gain",
        "--out",
        str(tmp_path / "out"),
    ]
    assert main(["diagnose", *logs, *given, "--json", "--quiet"]) == 0, capsys.readouterr().err
    found = json.loads(capsys.readouterr().out)
    assert [day["log"] for day in found["logs"]] == ["day1", "day2"]
    (cause,) = found["causes"]
    assert cause["effects"] == ["viscous_friction"]
    assert cause["parameters"]["coefficient"]["value"] == pytest.approx(RUB, rel=0.1)
