"""Three further sets of names, each written before it was tried: of robots, controllers and laboratories."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.integrate import solve_ivp

from .names import DEG, RPM, TURN, Style

SECOND = {
    "odrive": Style(
        "two links",
        "odrv0.axis{k}.controller.input_torque",
        "odrv0.axis{k}.encoder.pos_estimate",
        "odrv0.axis{k}.encoder.vel_estimate",
        ("odrv0.axis{k}.motor.current_control.Iq_measured",),
        unit=TURN,
    ),
    "dynamixel wizard": Style(
        "leap finger",
        "ID{n:02d} Goal Position (deg)",
        "ID{n:02d} Present Position (deg)",
        "ID{n:02d} Present Velocity (rpm)",
        ("ID{n:02d} Present Current (mA)",),
        unit=DEG,
        speed_unit=RPM,
    ),
    "twincat nc": Style(
        "scara",
        "Axis {n}.NcToPlc.SetVelo",
        "Axis {n}.NcToPlc.ActPos",
        "Axis {n}.NcToPlc.ActVelo",
        ("Axis {n}.NcToPlc.ActTorque", "Axis {n}.NcToPlc.PosDiff"),
        unit=DEG,
    ),
    "franka_ros": Style(
        "panda",
        "/franka_state_controller/franka_states/q_d[{k}]",
        "/franka_state_controller/franka_states/q[{k}]",
        "/franka_state_controller/franka_states/dq[{k}]",
        ("/franka_state_controller/franka_states/tau_J[{k}]",),
    ),
    "isaac lab": Style("g1", "applied_torque.{joint}", "joint_pos.{joint}", "joint_vel.{joint}"),
    "romanised japanese": Style(
        "abb", "mokuhyou_kakudo{n}[deg]", "genzai_kakudo{n}[deg]", "kaku_sokudo{n}[deg/s]", unit=DEG
    ),
    "japanese": Style("xarm", "J{n}指令位置[deg]", "J{n}現在位置[deg]", "J{n}現在速度[deg/s]", unit=DEG),
    "german": Style(
        "kuka",
        "Achse{n}_Sollwinkel_Grad",
        "Achse{n}_Istwinkel_Grad",
        "Achse{n}_Istdrehzahl_1/min",
        unit=DEG,
        speed_unit=RPM,
    ),
    "french": Style(
        "kinova",
        "consigne_articulation_{n}_deg",
        "position_articulation_{n}_deg",
        "vitesse_articulation_{n}_deg_s",
        unit=DEG,
    ),
    "spanish": Style("abb", "Ref. ángulo eje {n} (°)", "Ángulo eje {n} (°)", "Velocidad eje {n} (°/s)", unit=DEG),
    "fanuc": Style(
        "abb", "J{n} Command Angle[deg]", "J{n} Feedback Angle[deg]", "", ("J{n} Motor Current[A]",), unit=DEG
    ),
    "drive": Style("drive", "torque_setpoint_Nm", "rotor_angle_rad", "rotor_speed_rpm", speed_unit=RPM),
    "pendulum": Style("pendulum", "u_Nm", "theta_deg", "theta_dot_deg_s", unit=DEG),
    "camel case": Style("xarm", "jointTargetDeg{n}", "jointActualDeg{n}", "jointVelocityDegS{n}", unit=DEG),
    "unitree dds": Style(
        "go1 leg",
        "lowcmd/motor_cmd/{k}/tau",
        "lowstate/motor_state/{k}/q",
        "lowstate/motor_state/{k}/dq",
        ("lowstate/motor_state/{k}/tau_est",),
    ),
    "cheetah": Style(
        "go1 leg",
        "leg_control_command.tau_ff[{k}]",
        "leg_control_data.q[{k}]",
        "leg_control_data.qd[{k}]",
        ("leg_control_data.tau_est[{k}]",),
    ),
    "iiwa fri": Style(
        "kuka",
        "commandedJointPosition_{n}",
        "measuredJointPosition_{n}",
        "",
        ("measuredTorque_{n}", "positionError_{n}"),
    ),
    "mqtt": Style("xarm", "robot/axis/{n}/sp", "robot/axis/{n}/pv", "", unit=DEG),
    "simulink": Style("kinova", "q_cmd:{n}", "q_meas:{n}", "qd_meas:{n}"),
    "trajectory controller": Style(
        "panda",
        "/arm_controller/state/desired/positions[{k}]",
        "/arm_controller/state/actual/positions[{k}]",
        "/arm_controller/state/actual/velocities[{k}]",
        ("/arm_controller/state/error/positions[{k}]",),
    ),
    "leader and follower": Style("so101", "leader/{short}.pos", "follower/{short}.pos", unit=DEG),
}

THIRD = {
    "moteus": Style(
        "two links",
        "servo_{n}/command.feedforward_torque",
        "servo_{n}/position",
        "servo_{n}/velocity",
        ("servo_{n}/q_current",),
        unit=TURN,
    ),
    "feetech": Style(
        "so101", "goal_position.{short}", "present_position.{short}", "present_velocity.{short}", unit=DEG
    ),
    "s7": Style(
        "scara",
        "DB_Axis{n}.VelocitySetpoint",
        "DB_Axis{n}.ActualPosition",
        "DB_Axis{n}.ActualVelocity",
        ("DB_Axis{n}.FollowingError",),
        unit=DEG,
    ),
    "doosan": Style("xarm", "posj_target_{n}[deg]", "posj_{n}[deg]", "velj_{n}[deg/s]", ("trqj_{n}",), unit=DEG),
    "kortex": Style(
        "kinova",
        "base_command.actuators.{k}.position",
        "base_feedback.actuators.{k}.position",
        "base_feedback.actuators.{k}.velocity",
        ("base_feedback.actuators.{k}.torque",),
        unit=DEG,
    ),
    "chinese": Style("xarm", "关节{n}目标角(度)", "关节{n}实际角(度)", "关节{n}实际速度(度/秒)", unit=DEG),
    "korean": Style("abb", "관절{n}_목표[deg]", "관절{n}_측정[deg]", "", unit=DEG),
    "italian": Style("kuka", "rif_giunto{n}_gradi", "pos_giunto{n}_gradi", "vel_giunto{n}_gradi_s", unit=DEG),
    "polish": Style("xarm", "zadana_os{n}_deg", "zmierzona_os{n}_deg", "", unit=DEG),
    "drive, German": Style("drive", "M_ref [Nm]", "phi [°]", "n [U/min]", unit=DEG, speed_unit=RPM),
    "pendulum, camel case": Style("pendulum", "tauCmd", "thetaMeas", "thetaDotMeas"),
    "anymal, camel case": Style(
        "anymal", "{joint}.commandedTorque", "{joint}.jointPosition", "{joint}.jointVelocity", ("{joint}.jointTorque",)
    ),
    "leg, learned": Style("go1 leg", "cmd_tau_{k}", "obs_q_{k}", "obs_dq_{k}"),
    "g1, colons": Style("g1", "target_torque::{joint}", "measured::{joint}::pos", "measured::{joint}::vel"),
    "robosuite": Style("panda", "action_{k}", "robot0_joint_pos_{k}", "robot0_joint_vel_{k}"),
    "polymetis": Style(
        "panda torque",
        "joint_torques_computed_{k}",
        "joint_positions_{k}",
        "joint_velocities_{k}",
        ("motor_torques_measured_{k}",),
    ),
    "ur_rtde": Style("ur5e", "getTargetQ_{k}", "getActualQ_{k}", "getActualQd_{k}", ("getActualCurrent_{k}",)),
    "tune master": Style(
        "abb", "Axis{n} Position Reference", "Axis{n} Position Feedback", "Axis{n} Speed Feedback", unit=DEG
    ),
    "krc": Style("kuka", "axis_cmd.a{n}", "axis_act.a{n}", "", ("torque_axis_act.a{n}",), unit=DEG),
    "hand": Style("leap finger", "finger/cmd/{k}", "finger/state/pos/{k}", "finger/state/vel/{k}"),
    "two links, German": Style("two links", "M{n}_soll [Nm]", "phi{n}_ist [°]", "omega{n}_ist [°/s]", unit=DEG),
}

FOURTH = {
    "staubli": Style("abb", "jCmd.j{n} (deg)", "jPos.j{n} (deg)", "jSpd.j{n} (deg/s)", unit=DEG),
    "yaskawa": Style("kuka", "S-axis{n} CMD [deg]", "S-axis{n} FB [deg]", "", unit=DEG),
    "mit motor": Style("two links", "t_ff[{k}]", "p[{k}]", "v[{k}]"),
    "solo12": Style("go1 leg", "ctrl_torques_{k}", "joint_positions_{k}", "joint_velocities_{k}"),
    "fetch": Style("kinova", "{joint}/position_command", "{joint}/position", "{joint}/velocity", ("{joint}/effort",)),
    "tiago": Style("xarm", "arm_{n}_joint_ref", "arm_{n}_joint_pos", "arm_{n}_joint_vel", unit=1.0),
    "aloha": Style("so101", "action/{k}", "qpos/{k}", "qvel/{k}"),
    "droid": Style("panda", "action.joint_position_{k}", "observation.joint_positions_{k}", ""),
    "abbrev, brackets": Style("scara", "nSoll{n}[rpm]", "phiIst{n}[deg]", "nIst{n}[rpm]", unit=DEG, speed_unit=RPM),
    "edu arm": Style("so101", "{short}_tgt_deg", "{short}_cur_deg", "{short}_spd_dps", unit=DEG),
    "beckhoff st": Style("abb", "MAIN.fTargetPos[{n}]", "MAIN.fActPos[{n}]", "MAIN.fActVel[{n}]", unit=DEG),
    "codesys": Style("kuka", "Axis{n}.fSetPosition", "Axis{n}.fActPosition", "Axis{n}.fActVelocity", unit=DEG),
    "canopen": Style(
        "xarm",
        "0x607A Target position {n}",
        "0x6064 Position actual value {n}",
        "0x606C Velocity actual value {n}",
        unit=DEG,
    ),
    "spot": Style("anymal", "{joint}_load_cmd", "{joint}_position", "{joint}_velocity", ("{joint}_load",)),
    "cassie": Style("go1 leg", "motor_torque[{k}]", "motor_pos[{k}]", "motor_vel[{k}]"),
    "portuguese": Style(
        "abb", "posição desejada J{n} (graus)", "posição medida J{n} (graus)", "velocidade J{n} (graus/s)", unit=DEG
    ),
    "dutch": Style("xarm", "gewenste hoek {n} [graden]", "gemeten hoek {n} [graden]", "", unit=DEG),
    "turkish": Style("xarm", "hedef açı {n} [deg]", "ölçülen açı {n} [deg]", "", unit=DEG),
    "russian": Style("kuka", "задание q{n}, град", "угол q{n}, град", "скорость q{n}, град/с", unit=DEG),
    "drive, abbreviations": Style("drive", "Msoll[Nm]", "PhiIst[deg]", "nIst[rpm]", unit=DEG, speed_unit=RPM),
    "pendulum, abbr": Style("pendulum", "Mref[Nm]", "ang[deg]", "angvel[deg/s]", unit=DEG),
    "leap": Style("leap finger", "cmd_pos_{n}", "cur_pos_{n}", "cur_vel_{n}"),
    "g1 sdk": Style("g1", "tau_ff/{joint}", "q/{joint}", "dq/{joint}", ("tau_est/{joint}",)),
    "gym": Style("two links", "act{k}", "obs_q{k}", "obs_qd{k}"),
    "two links, letters": Style(
        "two links", "M_{word} [Nm]", "phi_{word} [°]", "w_{word} [°/s]", unit=DEG, words=("sh", "el")
    ),
}


@dataclass(frozen=True)
class Plant:
    """A plant on a page of its own.

    Parameters
    ----------
    ports : dict of str to tuple
        Kind and unit of each port.
    rates : callable
        Rates of ``(t, x, u)`` with ``u`` as a list.
    outputs : callable
        Value of each port that is no input, of the states.
    start, levels, sizes : tuple of float
        States at the start; middle and amplitude of each input.
    """

    ports: dict[str, tuple[str, str]]
    rates: Callable
    outputs: Callable
    start: tuple[float, ...]
    levels: tuple[float, ...]
    sizes: tuple[float, ...]

    @property
    def page(self) -> str:
        """The simulator file."""
        lines = [f'{name} = {{ kind = "{kind}", unit = "{unit}" }}' for name, (kind, unit) in self.ports.items()]
        return "\n".join(['kind = "ode"', "[ode]", 'function = "plant.py:rates"', "[ports]", *lines, ""])

    def recorded(self, columns: dict[str, tuple[str, float]], seed: int = 0) -> pd.DataFrame:
        """Return a log under the names of some laboratory: a column and a factor for each port."""
        rng, t = np.random.default_rng(seed), np.arange(0.0, 20.0, 0.02)
        waves = [(0.3 + 0.35 * j, rng.uniform(0, 6)) for j in range(4)]
        u = np.array([
            level + size * sum(np.sin(w * (1 + 0.13 * i) * t + p) for w, p in waves) / 4
            for i, (level, size) in enumerate(zip(self.levels, self.sizes, strict=True))
        ])  # fmt: skip
        x = solve_ivp(
            lambda now, x: self.rates(x, [np.interp(now, t, row) for row in u]), (0, t[-1]), self.start, t_eval=t,
            max_step=0.02, rtol=1e-5,
        ).y  # fmt: skip
        inputs = [name for name, (kind, _) in self.ports.items() if kind == "input"]
        values = dict(zip(inputs, u, strict=True)) | self.outputs(x)
        table = {"time": t}
        for port, (column, factor) in columns.items():
            clean = values[port]
            noise = 1e-3 * np.std(clean) * rng.standard_normal(len(t)) * (port not in inputs)
            shift = 273.15 * (self.ports[port][1] == "K")
            table[column] = factor * (clean - shift + noise)
        return pd.DataFrame(table)


PLANTS = {
    "motor": Plant(
        {"u": ("input", "V"), "w": ("state", "rad/s"), "i": ("state", "A")},
        lambda x, u: [(0.05 * x[1] - 1e-3 * x[0]) / 1e-3, (u[0] - 0.05 * x[0] - 1.0 * x[1]) / 5e-2],
        lambda x: {"w": x[0], "i": x[1]},
        (0.0, 0.0), (0.0,), (12.0,),
    ),
    "cylinder": Plant(
        {"u": ("input", "V"), "x": ("state", "m"), "pA": ("state", "Pa"), "pB": ("state", "Pa")},
        lambda x, u: [
            0.05 * u[0] - 0.3 * (x[0] - 0.2), 8e5 * u[0] - 2.0 * (x[1] - 4e6), -8e5 * u[0] - 3.0 * (x[2] - 3e6)
        ],
        lambda x: {"x": x[0], "pA": x[1], "pB": x[2]},
        (0.2, 4e6, 3e6), (0.0,), (2.0,),
    ),
    "heater": Plant(
        {"P_heat": ("input", "W"), "T_env": ("input", "K"), "T": ("state", "K")},
        lambda x, u: [(u[0] - 2.0 * (x[0] - u[1])) / 10.0],
        lambda x: {"T": x[0]},
        (310.0,), (60.0, 295.15), (50.0, 1.5),
    ),
    "tank": Plant(
        {"q_in": ("input", "m3/s"), "h": ("state", "m")},
        lambda x, u: [(u[0] - 1e-3 * x[0]) / 2e-3],
        lambda x: {"h": x[0]},
        (0.5,), (7e-4,), (4e-4,),
    ),
    "quadrotor": Plant(
        {"thrust": ("input", "N"), "z": ("state", "m"), "vz": ("state", "m/s")},
        lambda x, u: [x[1], (u[0] - 12.0) / 1.2 - 0.6 * x[1] - 0.5 * (x[0] - 2.0)],
        lambda x: {"z": x[0], "vz": x[1]},
        (2.0, 0.0), (12.0,), (2.0,),
    ),
    "two masses": Plant(
        {"F": ("input", "N"), "x1": ("state", "m"), "x2": ("state", "m")},
        lambda x, u: [
            x[2], x[3], u[0] - 5 * (x[0] - x[1]) - 0.5 * x[2] - 2 * x[0], 5 * (x[0] - x[1]) - 0.5 * x[3] - x[1]
        ],
        lambda x: {"x1": x[0], "x2": x[1]},
        (0.0, 0.0, 0.0, 0.0), (0.0,), (1.0,),
    ),
}  # fmt: skip

SECOND_PLANTS = {
    "motor": {"u": ("VoltageCmd_V", 1.0), "w": ("Speed_rpm", RPM), "i": ("CurrentAct_A", 1.0)},
    "cylinder": {
        "u": ("Ventilspannung [V]", 1.0), "x": ("Kolbenweg [mm]", 1e3), "pA": ("Druck A [bar]", 1e-5),
        "pB": ("Druck B [bar]", 1e-5),
    },
    "heater": {
        "P_heat": ("Heizleistung_W", 1.0), "T_env": ("Umgebungstemperatur_°C", 1.0), "T": ("Ist-Temperatur_°C", 1.0),
    },
    "tank": {"q_in": ("Q_ein (l/min)", 6e4), "h": ("Füllstand (cm)", 100.0)},
    "quadrotor": {
        "thrust": ("/mavros/setpoint_raw/thrust", 1.0), "z": ("/mavros/local_position/pose/position/z", 1.0),
        "vz": ("/mavros/local_position/velocity/linear/z", 1.0),
    },
    "two masses": {"F": ("F_soll/N", 1.0), "x1": ("x1/mm", 1e3), "x2": ("x2/mm", 1e3)},
}  # fmt: skip

THIRD_PLANTS = {
    "motor": {"u": ("Spannung_V", 1.0), "w": ("n_ist_U/min", RPM), "i": ("Strom_A", 1.0)},
    "cylinder": {
        "u": ("valveCmd", 1.0), "x": ("rodPos_mm", 1e3), "pA": ("pCapA_bar", 1e-5), "pB": ("pRodB_bar", 1e-5),
    },
    "heater": {"P_heat": ("HTR_PWR_W", 1.0), "T_env": ("TC2_AMB_degC", 1.0), "T": ("TC1_degC", 1.0)},
    "tank": {"q_in": ("FIT101.PV [m3/h]", 3600.0), "h": ("LIT101.PV [cm]", 100.0)},
    "quadrotor": {
        "thrust": ("ctrl.thrust", 1.0), "z": ("pose.position.z", 1.0), "vz": ("twist.linear.z", 1.0),
    },
    "two masses": {"F": ("Kraft [N]", 1.0), "x1": ("Weg1 [mm]", 1e3), "x2": ("Weg2 [mm]", 1e3)},
}  # fmt: skip

FOURTH_PLANTS = {
    "motor": {"u": ("Ua[V]", 1.0), "w": ("n[rpm]", RPM), "i": ("Ia[A]", 1.0)},
    "cylinder": {"u": ("Uv[V]", 1.0), "x": ("s[mm]", 1e3), "pA": ("pA[bar]", 1e-5), "pB": ("pB[bar]", 1e-5)},
    "heater": {"P_heat": ("Pel[W]", 1.0), "T_env": ("Tamb[°C]", 1.0), "T": ("Tist[°C]", 1.0)},
    "tank": {"q_in": ("Qzu[l/min]", 6e4), "h": ("h[cm]", 100.0)},
    "quadrotor": {"thrust": ("Fz_cmd", 1.0), "z": ("alt_m", 1.0), "vz": ("climb_m/s", 1.0)},
    "two masses": {"F": ("Fact[N]", 1.0), "x1": ("s1[mm]", 1e3), "x2": ("s2[mm]", 1e3)},
}
