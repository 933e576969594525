"""Twelve simulators as users have them, each with a log in the names and units of its driver and something withheld."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from .names import DEG, ROBOTS, RPM

DT = 0.01
CARTPOLE = """<mujoco><option timestep="0.002"/><worldbody><body name="cart">
<joint name="slider" type="slide" axis="1 0 0" range="-1 1" limited="true" damping="1"/>
<geom type="box" size="0.1 0.05 0.05" mass="1"/>
<body name="pole"><joint name="hinge_1" axis="0 1 0" damping="0.002"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02" mass="0.1"/></body></body></worldbody>
<actuator><motor name="slide" joint="slider" gear="10" ctrllimited="true" ctrlrange="-1 1"/></actuator></mujoco>"""


@dataclass(frozen=True)
class Case:
    """One simulator with its log.

    Parameters
    ----------
    name : str
        What it is.
    sim : str
        The file that ``--sim`` names.
    truth : dict of str to (str, float)
        Column of each port, empty where the log has none, and its unit from SI.
    write : callable
        Writes the simulator and ``log.csv`` into a folder.
    """

    name: str
    sim: str
    truth: dict[str, tuple[str, float]]
    write: Callable[[Path], None] = field(repr=False)


def multisine(rng: np.random.Generator, t: np.ndarray, size: float, low: float = 0.1, high: float = 0.8) -> np.ndarray:
    """Return a sum of three sines that begins at 0."""
    rates, phases = 2 * np.pi * rng.uniform(low, high, 3), rng.uniform(0, 6, 3)
    return size / 2 * sum(np.sin(w * t + p) - np.sin(p) for w, p in zip(rates, phases, strict=True))


# --- robots ---------------------------------------------------------------------------------------------------
def robot(
    name: str, key: str, forms: tuple[str, str, str], change: tuple[str, str], unit: float = 1.0,
    xml: str = "", command: float = 0.4, encoder: float = 2 * np.pi / 4096, clock: str = "timestamp",
) -> Case:  # fmt: skip
    """Return the case of a robot in MuJoCo; a text of its model is another one in what was recorded."""
    own = ROBOTS[key]
    model = xml or own.xml
    truth = {}
    for k, joint in enumerate(own.joints):
        words = {"joint": joint, "short": joint.removesuffix("_joint"), "k": k, "n": k + 1}
        ports = own.ports(k)
        if k < len(own.actuators):
            truth[ports["command"]] = (forms[0].format(**words), 1.0 if own.kind == "motor" else unit)
        truth[ports["angle"]] = (forms[1].format(**words) if forms[1] else "", unit)
        truth[ports["speed"]] = (forms[2].format(**words) if forms[2] else "", unit)

    def write(folder: Path) -> None:
        import mujoco

        (folder / "robot.xml").write_text(model)
        real = model.replace(*change)
        assert real != model
        m = mujoco.MjModel.from_xml_string(real)
        d, rng, t = (
            mujoco.MjData(m),
            np.random.default_rng(len(name)),
            np.arange(0.0, 12.0 if len(own.joints) < 5 else 8.0, DT),
        )
        u = np.stack([multisine(rng, t, command) for _ in range(m.nu)])
        rows = np.zeros((len(t), m.nu + 2 * m.nv))
        for k in range(len(t)):
            drive = u[:, k].copy()
            if own.kind == "motor" and not xml:  # a controller, whose torques are recorded
                drive = 30.0 * (drive - d.qpos) - 1.0 * d.qvel
            angle = np.round(d.qpos / encoder) * encoder
            rows[k] = [*drive, *angle, *(d.qvel + 2e-3 * rng.standard_normal(m.nv))]
            d.ctrl[:] = drive
            mujoco.mj_step(m, d, nstep=round(DT / m.opt.timestep))
        table: dict[str, np.ndarray] = {clock: 1.7e9 + t}
        joints = [*range(m.nu)], [*range(m.nv)]
        for k in joints[0]:
            column, factor = truth[own.ports(k)["command"]]
            table[column] = factor * rows[:, k]
        for k in joints[1]:
            for at, role in ((m.nu, "angle"), (m.nu + m.nv, "speed")):
                column, factor = truth[own.ports(k)[role]]
                if column:
                    table[column] = factor * rows[:, at + k]
        table["battery"] = 24 + 0.1 * rng.standard_normal(len(t))
        pd.DataFrame(table).to_csv(folder / "log.csv", index=False)

    return Case(name, "robot.xml", truth, write)


def cart() -> Case:
    """Return the case of a cart with a pole: a slide and a hinge, one motor."""
    truth = {
        "slide": ("motor cmd", 1.0), "slider_q": ("Cart position [mm]", 1e3), "slider_dq": ("Cart speed [mm/s]", 1e3),
        "hinge_1_q": ("Pole angle [deg]", DEG), "hinge_1_dq": ("Pole rate [deg/s]", DEG),
    }  # fmt: skip

    def write(folder: Path) -> None:
        import mujoco

        (folder / "cartpole.xml").write_text(CARTPOLE)
        m = mujoco.MjModel.from_xml_string(CARTPOLE.replace('damping="1"', 'damping="1" frictionloss="0.8"'))
        d, rng, t = mujoco.MjData(m), np.random.default_rng(5), np.arange(0.0, 12.0, DT)
        wanted, rows = multisine(rng, t, 0.5), []
        for k in range(len(t)):
            u = float(np.clip(3.0 * (wanted[k] - d.qpos[0]) - 0.5 * d.qvel[0], -1, 1))
            rows.append([u, d.qpos[0], d.qvel[0], d.qpos[1], d.qvel[1]])
            d.ctrl[0] = u
            mujoco.mj_step(m, d, nstep=5)
        x = np.array(rows) + [0.0, 2e-5, 1e-3, 3e-4, 3e-3] * rng.standard_normal((len(t), 5))
        table = {"t [s]": t} | {c: f * x[:, k] for k, (c, f) in enumerate(truth.values())}
        pd.DataFrame(table).to_csv(folder / "log.csv", index=False)

    return Case("cart-pole, own names", "cartpole.xml", truth, write)


# --- simulators of equations ----------------------------------------------------------------------------------
Rates = Callable[[float, np.ndarray, np.ndarray], list[float]]


def record(rates: Rates, inputs: np.ndarray, start: list[float], noise: list[float], seed: int = 0) -> np.ndarray:
    """Return the states of a system in small steps, with noise, shape (n, n_states)."""
    x, rows, fine = np.array(start, dtype=float), [], 20
    for k in range(inputs.shape[1]):
        rows.append(x.copy())
        for _ in range(fine):
            x = x + DT / fine * np.array(rates(k * DT, x, inputs[:, k]))
    return np.array(rows) + np.array(noise) * np.random.default_rng(seed).standard_normal((len(rows), len(start)))


def plant(
    name: str, sim: str, files: Callable[[Path], None], ports: dict[str, tuple[str, float]], rates: Rates,
    inputs: Callable[[np.random.Generator, np.ndarray], list[np.ndarray]], start: list[float], noise: list[float],
    clock: tuple[str, float] = ("time [s]", 1.0), encoding: str = "utf-8", separator: str = ",",
) -> Case:  # fmt: skip
    """Return the case of a plant: three runs of what the simulator lacks something of."""

    def write(folder: Path) -> None:
        files(folder)
        parts = []
        for run in range(3):
            rng, t = np.random.default_rng(run + 11), np.arange(0.0, 12.0, DT)
            u = np.stack(inputs(rng, t))
            x = record(rates, u, start, noise, run)
            values = [*u, *x.T]
            table = {"Run": run + 1, clock[0]: clock[1] * t}
            table |= {c: f * v for (c, f), v in zip(ports.values(), values, strict=True) if c}
            parts.append(pd.DataFrame(table))
        frame = pd.concat(parts, ignore_index=True)
        frame.to_csv(folder / "log.csv", index=False, encoding=encoding, sep=separator)

    return Case(name, sim, ports, write)


def fmu(
    name: str, rates: Callable, states: dict, inputs: dict, numbers: dict, outputs: Callable, units: dict
) -> Callable:
    """Return what writes an FMU."""

    def files(folder: Path) -> None:
        from pamid.export.ode_fmu import ode_fmu

        made = ode_fmu(name, rates, states, inputs, numbers, outputs=outputs, units=units)
        (folder / f"{name}.fmu").write_bytes(made)

    return files


def texts(**files: str) -> Callable[[Path], None]:
    """Return what writes text files."""

    def write(folder: Path) -> None:
        for name, text in files.items():
            (folder / name.replace("__", ".")).write_text(text, encoding="utf-8")

    return write


SPRING = """import numpy as np
def rates(t, x, u, p):
    return [x.pos_vel, (u.force - p.c * x.pos_vel - p.k * x.pos) / p.m]
