"""Pages of simulators: what they say, that nothing runs without trust, and the way through the command line."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.cli import main
from pamid.errors import ForeignSimulatorError, PamidError, SimulatorSyntaxError, UnknownOptionError, UntrustedCodeError
from pamid.simulators import ControlSimulator, FmuSimulator, MujocoSimulator, page_text, read_simulator
from pamid.simulators.fmu_worker import receive, send

CODE = """
from pathlib import Path
Path(__file__).with_suffix(".ran").touch()
def rates(t, x, u, p):
    return [x.v, u.F / p.m]
"""
PAGE = """
kind = "ode"
[ode]
function = "cart.py:rates"
[ports]
F = { kind = "input", unit = "N", column = "force" }
x = { kind = "state", unit = "m" }
v = { kind = "state", unit = "m/s" }
[parameters]
m = { value = 2.0, tolerance = 0.05, unit = "kg" }
"""
ARM = """
<mujoco><compiler angle="radian"/>
<worldbody><body name="arm"><joint name="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="0.5"/></body></worldbody>
<actuator><motor name="motor" joint="hinge"/></actuator></mujoco>
"""
FEW = "viscous_friction,coulomb_friction,actuator_gain"


@pytest.fixture
def cart(tmp_path: Path) -> Path:
    (tmp_path / "cart.py").write_text(CODE)
    (tmp_path / "sim.toml").write_text(PAGE)
    rng, parts = np.random.default_rng(0), []
    for k in range(4):
        t = np.arange(0, 8, 0.01)
        F = 6 * np.sin((1 + k) * t) + 4 * np.sin(0.7 * t + k)
        v = np.zeros(len(t))
        for i in range(len(t) - 1):  # 3 N s/m of friction, exact for a force that is held
            v[i + 1] = F[i] / 3 + (v[i] - F[i] / 3) * np.exp(-0.015)
        x = np.concatenate([[0], np.cumsum(0.005 * (v[1:] + v[:-1]))])
        noisy = {"x": x + 1e-5 * rng.standard_normal(len(t)), "v": v + 1e-3 * rng.standard_normal(len(t))}
        parts.append(pd.DataFrame({"trajectory": f"run{k}", "time": t, "force": F, **noisy}))
    pd.concat(parts).to_csv(tmp_path / "log.csv", index=False)
    return tmp_path


def test_loading_a_page_runs_no_code_without_trust(cart: Path) -> None:
    with pytest.raises(UntrustedCodeError, match="--trust"):
        read_simulator(cart / "sim.toml")
    assert not (cart / "cart.ran").exists()
    assert main(["diagnose", str(cart / "log.csv"), "--sim", str(cart / "sim.toml"), "--out", str(cart / "out")]) == 2
    assert not (cart / "cart.ran").exists()
    assert read_simulator(cart / "sim.toml", trust=True).states == ("x", "v")
    assert (cart / "cart.ran").exists()


def test_a_function_from_the_command_line_and_back(cart: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, sim, out = str(cart / "log.csv"), str(cart / "sim.toml"), cart / "out"
    assert main(["diagnose", log, "--sim", sim, "--trust", "--effects", FEW, "--out", str(out), "--json"]) == 0
    [cause] = json.loads(capsys.readouterr().out)["causes"]
    assert cause["effects"] == ["viscous_friction"] and cause["where"] == ["x"]
    assert cause["parameters"]["coefficient"]["value"] == pytest.approx(3.0, rel=0.03)
    assert cause["parameters"]["coefficient"]["unit"] == "N s/m"
    assert "Viscous friction at x" in (out / "report.html").read_text()
    # The corrected page is accepted again, and leaves the noise alone.
    for page, most in ((sim, np.inf), (str(out / "corrected.toml"), 1.2)):
        assert main(["evaluate", log, "--sim", page, "--trust", "--json"]) == 0
        equations = json.loads(capsys.readouterr().out)["equations"]
        equation, sensors = equations["x"], equations["v"]
        assert sensors["rmse"] < 1.2 * sensors["noise_floor"]  # they agree either way
        assert (equation["rmse"] > 20 * equation["noise_floor"]) == (most == np.inf)
        assert equation["rmse"] < most * equation["noise_floor"]


def test_an_effect_of_benches_alone_is_answered_with_its_names_at_ports(cart: Path, capsys) -> None:
    given = [str(cart / "log.csv"), "--sim", str(cart / "sim.toml"), "--trust", "--out", str(cart / "out")]
    assert main(["diagnose", *given, "--effects", "force_bias"]) == 2
    assert "Did you mean actuator_bias or sensor_bias?" in " ".join(capsys.readouterr().err.split())
    assert not (cart / "out").exists()


@pytest.mark.parametrize("mapped", [False, True])
def test_names_of_columns_mean_what_the_page_says(cart: Path, capsys: pytest.CaptureFixture[str], mapped: bool) -> None:
    """`u` is a valve command of a bench, and a force in newtons where a page says so: of a header or of a mapping."""
    header = "trajectory,time [ms],u [kN],x [mm],v [km/h]"
    table = pd.read_csv(cart / "log.csv")
    table[["time", "force", "x", "v"]] *= [1e3, 1e-3, 1e3, 3.6]
    table.to_csv(cart / "own.csv", index=False, header=header.split(","))
    (cart / "own.toml").write_text(PAGE.replace("force", "u"))
    columns = 'u = { column = "u [kN]", unit = "kN" }\nx = { column = "x [mm]", unit = "mm" }\n'
    columns += 'v = { column = "v [km/h]", unit = "km/h" }\ntime = { column = "time [ms]", unit = "ms" }\n'
    (cart / "columns.toml").write_text('[signals]\ntrajectory = { column = "trajectory" }\n' + columns)
    given, errors = ["--columns", str(cart / "columns.toml")] if mapped else [], []
    for log, sim, more in ((cart / "log.csv", "sim.toml", []), (cart / "own.csv", "own.toml", given)):
        assert main(["check", str(log), "--sim", str(cart / sim), *more, "--json", "--quiet"]) == 0
        capsys.readouterr()
        assert main(["evaluate", str(log), "--sim", str(cart / sim), *more, "--trust", "--json"]) == 0
        errors.append([e["rmse"] for e in json.loads(capsys.readouterr().out)["equations"].values()])
    assert errors[0] == pytest.approx(errors[1], rel=1e-6)


@pytest.mark.parametrize(
    ("page", "what"),
    [
        ('kind = "sofa"', "one of algebraic, control"),
        ('kind = "ode"\n[ode]\nfunction = 3', "text in quotes"),
        ('kind = "ode"\n[ode]\nfunction = "cart.py:rates"\n[ports]\nF = 3', "a table"),
        ('kind = "ode"\n[ode]\nfunction = "cart.py:rates"\n[ports]\nF = { kind = "input", colour = "red" }', "colour"),
        ('kind = "ode"\n[ode]\nfunction = "cart.py:nothing"', "nothing"),
        ('kind = "ode"\n[ode]\nfunction = "gone.py:rates"', "does not exist"),
        ('kind = "ode"\n[ode]\nfunction = "bad.py:f"', "SyntaxError"),
        ('kind = "ode"\n[ode]\nfunction = "exits.py:f"', "SystemExit"),
        ('kind = "ode"\n[ode]\nfunction = "cart.py:rates"\n[parameters]\nm = { tolerance = 1 }', "no value"),
        ('kind = "ode"\n[ode]\nfunction = "cart.py:rates"\n[[effects]]\neffect = "sofa"', "sofa"),
        ('kind = "ode"\n[ode]\nfunction = "cart.py:rates"\n[[effects]]\neffect = "viscous_friction"', "no port"),
        ('kind = "ode"\nextra = 1', "extra"),
        ('kind = "mujoco"\n[mujoco]\nmodel = "gone.xml"', "does not exist"),
        ('kind = "mujoco"\n[mujoco]\nmodel = "bad.py"', "not valid MJCF"),
        ('kind = "fmu"\n[fmu]\nfmu = "bad.py"', "not an FMU"),
        ('kind = "control"\n[control]\nsystem = "cart.py:rates"', "rates"),
        ("kind = [", "TOML"),
    ],
)
def test_a_page_that_cannot_be_says_why(cart: Path, page: str, what: str) -> None:
    (cart / "bad.py").write_text("def f(:")
    (cart / "exits.py").write_text("raise SystemExit(0)")
    (cart / "page.toml").write_text(page)
    with pytest.raises((PamidError, TypeError), match=what):
        read_simulator(cart / "page.toml", trust=True)


def test_a_mujoco_model_has_ports_and_comes_back_as_mjcf(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    (tmp_path / "arm.xml").write_text(ARM)
    arm = MujocoSimulator(tmp_path / "arm.xml", parameters={"body_mass.arm": (0.5, 0.05, "kg")})
    assert arm.inputs == ("motor", "hinge_tau") and arm.states == ("hinge_q", "hinge_dq")
    own = MujocoSimulator(tmp_path / "arm.xml").own_numbers()
    assert (own["body_mass.arm"].unit, own["actuator_gear.motor"].unit) == ("kg", "-")  # a gear is a ratio
    x, u, p = np.array([[0.3], [1.0]]), np.array([[0.2], [0.0]]), arm.numbers[:, None]
    free = arm.rate(np.zeros(1), x, u, p)[1, 0]
    # Torque over inertia is what a torque adds to the acceleration.
    pushed = arm.rate(np.zeros(1), x, u + np.array([[0.0], [0.1]]), p)[1, 0]
    assert (pushed - free) * arm.inertia(x)[0, 0, 0] == pytest.approx(0.1)
    damped = arm.with_({"body_mass.arm": 0.6}, [("viscous_friction", "hinge", {"coefficient": 0.05}),
                                               ("actuator_lag", "motor", {"time_constant": 0.01})])  # fmt: skip
    text, rest = damped.corrected_xml()
    (tmp_path / "corrected.xml").write_text(text)
    again = MujocoSimulator(tmp_path / "corrected.xml")
    slowed = again.rate(np.zeros(1), x, u, np.zeros((0, 1)))[1, 0]
    heavier = arm.rate(np.zeros(1), x, u - np.array([[0.0], [0.05]]), np.array([[0.6]]))[1, 0]
    assert slowed == pytest.approx(heavier, rel=1e-3)
    assert [name for name, *_ in rest] == ["actuator_lag"]
    (tmp_path / "sim.toml").write_text(page_text(arm, tmp_path))
    assert read_simulator(tmp_path / "sim.toml").parameters == arm.parameters


def test_a_control_system_is_simulated_where_its_states_are_not_logged() -> None:
    control = pytest.importorskip("control")
    motor = ControlSimulator(control.tf([2.0], [0.1, 1.0], inputs="voltage", outputs="speed"))
    x, u = np.ones((1, 3)), np.full((1, 3), 0.5)
    assert np.allclose(motor.rate(np.zeros(3), x, u, np.zeros((0, 3))), -10.0 + 0.5 * motor.B[0, 0])
    stepped = ControlSimulator(control.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], 0.1))
    y = stepped.run(np.arange(4) * 0.1, np.ones((1, 4)), np.zeros(0), np.zeros(1))
    assert np.allclose(y, [[0.0, 1.0, 1.5, 1.75]])


# --- FMUs ---------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def muscle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An FMU made by the project's own exporter: the force of a muscle."""
    pytest.importorskip("fmpy")
    if not any(shutil.which(c) for c in ("cc", "gcc", "clang")):
        pytest.skip("there is no C compiler")
    from pamid.estimators import StaticPIHM

    from pamid.export import export

    rng = np.random.default_rng(0)
    X = pd.DataFrame({"eps": rng.uniform(0, 0.25, 200), "deps": 0.0, "P": rng.uniform(1.5e5, 5e5, 200), "dP": 0.0})
    model = StaticPIHM(rest_length=0.2, rest_diameter=0.02, hidden_layer_sizes=(4,), max_iter=2, random_state=0)
    path = tmp_path_factory.mktemp("fmu")
    return next(p for p in export(model.fit(X, 1e-3 * (X["P"] - 101325)), path, "fmu") if p.suffix == ".fmu")


