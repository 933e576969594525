"""Equations as a simulator: written on the command line, compared with a log, corrected; they are data and no code."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

from pamid.cli import main
from pamid.errors import MissingParameterError, ParameterError, SimulatorRunError
from pamid.simulators import EquationSimulator, Port, page_text, read_simulator
from pamid.simulators.equation_model import names_in, sides
from pamid.simulators.equation_units import completed

FALL = ["--equation", "dh/dt = v", "--equation", "dv/dt = -g", "--set", "g=9.81 m/s2 ± 0.1 %"]


@pytest.fixture
def drops(tmp_path):
    """A body that falls against linear drag, 0.3 of its speed a second, four times from other heights."""
    rng, rows = np.random.default_rng(0), []
    for k in range(4):
        t = np.arange(0, 2.5, 0.02)
        fade = 9.81 / 0.3
        start = 0.5 * k
        v = -fade + (fade - start) * np.exp(-0.3 * t)
        h = 50 + 3 * k - fade * t + (fade - start) / 0.3 * (1 - np.exp(-0.3 * t))
        h, v = h + 1e-3 * rng.standard_normal(len(t)), v + 1e-2 * rng.standard_normal(len(t))
        rows.append(pd.DataFrame({"drop": k, "time": t, "height [mm]": 1e3 * h, "v": v}))
    pd.concat(rows).to_csv(tmp_path / "drops.csv", index=False)
    return tmp_path


def setup(folder, *more: str) -> list[str]:
    return ["init", str(folder / "drops.csv"), *FALL, "--out", str(folder / "setup"), *more]


def test_from_raw_file_to_diagnosis_without_an_edit(drops, capsys):
    signals = ["--signal", "h=height [mm]", "--signal", "v=v:m/s"]
    assert main(setup(drops, *signals, "--json")) == 0
    found = json.loads(capsys.readouterr().out)
    assert len(found["trajectories"]) == 4
    assert found["signals"]["h"]["unit"] == "mm"
    page = (drops / "setup" / "sim.toml").read_text()
    assert 'h = { kind = "state", unit = "m" }' in page
    assert "tolerance = 0.001" in page
    command = found["next"].split()
    assert command[:2] == ["pamid", "diagnose"]
    assert main(["check", *command[2:7], "--json", "--quiet"]) == 0
    looked = json.loads(capsys.readouterr().out)
    assert looked["sampling"]["runs"] == 4
    assert not any("lacks" in a["why"] for a in looked["answers"])
    assert not any("mass flow" in text for text in looked["record"])
    out = str(drops / "diagnosis")
    argv = [*command[1:-1], out, "--effects", "viscous_friction,quadratic_drag,sensor_bias", "--json", "--quiet"]
    assert main(argv) == 0
    answer = json.loads(capsys.readouterr().out)
    (cause,) = answer["causes"]
    assert "viscous_friction" in cause["effects"]
    assert main(["evaluate", *command[2:5], "--sim", f"{out}/corrected.toml", "--json"]) == 0
    corrected = list(json.loads(capsys.readouterr().out)["equations"].values())
    assert corrected
    assert all(e["rmse"] < 1.5 * e["noise_floor"] for e in corrected)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--equation", "dw/dt = -k*w + u_in"], "k (input), u_in (input): in the equations"),
        (["--set", "m=3"], "--set gives m, which no equation names"),
        (["--equation", "y = __import__('os').system('x')"], "is not an equation|holds"),
        (["--equation", "y = h.real"], "holds 'h.real'"),
        (["--equation", "2y = h"], "is not valid"),
        (["--equation", "h"], "Expected LEFT = RIGHT"),
        (["--kind", "cylinder"], "one of them"),
    ],
)
def test_what_is_wrong_is_said(more, said, drops, capsys):
    assert main(setup(drops, "--signal", "h=height [mm]", "--signal", "v=v:m/s", *more)) == 2
    error = capsys.readouterr().err
    assert any(words in error for words in said.split("|")), error
    assert not (drops / "setup").exists()


def test_a_rate_that_is_not_logged_has_the_unit_of_a_rate(drops, capsys):
    equations = ["--equation", "dh/dt = speed", "--equation", "dspeed/dt = -g", "--set", "g=9.81 m/s2"]
    out = ["--signal", "h=height [mm]", "--out", str(drops / "setup")]
    assert main(["init", str(drops / "drops.csv"), *equations, *out]) == 0
    assert read_simulator(drops / "setup" / "sim.toml").port("speed").unit == "m/s"


def test_a_state_that_is_not_logged_has_the_unit_of_what_it_is_subtracted_from():
    """Only ends of one unit are coupled, so that nothing between a motor and a load without one would be asked for."""
    equations = {
        "da/dt": "va", "dva/dt": "(torque - k*(a - b))/J", "db/dt": "vb", "dvb/dt": "k*(a - b)/M", "dz/dt": "ref - a",
        "shown": "2*b",
    }  # fmt: skip
    rates, outputs = sides(equations)
    units = {"a": "rad", "torque": "", "ref": "", "shown": ""} | dict.fromkeys(("va", "b", "vb", "z"), "")
    found = {"a": "rad", "va": "rad/s", "b": "rad", "vb": "rad/s", "z": "rad s"}
    assert completed(units, rates, outputs.values()) == units | found


def test_an_algebraic_model_and_its_page(tmp_path):
    ports = [Port("P", "input", "Pa"), Port("F", "output", "N")]
    piston = EquationSimulator({"F": "A*max(P - 1e5, 0) + 2^0.5"}, ports, {"A": (5e-4, 0.02, "m2")})
    assert piston.form == "algebraic"
    (tmp_path / "sim.toml").write_text(page_text(piston))
    again = read_simulator(tmp_path / "sim.toml")  # without trust
    u = np.array([[1e5, 2e5, 5e4]])
    found = again.output(np.zeros(3), np.zeros((0, 3)), u, np.full((1, 3), 5e-4))
    assert found == pytest.approx(np.array([[0, 50, 0]]) + 2**0.5)


def test_nothing_but_arithmetic_runs():
    assert names_in("-k*sqrt(abs(h)) + pi*t") == {"k", "h", "t"}
    for text in ("().__class__", "[1]", "lambda: 1", "h if h else 0", "'a'*9", "sqrt(h, h)", "open(h)", "h" * 3000):
        with pytest.raises(ParameterError):
            names_in(text)
    with pytest.raises(MissingParameterError, match="dv/dt has no equation"):
        EquationSimulator({"dh/dt": "v"}, [Port("h", "state", "m"), Port("v", "state", "m/s")])
    with pytest.raises(ParameterError, match="uses g"):
        EquationSimulator({"dv/dt": "-g"}, [Port("v", "state", "m/s")])
    huge = EquationSimulator({"dv/dt": "9**9**9"}, [Port("v", "state", "m/s")])
    with pytest.raises(SimulatorRunError, match="OverflowError"):
        huge.rate(np.zeros(1), np.zeros((1, 1)), np.zeros((0, 1)), np.zeros((0, 1)))


def test_a_log_without_a_clock_and_a_state_that_is_not_logged(tmp_path, capsys):
    rng = np.random.default_rng(0)
    pump = 2 + np.sin(np.arange(400) / 20)
    level = np.zeros(400)
    for k in range(399):
        level[k + 1] = level[k] + 4 * (0.05 * pump[k] - 0.04 * level[k])
    table = pd.DataFrame({"pump": pump, "y": level + 1e-3 * rng.standard_normal(400)})
    table.to_csv(tmp_path / "tank.csv", index=False)
    argv = ["init", str(tmp_path / "tank.csv"), "--equation", "dlevel/dt = k*pump - c*level", "--equation", "y = level"]
    argv += ["--set", "k=0.05 ± 10 %", "--set", "c=0.04 1/s", "--set", "level=0.1 V", "--out", str(tmp_path / "s")]
    assert main(argv) == 2
    assert "--constant sampling_period=" in capsys.readouterr().err
    assert main([*argv, "--constant", "sampling_period=4 s"]) == 0
    simulator = read_simulator(tmp_path / "s" / "sim.toml")
    assert simulator.port("level").start == 0.1
    assert simulator.outputs == ("y",)
    assert simulator.parameters["c"].unit == "1/s"
    assert 'sampling_period = "4 s"' in (tmp_path / "s" / "columns.toml").read_text()
    page = ["--columns", str(tmp_path / "s" / "columns.toml"), "--sim", str(tmp_path / "s" / "sim.toml")]
    capsys.readouterr()
    assert main(["evaluate", str(tmp_path / "tank.csv"), *page, "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)["equations"].values()
    assert found["nrmse"] < 0.05


@pytest.fixture
def axis(tmp_path):
    """A driven axis of 2 kg with 3 N of dry and 4 N s/m of viscous friction, 0.1 N aside, which stops between moves."""
    rows, rng, dt = [], np.random.default_rng(0), 0.005
    for k in range(5):
        wanted = np.cumsum(rng.uniform(-0.3, 0.3, 5))
        x = v = 0.0
        log = []
        for i in range(1000):
            ahead = wanted[i // 200]
            force = float(np.clip(60.0 * (ahead - x) - 12.0 * v, -12.0, 12.0))
            log.append((k, i * dt, x + 1e-6 * rng.standard_normal(), force))
            for _ in range(20):
                free = force + 0.1 - 4.0 * v
                if v == 0.0 and abs(free) <= 3.0:
                    break
                way = np.sign(v) or np.sign(free)
                new = v + (free - 3.0 * way) / 2.0 * dt / 20
                v = 0.0 if new * v < 0.0 else new
                x += v * dt / 20
        rows.append(pd.DataFrame(log, columns=["run", "time", "x", "force"]))
    pd.concat(rows).to_csv(tmp_path / "axis.csv", index=False)
    return tmp_path


def test_dry_friction_of_an_axis_that_stops_is_no_dead_zone_of_its_drive(axis, capsys):
    log, page = str(axis / "axis.csv"), axis / "setup"
    equations = ["--equation", "dx/dt = v", "--equation", "dv/dt = force/m", "--set", "m=2 kg"]
    signals = ["--signal", "x=x:m", "--signal", "force=force:N", "--signal", "trajectory=run"]
    assert main(["init", log, *equations, *signals, "--yes", "--out", str(page), "--quiet"]) == 0
    library = "coulomb_friction,viscous_friction,actuator_dead_zone,actuator_gain"
    files = ["--columns", str(page / "columns.toml"), "--sim", str(page / "sim.toml"), "--out", str(axis / "diagnosis")]
    capsys.readouterr()
    assert main(["diagnose", log, *files, "--effects", library, "--json", "--quiet"]) == 0
    answer = json.loads(capsys.readouterr().out)
    found = {cause["effects"][0]: cause["parameters"] for cause in answer["causes"]}
    assert found["coulomb_friction"]["amplitude"]["value"] == pytest.approx(3.0, rel=0.05)
    assert found["viscous_friction"]["coefficient"]["value"] == pytest.approx(4.0, rel=0.05)
    assert found["viscous_friction"]["coefficient"]["unit"] == "N s/m"
    assert any("x rests in" in note for note in answer["notes"])


@pytest.fixture
def spring(tmp_path):
    """A mass on a spring that hardens, shaken; its force is called u, as the valve's command is elsewhere."""
    rng, dt, rows = np.random.default_rng(0), 0.002, []
    for k in range(4):
        t = np.arange(2000) * dt
        force = sum(
            20.0 * np.sin(2 * np.pi * f * t + a) for f, a in zip(range(2, 30), rng.uniform(0, 6, 28), strict=True)
        )
        y = v = 0.0
        log = []
        for i, u in enumerate(force):
            log.append((k, i * dt, y + 1e-6 * rng.standard_normal(), u))
            for _ in range(10):
                v += dt / 10 * (u - 10.0 * v - 2e4 * y - 4e8 * y**3) / 2.0
                y += dt / 10 * v
        rows.append(pd.DataFrame(log, columns=["run", "time", "y", "u"]))
    pd.concat(rows).to_csv(tmp_path / "spring.csv", index=False)
    return tmp_path


