"""``pamid init LOG --sim MODEL``: which columns are the ports, and in which unit, for logs in robots' own names."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.cli import main
from pamid.signals.headers import read_header
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.matching import matches

JOINTS = ("shoulder_pan", "elbow", "wrist_1")
ARM = """
<mujoco><compiler angle="radian" autolimits="true"/><worldbody>
<body><joint name="{0}_joint" axis="0 0 1" range="-2.9 2.9"/><geom size="0.05" pos="0.1 0 0"/>
<body pos="0.2 0 0"><joint name="{1}_joint" axis="0 1 0" range="-2.2 2.2"/><geom size="0.04" pos="0.1 0 0"/>
<body pos="0.2 0 0"><joint name="{2}_joint" axis="0 1 0" range="-1.7 1.7"/><geom size="0.03" pos="0.1 0 0"/>
</body></body></body></worldbody>
<actuator><position name="{0}" joint="{0}_joint" kp="50"/><position name="{1}" joint="{1}_joint" kp="50"/>
<position name="{2}" joint="{2}_joint" kp="50"/></actuator></mujoco>
""".format(*JOINTS)

STYLES = {
    "lerobot": ("action.{name}.pos", "observation.state.{name}.pos", None),
    "lerobot arrays": ("action_{k}", "observation.state_{k}", None),
    "rtde": ("target_q_{k}", "actual_q_{k}", "actual_qd_{k}"),
    "unitree": ("{short}_q_des", "{short}_q", "{short}_dq"),
    "ros": ("/command/{name}", "/joint_states/{name}_joint/position", "/joint_states/{name}_joint/velocity"),
    "ros arrays": ("command[{k}]", "position[{k}]", "velocity[{k}]"),
    "isaac": ("dof_pos_target_{k}", "dof_pos_{k}", "dof_vel_{k}"),
    "franka": ("q_d_{one}", "q_{one}", "dq_{one}"),
    "camel": ("{camel}PositionCmd", "{camel}Position", "{camel}Velocity"),
    "shared words": ("control_command.q[{k}]", "control_data.q[{k}]", "control_data.qd[{k}]"),
    "two roles": ("feedback.desired.{name}", "feedback.actual.{name}", "feedback.actual.{name}.velocity"),
    "setpoints": ("ref {name}", "{name} angle", "{name} speed"),
}


def motion(k: int, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return command, angle, rad, and speed, rad/s, of a joint."""
    w = 1.0 + 0.7 * k
    command = 0.3 * (k + 1) / 2 + 0.6 * np.sin(w * t) + 0.2 * np.sin(2.3 * w * t + k)
    angle = 0.3 * (k + 1) / 2 + 0.6 * np.sin(w * t - 0.1) + 0.2 * np.sin(2.3 * w * t + k - 0.2)
    speed = 0.6 * w * np.cos(w * t - 0.1) + 0.46 * w * np.cos(2.3 * w * t + k - 0.2)
    return command, angle, speed


def recorded(style: str, unit: float = 1.0) -> tuple[pd.DataFrame, dict[str, str]]:
    """Return a log in a style of names, its columns shuffled with others, and the column of each port."""
    rng, t = np.random.default_rng(4), np.arange(0.0, 8.0, 0.01)
    table, truth = {}, {}
    for k, name in enumerate(JOINTS):
        camel = "".join(part.title() for part in name.split("_"))
        words = {"name": name, "short": name.split("_")[0], "camel": camel, "k": k, "one": k + 1}
        ports = (name, f"{name}_joint_q", f"{name}_joint_dq")
        for form, port, channel in zip(STYLES[style], ports, motion(k, t), strict=True):
            if form is not None:
                truth[port] = form.format(**words)
                table[truth[port]] = unit * channel + 1e-4 * rng.standard_normal(len(t))
    others = {
        "temperature": 40 + 0 * t,
        "battery_V": 24 + 0.1 * rng.standard_normal(len(t)),
        "frame_index": np.arange(800),
    }
    names = [*table, *others]
    rng.shuffle(names)
    frame = pd.DataFrame({"timestamp": 1.7e9 + t} | {n: {**table, **others}[n] for n in names})
    return frame, truth


