"""Ten kinds of systems as their users would write them: rates in Python, equations as text, a MuJoCo model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

GRAVITY = 9.81


@dataclass(frozen=True)
class System:
    """A kind of system.

    Parameters
    ----------
    name : str
        What it is.
    dt, samples : float, int
        Usual sampling interval, s, and rows of a run.
    inputs, states : dict of str to str
        Their units.
    readings : dict of str to float
        States that have sensors, and the noise of each as a share of its range, about.
    numbers : dict of str to (float, float, str)
        Parameters: value, relative tolerance, unit.
    rates : callable
        ``rates(t, x, u, p)`` by name, as pamid calls functions.
    equations : dict of str to str
        The same as text.
    plan : dict of str to (float, float, float)
        Of each input, or of the reference of a loop: mean, amplitude, highest frequency times the usual `dt`.
    loop : callable, optional
        ``loop(reference, x, p)`` returns the inputs of a closed loop.
    start : callable, optional
        ``start(rng, runs, p)`` returns where runs begin, shape (n_states, n_runs).
    model : callable, optional
        ``model(p)`` returns it as MJCF; inputs and states then have MuJoCo's names, see `mujoco`.
    mujoco : dict of str to str
        Names in MuJoCo of inputs, states and parameters.
    finest : float, default=1.0
        Share of the sampling interval that Runge-Kutta steps may be at most.
    euler : float, default=2.5e-4
        Euler's step, s, as in users' own loops; none where it would take more damping away than the tolerances hold.
    """

    name: str
    dt: float
    samples: int
    inputs: dict[str, str]
    states: dict[str, str]
    readings: dict[str, float]
    numbers: dict[str, tuple[float, float, str]]
    rates: Callable[..., list[Any]]
    equations: dict[str, str]
    plan: dict[str, tuple[float, float, float]]
    loop: Callable[..., list[Any]] | None = None
    start: Callable[..., np.ndarray] | None = None
    model: Callable[[dict[str, float]], str] | None = None
    mujoco: dict[str, str] = field(default_factory=dict)
    finest: float = 1.0
    euler: float | None = 2.5e-4


def _swing(t: Any, x: Any, u: Any, p: Any) -> list[Any]:
    return [x.dq, (u.torque - p.m * GRAVITY * p.l * np.sin(x.q) - p.b * x.dq) / (p.m * p.l**2)]


def _tanks(t: Any, x: Any, u: Any, p: Any) -> list[Any]:
    one, two = p.a * np.sqrt(np.maximum(x.h1, 0.0)), p.b * np.sqrt(np.maximum(x.h2, 0.0))
    return [p.k * u.pump - one, one - two]


def _arm(t: Any, x: Any, u: Any, p: Any) -> list[Any]:
    l1, c1, c2 = 0.4, 0.2, 0.15
    s, c = np.sin(x.q2), np.cos(x.q2)
    h = p.m2 * l1 * c2
    J1, J2 = p.m1 * (c1**2 + 0.008) + p.m2 * l1**2, p.m2 * (c2**2 + 0.0075)  # heavier bodies of the same shape
    a, b, d = J1 + J2 + 2.0 * h * c, J2 + h * c, J2
    g1 = (p.m1 * c1 + p.m2 * l1) * GRAVITY * np.sin(x.q1)
    g2 = p.m2 * c2 * GRAVITY * np.sin(x.q1 + x.q2)
    one = u.tau1 + h * s * (2.0 * x.w1 + x.w2) * x.w2 - g1 - g2 - p.b1 * x.w1
    two = u.tau2 - h * s * x.w1**2 - g2 - p.b2 * x.w2
    det = a * d - b * b
    return [x.w1, x.w2, (d * one - b * two) / det, (a * two - b * one) / det]


def _arm_model(p: dict[str, float]) -> str:
    return f"""<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody>
<body name="upper"><joint name="q1" axis="0 1 0" damping="{p["b1"]}"/>
<inertial pos="0 0 -0.2" mass="{p["m1"]}" diaginertia="{0.008 * p["m1"]} {0.008 * p["m1"]} 0.001"/>
<body name="lower" pos="0 0 -0.4"><joint name="q2" axis="0 1 0" damping="{p["b2"]}"/>
<inertial pos="0 0 -0.15" mass="{p["m2"]}" diaginertia="{0.0075 * p["m2"]} {0.0075 * p["m2"]} 0.001"/>
</body></body></worldbody>
<actuator><motor name="tau1" joint="q1"/><motor name="tau2" joint="q2"/></actuator></mujoco>"""


def _swing_model(p: dict[str, float]) -> str:
    return f"""<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody>