def test_an_fmu_runs_in_a_process_of_its_own_and_only_where_trusted(muscle: Path) -> None:
    fmu = FmuSimulator(muscle)
    assert "eps" in fmu.inputs and "force" in fmu.outputs
    t = np.arange(0, 1, 0.01)
    u = np.tile(np.array([[0.1], [0.0], [3e5], [0.0]])[: len(fmu.inputs)], (1, len(t)))
    with pytest.raises(UntrustedCodeError):
        fmu.run(t, u, np.zeros(0), np.zeros(0))
    trusted = FmuSimulator(muscle, trust=True)
    y = trusted.run(t, u, np.zeros(0), np.zeros(0))
    assert y.shape == (len(trusted.outputs), len(t)) and np.isfinite(y).all()
    # It may have died; the next run has a process of its own.
    trusted._workers[0]._process.kill()
    trusted._workers[0]._process.wait()
    assert np.array_equal(trusted.run(t, u, np.zeros(0), np.zeros(0)), y)


@pytest.mark.parametrize(
    ("does", "what", "seconds"),
    # A crash is told as soon as it is there, however late a busy machine comes to it.
    [("import os; os._exit(3)", "ended its process", 60.0), ("import time; time.sleep(99)", "within 1 s", 1.0)],
)
def test_a_crash_or_a_hang_of_an_fmu_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, does: str, what: str, seconds: float
) -> None:
    from pamid.simulators import fmu_model

    worker, pipe = fmu_model._Worker(tmp_path / "tanks.fmu", seconds), subprocess.PIPE
    process = subprocess.Popen([sys.executable, "-c", does], stdin=pipe, stdout=pipe)
    monkeypatch.setattr(fmu_model, "_LOADING", 0.0)
    monkeypatch.setattr(worker, "_started", lambda: process)
    worker._process = process
    with pytest.raises(ForeignSimulatorError, match=what):
        worker.asked({"do": "run"}, {})
    assert process.poll() is not None