def test_names_of_the_elements_of_a_list_are_no_units(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    from pamid.simulators import MujocoSimulator

    (tmp_path / "arm.xml").write_text(ARM)
    arm, t = MujocoSimulator(tmp_path / "arm.xml"), np.arange(0.0, 8.0, 0.01)
    frame = {}
    for k, name in enumerate(JOINTS):
        frame[f"action[{name}.pos]"], frame[f"observation.state[{name}.pos]"], _ = motion(k, t)
    found, doubts = matches(arm, arm.ports, frame, t)
    assert not doubts and {m.port: m.column for m in found}["elbow_joint_q"] == "observation.state[elbow.pos]"


def drafted(folder: Path, frame: pd.DataFrame, capsys: pytest.CaptureFixture[str], *more: str) -> dict:
    pytest.importorskip("mujoco")
    (folder / "arm.xml").write_text(ARM)
    frame.to_csv(folder / "log.csv", index=False)
    log, sim, out = (str(folder / name) for name in ("log.csv", "arm.xml", "setup"))
    assert main(["init", log, "--sim", sim, "--yes", "--out", out, "--force", "--json", *more]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("style", STYLES)
def test_columns_in_robots_own_names_are_found_and_marked(
    style: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    frame, truth = recorded(style)
    said = drafted(tmp_path, frame, capsys)
    found = {port: entry["column"] for port, entry in said["signals"].items() if port != "time"}
    assert found == truth
    assert set(said["assumed"]["signals"]) == {port for port, column in truth.items() if port != column}
    assert "missing" not in said and said["next"].startswith("pamid diagnose")


@pytest.mark.parametrize("style", ["lerobot", "rtde", "unitree"])
def test_degrees_are_told_by_the_ranges_of_joints_and_rates_by_their_positions(
    style: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    frame, truth = recorded(style, unit=180.0 / np.pi)
    said = drafted(tmp_path, frame, capsys)
    for port, column in truth.items():
        unit = "deg/s" if port.endswith("_dq") else "deg"
        assert (said["signals"][port]["column"], said["signals"][port]["unit"]) == (column, unit)
        assert "ASSUMED" in said["assumed"]["signals"][port]


def test_what_the_log_lacks_is_said_instead_of_a_command_that_fails(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    frame, _ = recorded("rtde")
    frame = frame.drop(columns=[c for c in frame if c.startswith("target")])
    said = drafted(tmp_path, frame, capsys)
    assert said["next"] == "" and len(said["missing"]) == 3
    assert "--signal elbow=COLUMN:rad" in said["missing"][1] and "tau" not in "".join(said["missing"])


def test_a_reading_that_contradicts_its_position_is_doubtful(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    frame, _ = recorded("rtde")
    frame["actual_qd_1"] *= 3.0
    said = drafted(tmp_path, frame, capsys)
    assert "DOUBTFUL" in said["assumed"]["signals"]["elbow_joint_dq"]
    assert "DOUBTFUL" not in said["assumed"]["signals"]["shoulder_pan_joint_dq"]
    frame["actual_qd_0"] *= 0.85
    said = drafted(tmp_path, frame, capsys)
    assert "0.85 times the derivative of actual_q_0 in rad/s" in said["assumed"]["signals"]["shoulder_pan_joint_dq"]


def test_columns_that_say_nothing_stay_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    t, rng = np.arange(0.0, 8.0, 0.01), np.random.default_rng(1)
    frame = pd.DataFrame({"time": t, "lidar": rng.random(800), "elbow_temperature": 40 + t, "vbus": 24 - t})
    said = drafted(tmp_path, frame, capsys)
    assert set(said["signals"]) == {"time"} and said["next"] == ""


MOTOR = """
kind = "ode"
[ode]
function = "motor.py:rates"
[ports]
u = { kind = "input", unit = "V", column = "drive signal" }
angle = { kind = "state", unit = "rad" }
w_m = { kind = "state", unit = "rad/s" }
motor = { kind = "joint", unit = "V", position = "angle", velocity = "w_m", through = "u" }
[parameters]
k = { value = 1.0, tolerance = 0.1 }
"""


def motor(folder: Path, table: dict[str, np.ndarray]) -> list[str]:
    (folder / "motor.py").write_text("raise SystemExit('this must not run')\n")
    (folder / "motor.toml").write_text(MOTOR)
    pd.DataFrame(table).to_csv(folder / "log.csv", index=False)
    paths = [str(folder / "log.csv"), "--sim", str(folder / "motor.toml"), "--out", str(folder / "setup")]
    return ["init", *paths, "--yes", "--json"]


def test_a_page_of_code_is_read_without_running_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    t = np.arange(0.0, 5.0, 0.01)
    table = {"time": t, "drive signal": np.cos(t), "angle [deg]": np.degrees(np.sin(t)), "w_m": np.cos(t)}
    assert main(motor(tmp_path, table)) == 0
    said = json.loads(capsys.readouterr().out)
    signals = {name: (entry["column"], entry.get("unit")) for name, entry in said["signals"].items()}
    assert signals["angle"] == ("angle [deg]", "deg") and signals["w_m"][0] == "w_m"
    assert "motor.toml" in said["next"] and "--trust" in said["next"]
    assert "--signal" not in said["next"] and "signals" not in said["assumed"]


def test_a_control_system_is_drafted_without_running_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "lag.py").write_text("raise SystemExit('this must not run')\n")
    (tmp_path / "lag.toml").write_text(
        'kind = "control"\n[control]\nsystem = "lag.py:system"\n[ports]\nvolt = { kind = "input", unit = "V" }\n'
        'speed = { kind = "output", unit = "rad/s" }\n'
    )
    t = np.arange(0.0, 5.0, 0.01)
    table = {"t [s]": t, "Spannung [V]": np.sin(3 * t), "Drehzahl [1/min]": 9.5493 * np.cos(t)}
    pd.DataFrame(table).to_csv(tmp_path / "log.csv", index=False)
    paths = [str(tmp_path / "log.csv"), "--sim", str(tmp_path / "lag.toml"), "--out", str(tmp_path / "setup")]
    assert main(["init", *paths, "--yes", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    signals = {name: (entry["column"], entry.get("unit")) for name, entry in said["signals"].items()}
    assert signals["volt"] == ("Spannung [V]", "V") and signals["speed"] == ("Drehzahl [1/min]", "rpm")
    assert "lag.toml" in said["next"] and "--trust" in said["next"]


def test_a_unit_of_something_else_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    t = np.arange(0.0, 5.0, 0.01)
    table = {"time": t, "u [%]": 100 * np.cos(t), "angle": np.sin(t), "w_m [rpm]": 9.5493 * np.cos(t)}
    command = motor(tmp_path, table)
    (tmp_path / "motor.toml").write_text(MOTOR.replace(', column = "drive signal"', ""))
    assert main(command) == 0
    said = json.loads(capsys.readouterr().out)
    assert "u" not in said["signals"] and said["signals"]["w_m"]["unit"] == "rpm"
    assert "u [%] is in %, the port in V" in said["missing"][0]
    assert main([*command, "--force", "--signal", "u=u [%]"]) == 2
    assert "--signal 'u=u [%]*FACTOR'" in capsys.readouterr().err


def test_a_function_without_a_page_is_answered_with_the_page_to_write(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    t = np.arange(0.0, 5.0, 0.01)
    command = motor(tmp_path, {"time": t, "x": np.sin(t)})
    (tmp_path / "motor.py").write_text("def rates(t, x, u, p): ...\nraise SystemExit('this must not run')\n")
    command[command.index("--sim") + 1] = str(tmp_path / "motor.py") + ":rates"
    assert main(command) == 2
    assert '[ode] function = "motor.py:rates"' in " ".join(capsys.readouterr().err.split())


def test_a_rate_without_a_unit_has_that_of_its_positions_derivative() -> None:
    ports = [
        Port("volt", "input", "V"), Port("q", "state", "rad"), Port("dq", "state", "rad/s"),
        Port("shaft", "joint", "V", position="q", velocity="dq", through="volt"),
    ]  # fmt: skip
    simulator = FunctionSimulator(lambda t, x, u, p: [x.dq, u.volt], ports)
    t = np.linspace(0.0, 5.0, 500)
    rng = np.random.default_rng(0)
    for unit, factor in (("rad/s", 1.0), ("deg/s", 180 / np.pi), ("rpm", 30 / np.pi)):
        frame = {"dq": factor * (np.cos(t) + 0.05 * rng.standard_normal(500)), "volt": np.cos(3 * t), "q": np.sin(t)}
        found, doubts = matches(simulator, ports[:3], frame, t)
        match = next(m for m in found if m.port == "dq")
        assert match.unit == unit and not doubts and bool(match.why) == (unit != "rad/s")


def test_a_commanded_speed_is_in_the_unit_in_which_the_position_follows() -> None:
    ports = [
        Port("drive", "input", "rad/s"), Port("q", "state", "rad"),
        Port("shaft", "joint", "rad/s", position="q", through="drive"),
    ]  # fmt: skip
    simulator = FunctionSimulator(lambda t, x, u, p: [u.drive], ports)
    t = np.linspace(0.0, 10.0, 1000)
    frame = {"Axis.SetVelo": 57.3 * np.cos(t), "Axis.ActPos [deg]": 57.3 * np.sin(t - 0.05)}
    found, _ = matches(simulator, ports[:2], frame, t)
    assert {m.port: m.unit for m in found} == {"drive": "deg/s", "q": "deg"}


def test_a_unit_with_a_slash_is_not_cut_at_it() -> None:
    headers = map(read_header, ("flow L/min", "Achse1_Istdrehzahl_1/min", "/odom/speed m/s"))
    assert [(" ".join(h.words), h.unit) for h in headers] == [
        ("flow", "L/min"), ("achse 1 istdrehzahl", "rpm"), ("odom speed", "m/s"),
    ]  # fmt: skip


def test_the_last_two_words_may_be_a_quotient() -> None:
    names = ("biomass_g_L", "rho_kg_m3", "acc_m_s2", "p_bar_l", "v_m_s_2", "flow_L_min", "w_m")
    assert [read_header(name).unit for name in names] == ["g/L", "kg/m3", "m/s2", "bar", "m/s", "L/min", "m"]


def test_what_is_matched_leaves_one_choice_for_others() -> None:
    ports = [Port("P_heat", "input", "W"), Port("T_env", "input", "K"), Port("T", "state", "K")]
    simulator = FunctionSimulator(lambda t, x, u, p: [u.P_heat - x.T + u.T_env], ports)
    t = np.linspace(0.0, 10.0, 1000)
    frame = {"Heizleistung_W": 60 + np.sin(t), "Umgebungstemperatur_°C": 20 + 0.1 * t, "Ist-Temperatur_°C": 50 + t}
    found, _ = matches(simulator, ports, frame, t)
    assert [m.column for m in found] == list(frame)


@pytest.mark.parametrize(
    ("ports", "columns"),
    [
        ({"P_heat": ("input", "W"), "T_env": ("input", "K"), "T": ("state", "K")}, ["Pel[W]", "Tamb[°C]", "Tist[°C]"]),
        ({"F": ("input", "N"), "x": ("state", "m")}, ["Fact[N]", "s[mm]"]),
        ({"arm": ("input", "N m"), "arm_q": ("state", "rad")}, ["act0", "obs_q0"]),
        ({"arm": ("input", "N m"), "arm_q": ("state", "rad"), "arm_dq": ("state", "rad/s")}, ["t_ff", "p", "v"]),
        ({"a1": ("input", "rad"), "a1_q": ("state", "rad")}, ["задание q1, град", "угол q1, град"]),
    ],
)
def test_abbreviations_and_what_stands_beside_them(ports: dict[str, tuple[str, str]], columns: list[str]) -> None:
    """A letter and its role; a force that acts, though measured; an action beside its observation."""
    declared = [Port(name, kind, unit) for name, (kind, unit) in ports.items()]
    states = [name for name, (kind, _) in ports.items() if kind == "state"]
    simulator = FunctionSimulator(lambda t, x, u, p: [0.0] * len(states), declared)
    t = np.linspace(0.0, 10.0, 1000)
    motion = {"input": np.cos(3.1 * t), "state": np.sin(t - 0.3), "rate": np.cos(t - 0.3)}
    kinds = ["rate" if unit == "rad/s" else kind for kind, unit in ports.values()]
    found, _ = matches(simulator, declared, {c: motion[k] for c, k in zip(columns, kinds, strict=True)}, t)
    assert [m.column for m in found] == columns


@pytest.mark.parametrize("names", [("j1", "j2", "u1", "u2"), ("q0", "q1", "u0", "u1"), ("j1", "j2", "s1", "s2")])
def test_a_joints_own_name_is_its_position_and_u_may_command_one(names: tuple[str, ...]) -> None:
    wanted = ("j1_q", "j2_q", "s1", "s2")
    ports = [Port(f"s{k}", "input", "rad") for k in (1, 2)]
    for k in (1, 2):
        ports += [Port(f"j{k}_q", "state", "rad"), Port(f"j{k}_dq", "state", "rad/s")]
    simulator = FunctionSimulator(lambda t, x, u, p: [0.0] * 4, ports)
    t = np.linspace(0.0, 10.0, 1000)
    motion = [np.sin(t - 0.3), np.cos(1.7 * t - 0.2), np.sin(t), np.cos(1.7 * t)]
    found, _ = matches(simulator, ports, dict(zip(names, motion, strict=True)), t)
    assert {m.port: m.column for m in found} == dict(zip(wanted, names, strict=True))


def test_a_measured_position_is_no_command() -> None:
    ports = [Port("arm", "input", "rad"), Port("arm_q", "state", "rad")]
    simulator = FunctionSimulator(lambda t, x, u, p: [u.arm], ports)
    t = np.linspace(0.0, 10.0, 1000)
    found, _ = matches(simulator, ports, {"arm_ist [rad]": np.sin(t)}, t)
    assert [(m.port, m.column) for m in found] == [("arm_q", "arm_ist [rad]")]


def test_an_fmus_log_is_mapped_joined_and_diagnosed_by_the_printed_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """``w_m`` is a speed, not a w in metres; the load stands at its start value; friction is tested at a joint."""
    pytest.importorskip("fmpy")
    if shutil.which("cc") is None and shutil.which("gcc") is None:
        pytest.skip("needs a C compiler")
    from pamid.export.ode_fmu import ode_fmu

    fmu = ode_fmu(
        "motor", lambda t, x, u, p: [x.w, (p.k * u.voltage + u.load) / p.J], {"q": 0.0, "w": 0.0},
        {"voltage": 0.0, "load": 0.02}, {"k": 0.05, "J": 2e-3},
        outputs=lambda t, x, u, p: {"theta": x.q, "w_m": x.w},
        units={"voltage": "V", "load": "N m", "theta": "rad", "w_m": "rad/s", "J": "kg m^2"},
    )  # fmt: skip
    monkeypatch.chdir(tmp_path)
    Path("motor.fmu").write_bytes(fmu)
    rng, runs = np.random.default_rng(0), []
    for run in range(3):
        t, w, q, rows = np.arange(0, 6, 0.02), 0.0, 0.0, []
        drive = 4 * np.sin((1 + run) * t) + 3 * np.sin(2.3 * t + run)
        for u in drive:
            rows.append((q, w))
            for _ in range(20):
                w += 1e-3 * (0.05 * u + 0.02 - 4e-3 * w) / 2e-3
                q += 1e-3 * w
        theta, speed = np.array(rows).T + [[1e-3], [5e-2]] * rng.standard_normal((2, len(t)))
        table = {"trajectory": f"r{run}", "time": t, "U_motor": drive, "theta_deg": np.degrees(theta), "w_m": speed}
        runs.append(pd.DataFrame(table))
    pd.concat(runs).to_csv("motor.csv", index=False)
    assert main(["init", "motor.csv", "--sim", "motor.fmu", "--out", "setup", "--yes", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    signals = {name: (entry["column"], entry.get("unit")) for name, entry in said["signals"].items()}
    assert signals["theta"] == ("theta_deg", "deg") and signals["w_m"] == ("w_m", "rad/s")
    assert set(said["assumed"]["signals"]) == {"voltage"} and signals["voltage"][0] == "U_motor"
    page = Path("setup/sim.toml").read_text()
    assert "start = 0.02" in page and 'through = "load" }  # ASSUMED' in page
    command = [*said["next"].split()[1:], "--json", "--effects", "viscous_friction,actuator_gain,sensor_gain"]
    assert main(command) == 0
    [cause] = json.loads(capsys.readouterr().out)["causes"]
    assert (cause["effects"], cause["where"]) == (["viscous_friction"], ["joint_of_theta"])
    assert cause["parameters"]["coefficient"]["value"] == pytest.approx(4e-3, rel=0.1)


@pytest.mark.parametrize(
    ("header", "port"),
    [("Kraft [N]", ""), ("F [N]", ""), ("F_motor [N]", ""), ("load cell [N]", ""), ("load force [N]", "F_load"),
     ("drive [N]", "F_drive"), ("F_drive [N]", "F_drive")],
)  # fmt: skip
def test_one_force_for_two_inputs_in_newtons_is_asked_for_unless_its_name_tells(
    header: str, port: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What both names share tells neither; a column of the input's own name needs no mark."""
    pytest.importorskip("fmpy")
    from pamid.export.ode_fmu import ode_fmu

    made = ode_fmu(
        "cart", lambda t, x, u, p: [x.v, (u.F_drive + u.F_load - 10.0 * x.v) / 5.0], {"s": 0.0, "v": 0.0},
        {"F_drive": 0.0, "F_load": 0.0}, {}, lambda t, x, u, p: {"pos": x.s, "speed": x.v},
        units={"F_drive": "N", "F_load": "N", "pos": "m", "speed": "m/s"},
    )  # fmt: skip
    (tmp_path / "cart.fmu").write_bytes(made)
    t = np.arange(0.0, 4.0, 0.01)
    table = {"t [s]": t, header: 20 * np.sin(t), "pos [m]": 1.0 - np.cos(t), "speed [m/s]": np.sin(t)}
    pd.DataFrame(table).to_csv(tmp_path / "log.csv", index=False)
    files = [str(tmp_path / "log.csv"), "--sim", str(tmp_path / "cart.fmu"), "--yes", "--out", str(tmp_path / "setup")]
    assert main(["init", *files]) == 0
    told = capsys.readouterr().out
    if not port:
        assert "--signal F_drive=COLUMN" in told and "--signal F_load=COLUMN" in told
        assert "--constant F_load=VALUE" in told
        assert header[0] != "F" or f"({header} may be F_drive or F_load)" in told
        if header == "F [N]":
            assert main(["init", *files, "--force", "--signal", f"F_drive={header}", "--constant", "F_load=0"]) == 0
        return
    mapped = [line for line in (tmp_path / "setup" / "columns.toml").read_text("utf-8").splitlines() if header in line]
    given = [line for line in mapped if line.startswith(("F_drive", "F_load"))]
    assert [line.partition(" =")[0] for line in given] == [port]
    assert ("ASSUMED" in given[0]) == (not header.startswith(port))