<body name="bob"><joint name="q" axis="0 1 0" damping="{p["b"]}"/>
<inertial pos="0 0 {-p["l"]}" mass="{p["m"]}" diaginertia="1e-9 1e-9 1e-9"/></body></worldbody>
<actuator><motor name="torque" joint="q"/></actuator></mujoco>"""


def _hydraulic(t: Any, x: Any, u: Any, p: Any) -> list[Any]:
    def flow(opening: Any, drop: Any) -> Any:
        return p.kv * opening * np.sign(drop) * np.sqrt(np.abs(drop) + 1.0)

    one = np.where(u.valve > 0, flow(u.valve, p.ps - x.pA), flow(u.valve, x.pA))
    two = np.where(u.valve > 0, flow(-u.valve, x.pB), flow(-u.valve, p.ps - x.pB))
    A, B, V0, L = 1.25e-3, 0.8e-3, 1.0e-4, 0.3
    force = (A * x.pA - B * x.pB - p.d * x.vel) / p.m
    return [x.vel, force, p.E / (V0 + A * x.pos) * (one - A * x.vel), p.E / (V0 + B * (L - x.pos)) * (two + B * x.vel)]


_OPEN = "0.5*(1 + sign(valve))"  # text has no "where": the valve's two ways are added with weights of 0 and 1


def _text_flow(way: str, drop: str) -> str:
    return f"kv*valve*{way}*sign({drop})*sqrt(abs({drop}) + 1)"


SYSTEMS = (
    System(
        "cart", 0.01, 900, {"force": "N"}, {"x": "m", "v": "m/s"}, {"x": 1e-3, "v": 3e-3},
        {"m": (2.0, 0.05, "kg"), "b": (3.0, 0.1, "N s/m"), "k": (15.0, 0.05, "N/m")},
        lambda t, x, u, p: [x.v, (u.force - p.b * x.v - p.k * x.x) / p.m],
        {"dx/dt": "v", "dv/dt": "(force - b*v - k*x)/m"},
        {"force": (0.0, 8.0, 0.03)},
    ),
    System(
        "pendulum", 0.01, 900, {"torque": "N m"}, {"q": "rad", "dq": "rad/s"}, {"q": 5e-4, "dq": 3e-3},
        {"m": (0.4, 0.05, "kg"), "l": (0.25, 0.0, "m"), "b": (0.01, 0.2, "N m s/rad")},
        _swing, {"dq/dt": "dq", "ddq/dt": f"(torque - m*{GRAVITY}*l*sin(q) - b*dq)/(m*l**2)"},
        {"torque": (0.0, 0.5, 0.03)},
        start=lambda rng, n, p: np.stack([rng.uniform(-1.5, 1.5, n), np.zeros(n)]),
        model=_swing_model, mujoco={"dq": "q_dq", "q": "q_q", "m": "body_mass.bob", "b": "dof_damping.q"},
    ),
    System(
        "motor", 0.002, 1200, {"volt": "V"}, {"i": "A", "w": "rad/s"}, {"i": 5e-3, "w": 2e-3},
        {"R": (1.2, 0.1, "ohm"), "L": (0.004, 0.1, "H"), "K": (0.05, 0.03, "N m/A"), "J": (4e-5, 0.05, "kg m^2"),
         "b": (2e-5, 0.2, "N m s/rad")},
        lambda t, x, u, p: [(u.volt - p.R * x.i - p.K * x.w) / p.L, (p.K * x.i - p.b * x.w) / p.J],
        {"di/dt": "(volt - R*i - K*w)/L", "dw/dt": "(K*i - b*w)/J"},
        {"volt": (0.0, 8.0, 0.02)}, finest=0.5,
    ),
    System(
        "quartercar", 0.005, 1200, {"road": "m"}, {"z_s": "m", "z_u": "m", "v_s": "m/s", "v_u": "m/s"},
        {"z_s": 2e-3, "z_u": 2e-3},
        {"ms": (320.0, 0.03, "kg"), "mu": (42.0, 0.03, "kg"), "ks": (18e3, 0.05, "N/m"), "cs": (1400.0, 0.05, "N s/m"),
         "kt": (19e4, 0.05, "N/m")},
        lambda t, x, u, p: [
            x.v_s, x.v_u, (p.ks * (x.z_u - x.z_s) + p.cs * (x.v_u - x.v_s)) / p.ms,
            (p.kt * (u.road - x.z_u) - p.ks * (x.z_u - x.z_s) - p.cs * (x.v_u - x.v_s)) / p.mu,
        ],
        {"dz_s/dt": "v_s", "dz_u/dt": "v_u", "dv_s/dt": "(ks*(z_u - z_s) + cs*(v_u - v_s))/ms",
         "dv_u/dt": "(kt*(road - z_u) - ks*(z_u - z_s) - cs*(v_u - v_s))/mu"},
        {"road": (0.0, 0.02, 0.04)}, finest=0.5,
    ),
    System(
        "tanks", 1.0, 700, {"pump": "V"}, {"h1": "m", "h2": "m"}, {"h1": 2e-3, "h2": 2e-3},
        {"a": (0.03, 0.05, "m^0.5/s"), "b": (0.028, 0.05, "m^0.5/s"), "k": (0.006, 0.05, "m/(V s)")},
        _tanks, {"dh1/dt": "k*pump - a*sqrt(max(h1, 0))", "dh2/dt": "a*sqrt(max(h1, 0)) - b*sqrt(max(h2, 0))"},
        {"pump": (4.5, 1.8, 0.01)},
        start=lambda rng, n, p: rng.uniform(0.4, 1.2, (2, n)), euler=0.025,
    ),
    System(
        "thermal", 2.0, 700, {"heat": "W", "room": "K"}, {"T1": "K", "T2": "K"}, {"T1": 2e-3, "T2": 2e-3},
        {"C1": (300.0, 0.05, "J/K"), "C2": (900.0, 0.05, "J/K"), "g": (4.0, 0.1, "W/K"), "h": (2.5, 0.1, "W/K")},
        lambda t, x, u, p: [
            (u.heat - p.g * (x.T1 - x.T2)) / p.C1, (p.g * (x.T1 - x.T2) - p.h * (x.T2 - u.room)) / p.C2],
        {"dT1/dt": "(heat - g*(T1 - T2))/C1", "dT2/dt": "(g*(T1 - T2) - h*(T2 - room))/C2"},
        {"heat": (120.0, 70.0, 0.02), "room": (293.0, 2.0, 0.002)},
        start=lambda rng, n, p: 293.0 + rng.uniform(0.0, 40.0, (2, n)), euler=0.05,
    ),
    System(
        "quadrotor", 0.005, 1200, {"thrust": "-"}, {"z": "m", "vz": "m/s", "f": "N"}, {"z": 2e-3},
        {"m": (0.9, 0.03, "kg"), "kf": (18.0, 0.05, "N"), "tau": (0.06, 0.1, "s"), "d": (0.25, 0.2, "N s/m")},
        lambda t, x, u, p: [x.vz, (x.f - p.d * x.vz) / p.m - GRAVITY, (p.kf * u.thrust - x.f) / p.tau],
        {"dz/dt": "vz", "dvz/dt": f"(f - d*vz)/m - {GRAVITY}", "df/dt": "(kf*thrust - f)/tau"},
        {"thrust": (1.5, 0.4, 0.008)},
        loop=lambda r, x, p: [np.clip(0.49 + 0.12 * (r[0] - x.z) - 0.12 * x.vz, 0.0, 1.0)],
        start=lambda rng, n, p: np.stack([np.full(n, 1.5), np.zeros(n), np.full(n, p["m"] * GRAVITY)]),
    ),
    System(
        "arm", 0.005, 1000, {"tau1": "N m", "tau2": "N m"},
        {"q1": "rad", "q2": "rad", "w1": "rad/s", "w2": "rad/s"}, {"q1": 3e-4, "q2": 3e-4, "w1": 3e-3, "w2": 3e-3},
        {"m1": (1.5, 0.05, "kg"), "m2": (0.8, 0.05, "kg"), "b1": (0.15, 0.2, "N m s/rad"),
         "b2": (0.08, 0.2, "N m s/rad")},
        _arm, {}, {"tau1": (0.2, 0.7, 0.008), "tau2": (0.3, 0.8, 0.01)},
        loop=lambda r, x, p: [30.0 * (r[0] - x.q1) - 3.0 * x.w1, 12.0 * (r[1] - x.q2) - 0.8 * x.w2],
        model=_arm_model,
        mujoco={"q1": "q1_q", "q2": "q2_q", "w1": "q1_dq", "w2": "q2_dq", "m1": "body_mass.upper",
                "m2": "body_mass.lower", "b1": "dof_damping.q1", "b2": "dof_damping.q2"},
    ),
    System(
        "hydraulic", 0.002, 1200, {"valve": "-"}, {"pos": "m", "vel": "m/s", "pA": "Pa", "pB": "Pa"},
        {"pos": 3e-4, "pA": 2e-3, "pB": 2e-3},
        {"ps": (7e6, 0.02, "Pa"), "kv": (1.2e-7, 0.05, "m^3/s/Pa^0.5"), "E": (9e8, 0.15, "Pa"), "m": (80.0, 0.05, "kg"),
         "d": (800.0, 0.1, "N s/m")},
        _hydraulic,
        {"dpos/dt": "vel", "dvel/dt": "(1.25e-3*pA - 0.8e-3*pB - d*vel)/m",
         "dpA/dt": f"E/(1e-4 + 1.25e-3*pos)*({_text_flow(_OPEN, 'ps - pA')} + "
                   f"{_text_flow(_OPEN.replace('+', '-'), 'pA')} - 1.25e-3*vel)",
         "dpB/dt": f"E/(1e-4 + 0.8e-3*(0.3 - pos))*(0.8e-3*vel - {_text_flow(_OPEN, 'pB')} - "
                   f"{_text_flow(_OPEN.replace('+', '-'), 'ps - pB')})"},
        {"valve": (0.15, 0.05, 0.003)},
        loop=lambda r, x, p: [np.clip(12.0 * (r[0] - x.pos), -1.0, 1.0)],
        start=lambda rng, n, p: np.stack([np.full(n, 0.15), np.zeros(n), np.full(n, 2.7e6), np.full(n, 4.2e6)]),
        finest=0.2, euler=None,
    ),
    System(
        "rlc", 1e-4, 1200, {"e": "V"}, {"i": "A", "vc": "V"}, {"vc": 2e-3},
        {"R": (4.0, 0.1, "ohm"), "L": (0.01, 0.05, "H"), "C": (1e-5, 0.05, "F")},
        lambda t, x, u, p: [(u.e - p.R * x.i - x.vc) / p.L, x.i / p.C],
        {"di/dt": "(e - R*i - vc)/L", "dvc/dt": "i/C"},
        {"e": (0.0, 5.0, 0.05)}, euler=2.5e-6,
    ),
)  # fmt: skip
"""All of them."""


def simulator_of(system: System, p: dict[str, float], way: str, folder: Path) -> Any:
    """Return a system with given numbers as a simulator of one kind: equations, function or mujoco."""
    from pamid.simulators import EquationSimulator, FunctionSimulator, MujocoSimulator, Port

    if way == "mujoco" and system.model is not None:
        path = folder / f"{system.name}.xml"
        path.write_text(system.model(p))
        named = system.mujoco
        ports = [Port(named.get(n, n), "state", unit, column=n) for n, unit in system.states.items()]
        numbers = {named[k]: (v, system.numbers[k][1]) for k, v in p.items() if k in named}
        return MujocoSimulator(path, ports, numbers)
    start = system.start(np.random.default_rng(0), 1, p)[:, 0] if system.start else np.zeros(len(system.states))
    ports = [Port(n, "input", unit) for n, unit in system.inputs.items()]
    ports += [Port(n, "state", unit, start=float(x)) for (n, unit), x in zip(system.states.items(), start, strict=True)]
    numbers = {k: (v, *system.numbers[k][1:]) for k, v in p.items()}
    if way == "equations" and system.equations:
        return EquationSimulator(system.equations, ports, numbers)
    return FunctionSimulator(system.rates, ports, numbers)
