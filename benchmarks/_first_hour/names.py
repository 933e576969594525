"""Robots and the names that drivers give their signals: what `pamid init LOG --sim MODEL --yes` makes of each."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pandas as pd

DEG, RPM, TURN = 180.0 / np.pi, 30.0 / np.pi, 0.5 / np.pi


@dataclass(frozen=True)
class Robot:
    """A chain of hinges in MuJoCo.

    Parameters
    ----------
    joints : tuple of str
        Names of its joints, as in the public model.
    actuators : tuple of str
        Names of its actuators; that of the joint where they are the same.
    kind : str
        ``"position"``, ``"velocity"`` or ``"motor"``.
    range : tuple of float
        Range of each joint, rad; none where both are 0.
    """

    joints: tuple[str, ...]
    actuators: tuple[str, ...]
    kind: str = "position"
    range: tuple[float, float] = (-2.9, 2.9)

    @property
    def xml(self) -> str:
        """The model."""
        limits = f' range="{self.range[0]} {self.range[1]}"' if any(self.range) else ""
        bodies = ""
        for k, joint in enumerate(self.joints):
            axis = ("0 1 0", "1 0 0", "0 0 1")[k % 3]
            bodies += (
                f'<body name="link_{k}" pos="0 0 {-0.15 if k else 0}"><joint name="{joint}" axis="{axis}"{limits} '
                'armature="0.02" damping="0.1"/><geom type="capsule" fromto="0 0 0 0 0 -0.15" size="0.02" mass="0.2" '
                'contype="0" conaffinity="0"/>'
            )
        more = {"position": 'kp="40" kv="2"', "velocity": 'kv="2"', "motor": ""}[self.kind]
        ends = "</body>" * len(self.joints)
        drives = "".join(
            f'<{self.kind} name="{a}" joint="{j}" {more}/>' for a, j in zip(self.actuators, self.joints, strict=True)
        )
        head = '<mujoco><compiler angle="radian" autolimits="true"/><worldbody>'
        return f"{head}{bodies}{ends}</worldbody><actuator>{drives}</actuator></mujoco>"

    def ports(self, k: int) -> dict[str, str]:
        """Return the ports of a joint: command, angle and speed."""
        joint, drive = self.joints[k], self.actuators[k]
        return {"command": f"{drive}_ctrl" if drive in self.joints else drive, "angle": f"{joint}_q",
                "speed": f"{joint}_dq"}  # fmt: skip


def numbered(form: str, n: int, first: int = 1) -> tuple[str, ...]:
    """Return names that differ in their number."""
    return tuple(form.format(k) for k in range(first, first + n))


_SO = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
_UR = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
_FR = ("FR_hip", "FR_thigh", "FR_calf")
_ANYMAL = ("LF_HAA", "LF_HFE", "LF_KFE", "RF_HAA", "RF_HFE", "RF_KFE")
_LEAP = ("if_mcp", "if_rot", "if_pip", "if_dip")
_G1 = tuple(f"{side}_{part}_joint" for side in ("left", "right") for part in ("hip_pitch", "hip_roll", "knee"))

ROBOTS = {
    "so101": Robot(_SO, _SO),
    "ur5e": Robot(tuple(f"{n}_joint" for n in _UR), _UR, range=(-6.28, 6.28)),
    "panda": Robot(numbered("joint{}", 7), numbered("actuator{}", 7)),
    "panda torque": Robot(numbered("panda_joint{}", 7), numbered("panda_torq_j{}", 7), "motor"),
    "go1 leg": Robot(tuple(f"{n}_joint" for n in _FR), _FR, "motor"),
    "xarm": Robot(numbered("joint{}", 6), numbered("act{}", 6), range=(0.0, 0.0)),
    "kinova": Robot(numbered("joint_{}", 7), numbered("joint_{}", 7)),
    "abb": Robot(numbered("joint_{}", 6), numbered("motor_{}", 6)),
    "kuka": Robot(numbered("joint_a{}", 6), numbered("joint_a{}", 6)),
    "anymal": Robot(_ANYMAL, _ANYMAL, "motor"),
    "g1": Robot(_G1, _G1, "motor"),
    "leap finger": Robot(_LEAP, tuple(f"{n}_act" for n in _LEAP)),
    "scara": Robot(("axis1", "axis2"), ("servo1", "servo2"), "velocity"),
    "drive": Robot(("shaft",), ("motor",), "motor", (0.0, 0.0)),
    "pendulum": Robot(("hinge",), ("torque",), "motor", (0.0, 0.0)),
    "two links": Robot(("shoulder", "elbow"), ("shoulder", "elbow"), "motor"),
}  # fmt: skip


@dataclass(frozen=True)
class Style:
    """How a driver names what it records.

    Parameters
    ----------
    robot : str
        The robot that it is of.
    command, angle, speed : str
        Forms of the names, in which ``{joint}`` is the joint's name, ``{short}`` that without "joint", ``{k}`` its
        number from 0 and ``{n}`` from 1; empty where the driver does not record it.
    others : tuple of str
        Forms of what it records beside: torques, currents, temperatures, errors.
    unit : float
        Of angles and speeds, from rad.
    speed_unit : float or None
        Of speeds, where it is another one, from rad/s.
    words : tuple of str
        What stands for ``{word}``, joint by joint.
    """

    robot: str
    command: str = ""
    angle: str = ""
    speed: str = ""
    others: tuple[str, ...] = ()
    unit: float = 1.0
    speed_unit: float | None = None
    words: tuple[str, ...] = field(default=())

    def form(self, form: str, k: int) -> str:
        """Return a name."""
        joint = ROBOTS[self.robot].joints[k]
        short = joint.removesuffix("_joint").removesuffix("_act")
        word = self.words[k] if self.words else short
        return form.format(joint=joint, short=short, k=k, n=k + 1, word=word)


def motion(k: int, t: np.ndarray) -> dict[str, np.ndarray]:
    """Return command, angle and speed of a joint that follows its command by 80 ms, rad and rad/s, and a torque."""
    w, lag = 0.9 + 0.53 * k, 0.08
    out = {"command": 0.1 * k - 0.2 + 0 * t, "angle": 0.1 * k - 0.2 + 0 * t, "speed": 0 * t, "torque": 1.0 + 0 * t}
    for size, rate, phase in ((0.6, w, 0.0), (0.25, 2.3 * w, k)):
        at = rate * t + phase
        out["command"] = out["command"] + size * np.sin(at)
        out["angle"] = out["angle"] + size * np.sin(at - rate * lag)
        out["speed"] = out["speed"] + size * rate * np.cos(at - rate * lag)
        out["torque"] = out["torque"] - 0.3 * size * rate**2 * np.sin(at - rate * lag)
    return out


def recorded(style: Style, seed: int = 0) -> tuple[pd.DataFrame, dict[str, tuple[str, float]]]:
    """Return a log, and the column and unit of each port of its robot; an empty column where the log has none."""
    robot, rng, t = ROBOTS[style.robot], np.random.default_rng(seed), np.arange(0.0, 8.0, 0.01)
    table: dict[str, np.ndarray] = {}
    truth: dict[str, tuple[str, float]] = {}
    what = {"position": "command", "velocity": "speed", "motor": "torque"}[robot.kind]
    speed_unit = style.unit if style.speed_unit is None else style.speed_unit
    units = {"command": style.unit, "angle": style.unit, "speed": speed_unit, "torque": 1.0}
    for k in range(len(robot.joints)):
        moved = motion(k, t)
        for role, port in robot.ports(k).items():
            form = getattr(style, role)
            kind = what if role == "command" else role
            truth[port] = (style.form(form, k) if form else "", units[kind])
            if form:
                late = moved[kind] if kind != "speed" or role == "speed" else np.interp(t + 0.05, t, moved[kind])
                table[truth[port][0]] = units[kind] * late + 1e-4 * units[kind] * rng.standard_normal(len(t))
        for j, form in enumerate(style.others):
            name = style.form(form, k)
            if name not in table:
                part = (moved["torque"] * (1.1 + 0.1 * j), moved["command"] - moved["angle"], 30.0 + 0.01 * t)[j % 3]
                table[name] = part + 1e-3 * rng.standard_normal(len(t))
    table |= {"battery_voltage": 24 + 0.1 * rng.standard_normal(len(t)), "frame_index": np.arange(len(t))}
    return pd.DataFrame({"timestamp": 1.7e9 + t} | table), truth