"""
SPRING_PAGE = """kind = "ode"
[ode]
function = "stage.py:rates"
[ports]
force = { kind = "input", unit = "N" }
pos = { kind = "state", unit = "m" }
pos_vel = { kind = "state", unit = "m/s" }
[parameters]
m = { value = 2.0, tolerance = 0.02, unit = "kg" }
c = { value = 4.0, tolerance = 0.05, unit = "N s/m" }
k = { value = 50.0, tolerance = 0.05, unit = "N/m" }
"""
OVEN_PAGE = """kind = "equations"
[equations]
"dT_oven/dt" = "(P_heat - G*(T_oven - T_amb))/C"
[ports]
P_heat = { kind = "input", unit = "W" }
T_amb = { kind = "input", unit = "K", start = 293.15 }
T_oven = { kind = "state", unit = "K", start = 293.15 }
[parameters]
G = { value = 2.0, tolerance = 0.02, unit = "W/K" }
C = { value = 10.0, tolerance = 0.02, unit = "J/K" }
"""
CONTROL = """def system():
    import control
    return control.ss([[-4.0]], [[8.0]], [[1.0]], [[0.0]])
"""
CONTROL_PAGE = """kind = "control"
[control]
system = "motor.py:system"
[ports]
u0 = { kind = "input", unit = "V" }
y0 = { kind = "output", unit = "rad/s" }
"""


def cases() -> list[Case]:
    """Return the twelve."""

    def more(joint: str, what: str) -> tuple[str, str]:
        return f'<joint name="{joint}" axis=', f'<joint name="{joint}" {what} axis='

    return [
        robot("SO-101, LeRobot", "so101", ("action.{short}.pos", "observation.state.{short}.pos", ""),
              more("elbow_flex", 'frictionloss="0.25"'), DEG),
        robot("UR5e, RTDE", "ur5e", ("target_q_{k}", "actual_q_{k}", "actual_qd_{k}"),
              more("elbow_joint", 'frictionloss="0.25"')),
        robot("Panda, libfranka", "panda", ("q_d[{k}]", "q[{k}]", "dq[{k}]"), more("joint2", 'frictionloss="0.25"')),
        robot("Go1 leg, low-level state", "go1 leg", ("motorCmd[{k}].tau", "motorState[{k}].q", "motorState[{k}].dq"),
              more("FR_calf_joint", 'frictionloss="0.15"')),
        cart(),
        robot("Hand finger, Dynamixel", "leap finger",
              ("GoalPosition{n} [deg]", "PresentPosition{n} [deg]", "PresentVelocity{n} [deg/s]"),
              more("if_pip", 'frictionloss="0.1"'), DEG),
        plant("FMU: motor, German", "motor.fmu",
              fmu("motor", lambda t, x, u, p: [x.w, (p.k * u.u_a + u.tau_load) / p.J], {"phi": 0.0, "w": 0.0},
                  {"u_a": 0.0, "tau_load": 0.0}, {"k": 0.05, "J": 2e-3},
                  lambda t, x, u, p: {"shaft_phi": x.phi, "shaft_w": x.w},
                  {"u_a": "V", "tau_load": "N.m", "shaft_phi": "rad", "shaft_w": "rad/s", "J": "kg.m2"}),
              {"u_a": ("Ankerspannung [V]", 1.0), "shaft_phi": ("Drehwinkel [°]", DEG),
               "shaft_w": ("Drehzahl [1/min]", RPM)},
              lambda t, x, u: [x[1], (0.05 * u[0] - 4e-3 * x[1]) / 2e-3],
              lambda rng, t: [multisine(rng, t, 5.0)], [0.0, 0.0], [1e-3, 5e-2], ("Zeit [ms]", 1e3),
              separator=";"),
        plant("FMU: tank", "tank.fmu",
              fmu("tank", lambda t, x, u, p: [(u.q_in - p.a * x.h) / p.A], {"h": 0.5}, {"q_in": 0.0},
                  {"a": 1e-3, "A": 2e-3}, lambda t, x, u, p: {"level": x.h}, {"q_in": "m3/s", "level": "m", "A": "m2"}),
              {"q_in": ("Pump flow [L/min]", 6e4), "level": ("Tank level (cm)", 100.0)},
              lambda t, x, u: [(u[0] - 1e-3 * x[0] - 2e-4) / 2e-3],
              lambda rng, t: [7e-4 + multisine(rng, t, 2e-4)], [0.5], [5e-4]),
        plant("FMU: positioning axis", "axis.fmu",
              fmu("axis", lambda t, x, u, p: [x.v, (u.F_drive - p.d * x.v) / p.m], {"s": 0.0, "v": 0.0},
                  {"F_drive": 0.0}, {"m": 5.0, "d": 10.0}, lambda t, x, u, p: {"axis_s": x.s, "axis_v": x.v},
                  {"F_drive": "N", "axis_s": "m", "axis_v": "m/s", "m": "kg"}),
              {"F_drive": ("Axis1.SetForce", 1.0), "axis_s": ("Axis1.ActualPosition [mm]", 1e3),
               "axis_v": ("Axis1.ActualVelocity [mm/s]", 1e3)},
              lambda t, x, u: [x[1], (u[0] - 10.0 * x[1] - 4.0 * np.tanh(x[1] / 2e-3)) / 5.0],
              lambda rng, t: [multisine(rng, t, 20.0)], [0.0, 0.0], [2e-5, 1e-3]),
        plant("Python: stage, function", "stage.toml", texts(stage__py=SPRING, stage__toml=SPRING_PAGE),
              {"force": ("Kraft_soll [N]", 1.0), "pos": ("Weg_ist [mm]", 1e3),
               "pos_vel": ("Geschwindigkeit_ist [mm/s]", 1e3)},
              lambda t, x, u: [x[1], (u[0] - 4 * x[1] - 50 * x[0] - 2.0 * np.tanh(x[1] / 2e-3)) / 2.0],
              lambda rng, t: [multisine(rng, t, 12.0)], [0.0, 0.0], [2e-5, 1e-3]),
        plant("Python: oven, equations", "oven.toml", texts(oven__toml=OVEN_PAGE),
              {"P_heat": ("加热功率[W]", 1.0), "T_oven": ("炉温[°C]", 1.0)},
              lambda t, x, u: [(u[0] - 2.0 * x[0] - 15.0) / 10.0],
              lambda rng, t: [60 + multisine(rng, t, 40.0)], [0.0], [2e-2], encoding="gb18030"),
        plant("Python: motor, python-control", "motor.toml", texts(motor__py=CONTROL, motor__toml=CONTROL_PAGE),
              {"u0": ("consigne tension [V]", 1.0), "y0": ("vitesse mesurée [tr/min]", RPM)},
              lambda t, x, u: [-4.0 * x[0] + 8.0 * (u[0] - 0.6 * np.tanh(u[0] / 0.05))],
              lambda rng, t: [multisine(rng, t, 4.0)], [0.0], [2e-2]),
    ]  # fmt: skip