def test_names_of_equations_mean_what_they_say_and_a_hardening_spring_is_named(spring, capsys):
    log, page = str(spring / "spring.csv"), spring / "setup"
    equations = ["--equation", "dy/dt = v", "--equation", "dv/dt = (u - c*v - k*y)/m"]
    numbers = ["--set", "m=2 kg", "--set", "c=10 N s/m", "--set", "k=2e4 N/m ± 5 %"]
    signals = ["--signal", "y=y:m", "--signal", "u=u:N", "--signal", "trajectory=run"]
    assert main(["init", log, *equations, *numbers, *signals, "--yes", "--out", str(page), "--quiet"]) == 0
    assert 'u = { column = "u", unit = "N", own = true }' in (page / "columns.toml").read_text()
    files = [
        "--columns",
        str(page / "columns.toml"),
        "--sim",
        str(page / "sim.toml"),
        "--out",
        str(spring / "diagnosis"),
    ]
    capsys.readouterr()
    library = "nonlinear_stiffness,viscous_friction,hysteresis,actuator_saturation"
    assert main(["diagnose", log, *files, "--effects", library, "--json", "--quiet"]) == 0
    [cause] = json.loads(capsys.readouterr().out)["causes"]
    assert cause["effects"] == ["nonlinear_stiffness"]
    assert cause["parameters"]["cubic"]["value"] == pytest.approx(4e8, rel=0.05)
    assert cause["parameters"]["cubic"]["unit"] == "N/m^3"