def test_an_fmu_gets_no_more_memory_than_its_limit(muscle: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from pamid.simulators import fmu_model

    code = "from pamid.simulators.fmu_worker import limited; limited(2**29); bytearray(2**30)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert found.returncode == 1 and "MemoryError" in found.stderr
    monkeypatch.setattr(fmu_model, "BYTES", 2**26)  # less than Python and numpy need: what fails there is told
    with pytest.raises(PamidError, match=r"failed to map|ended its process|MemoryError"):
        FmuSimulator(muscle, trust=True)


def test_an_fmu_is_diagnosed_by_its_runs(muscle: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rng, fmu, runs = np.random.default_rng(0), FmuSimulator(muscle, trust=True), []
    for k in range(3):
        t = np.arange(0, 4, 0.01)
        eps, P = 0.1 + 0.05 * np.sin((1 + k) * t), 3e5 + 1e5 * np.sin(1.7 * t + k)
        u = {"eps": eps, "deps": np.gradient(eps, t), "P": P, "dP": np.gradient(P, t)}
        y = fmu.run(t, np.stack([u[n] for n in fmu.inputs]), np.zeros(0), np.zeros(0))
        F = 1.06 * dict(zip(fmu.outputs, y, strict=True))["force"] + 0.2 * rng.standard_normal(len(t))
        runs.append(pd.DataFrame({"trajectory": f"r{k}", "time": t, **u, "force": F}))
    log, out = muscle.parent / "log.csv", muscle.parent / "out"
    pd.concat(runs).to_csv(log, index=False)
    few = "sensor_gain,sensor_bias,sensor_lag"
    command = ["diagnose", str(log), "--sim", str(muscle), "--effects", few, "--out", str(out), "--json"]
    assert main(command) == 2 and "--trust" in capsys.readouterr().err
    assert main([*command, "--trust"]) == 0
    [cause] = json.loads(capsys.readouterr().out)["causes"]
    assert (cause["effects"], cause["where"]) == (["sensor_gain"], ["force"])
    assert cause["parameters"]["deviation"]["value"] == pytest.approx(0.06, abs=0.005)
    assert main(["evaluate", str(log), "--sim", str(out / "corrected.toml"), "--trust", "--json"]) == 0
    [equation] = json.loads(capsys.readouterr().out)["equations"].values()
    assert equation["rmse"] < 1.2 * equation["noise_floor"]


def test_what_is_no_fmu_is_an_error_of_the_file(tmp_path: Path) -> None:
    pytest.importorskip("fmpy")
    (tmp_path / "bad.fmu").write_bytes(b"PK\x03\x04 no archive")
    with pytest.raises(SimulatorSyntaxError, match="not an FMU"):
        FmuSimulator(tmp_path / "bad.fmu")


def test_messages_to_the_process_carry_numbers_and_no_objects(tmp_path: Path) -> None:
    with (tmp_path / "pipe").open("wb") as stream:
        send(stream, {"do": "run"}, {"t": np.arange(3.0)})
    with (tmp_path / "pipe").open("rb") as stream:
        said, arrays = receive(stream)
        assert said == {"do": "run"} and np.array_equal(arrays["t"], [0, 1, 2])
        assert receive(stream) is None


def test_init_writes_the_page_of_a_model(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("mujoco")
    (tmp_path / "arm.xml").write_text(ARM)
    t = np.arange(0, 2, 0.01)
    pd.DataFrame({"time": t, "Motor": np.sin(t), "hinge q": np.cos(t)}).to_csv(tmp_path / "log.csv", index=False)
    command = ["init", str(tmp_path / "log.csv"), "--sim", str(tmp_path / "arm.xml"), "--out", str(tmp_path / "set")]
    assert main([*command, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["columns"] == {"motor": "Motor", "hinge_q": "hinge q"} and said["without_column"] == ["hinge_dq"]
    page = tmp_path / "set" / "sim.toml"
    assert page.read_text().count("ASSUMED") == 2
    read = read_simulator(page)
    assert read.port("hinge_q").column == "hinge q" and read.parameters["body_mass.arm"].value == 0.5
    assert main(command) == 2 and "--force" in capsys.readouterr().err


def test_init_of_an_fmu_takes_units_from_headers_and_says_what_must_be_trusted(
    muscle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    t, log, out = np.arange(0, 2, 0.01), tmp_path / "log.csv", tmp_path / "set"
    table = {"t [ms]": 1e3 * t, "eps": 0.1 + 0.01 * t, "deps": 0.01 + 0 * t, "P [bar]": 3.0 + t, "dP": 1e5 + 0 * t}
    pd.DataFrame({**table, "Force [kN]": 0.1 + 0.02 * np.sin(t)}).to_csv(log, index=False)
    assert main(["init", str(log), "--sim", str(muscle), "--out", str(out), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    columns = {name: (entry["column"], entry.get("unit")) for name, entry in said["signals"].items()}
    assert columns["force"] == ("Force [kN]", "kN") and columns["P"] == ("P [bar]", "bar")
    assert columns["time"] == ("t [ms]", "ms") and " --trust" in said["next"]
    options = ["--columns", str(out / "columns.toml"), "--sim", str(out / "sim.toml")]
    assert main(["check", str(log), *options]) == 0
    assert "--trust --out diagnosis" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("kind", "code"),
    [
        ("run", "def f(u, p, x0):\n    return 2.0 * u['F']\n"),
        ("algebraic", "def f(u, p):\n    return 2.0 * u['F']\n"),
    ],
)
def test_the_form_of_a_function_may_name_its_kind(tmp_path, kind, code):
    (tmp_path / "f.py").write_text(code)
    ports = '[ports]\nF = { kind = "input", unit = "N" }\nx = { kind = "output", unit = "m" }\n'
    (tmp_path / "sim.toml").write_text(f'kind = "{kind}"\n[{kind}]\nfunction = "f.py:f"\n{ports}')
    found = read_simulator(tmp_path / "sim.toml", trust=True)
    assert found.form == kind
    (tmp_path / "again.toml").write_text(page_text(found, tmp_path))
    assert read_simulator(tmp_path / "again.toml", trust=True).form == kind


def test_an_unknown_kind_is_told_with_all_of_them(tmp_path):
    import pamid

    (tmp_path / "sim.toml").write_text('kind = "gripper"\n')
    with pytest.raises(UnknownOptionError, match=r"bench.*cylinder.*function.*run"):
        pamid.read_simulator(tmp_path / "sim.toml")
