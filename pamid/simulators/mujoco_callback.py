"""Effects that MJCF has no element for, as callbacks of MuJoCo: forces on joints, faults of actuators."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np

from ..effects import Effect
from ..effects.base import Signals
from ..effects.delays import TransportDelay
from ..effects.plant import Surroundings
from ..errors import SimulatorTypeError
from .between import Between, ends_of
from .catalogue import in_port_units, port_effects
from .mujoco_model import MujocoSimulator, actuators_of
from .page import read_simulator

_PLANT: Any = Surroundings(0.0)
_ROUND = 1e-6


class _Remembered:
    """An effect with its memory in one simulation, advanced with its time."""

    def __init__(self, effect: Effect) -> None:
        self.effect = effect
        self._earlier: tuple[float, Signals, Any] | None = None
        self._now: tuple[float, Signals, Any] = (np.inf, Signals(), np.zeros((0,)))
        self._within = False

    def memory(self, s: Signals, time: float, step: float) -> Any:
        """Return the memory at a time; an earlier time restarts it, and a delay takes one command per step."""
        since = time - self._now[0]
        if since > 0.0 and isinstance(self.effect, TransportDelay):
            within, before = since < (1.0 - _ROUND) * step, self._within
            self._within = within
            if within or before:
                return self._now[2]
        if since < 0.0:
            self._earlier, self._within = None, False
        elif since > 0.0:
            self._earlier = self._now
        if self._earlier is None:
            memory = self.effect.start(s, _PLANT, step)
        else:
            then, given, memory = self._earlier
            dt = time - then
            dt = step if abs(dt - step) < _ROUND * step else dt  # times are sums of steps, and rounded
            memory = self.effect.step(memory, given, s, dt, _PLANT)
        self._now = (time, s, memory)
        return memory


class MujocoCallbacks:
    """Effects at joints and actuators of a MuJoCo model, which act while it is a context.

    They hold for one ``MjData`` at a time, since MuJoCo's callbacks are global to the process.

    Parameters
    ----------
    model : mujoco.MjModel
        The model.
    effects : sequence of (str, str, mapping)
        Name, port (a joint, two as ``"A and B"``, or an actuator), values in the units of the port. Faults of sensors
        do not act: they are of readings.
    between : sequence of Between, optional
        Pairs of joints with other ratios than 1.

    Raises
    ------
    UnknownOptionError
        The name of an effect is unknown.

    Examples
    --------
    >>> import mujoco
    >>> from pamid.simulators.mujoco_callback import MujocoCallbacks
    >>> xml = "<mujoco><option gravity='0 0 0'/><worldbody><body><joint name='rail' type='slide'/>"
    >>> model = mujoco.MjModel.from_xml_string(xml + "<geom size='0.1' mass='2'/></body></worldbody></mujoco>")
    >>> data = mujoco.MjData(model)
    >>> data.qvel[0] = 1.0
    >>> with MujocoCallbacks(model, [("quadratic_drag", "rail", {"coefficient": 4.0})]):  # N s2/m2
    ...     mujoco.mj_step(model, data, nstep=500)  # 1 s: v = 1 / (1 + 2 t)
    >>> round(float(data.qvel[0]), 2)
    0.33
    """

    def __init__(
        self, model: Any, effects: Sequence[tuple[str, str, Mapping[str, float]]], between: Sequence[Between] = ()
    ) -> None:
        import mujoco

        self._mujoco, self._joints, self._actuators = mujoco, [], []
        known = port_effects()
        for name, where, values in effects:
            kind, _ = known[name]
            effect = in_port_units(name, where, values)
            if kind in ("joint", "link"):
                ends = ends_of(where) or (where,)
                both = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, end) for end in ends]
                ratio = next((b.ratio or 1.0 for b in between if b.name == where), 1.0)
                signs = np.array([1.0, -ratio][: len(both)])
                self._joints.append((model.jnt_qposadr[both], model.jnt_dofadr[both], signs, _Remembered(effect)))
            elif kind == "input":
                at = list(actuators_of(model)).index(where)
                self._actuators.append((int(at), _Remembered(effect)))
        self._asked = np.full(model.nu, np.nan)
        self._given = np.full(model.nu, np.nan)

    def __enter__(self) -> Self:
        self._mujoco.set_mjcb_passive(self._push)
        self._mujoco.set_mjcb_control(self._drive)
        return self

    def __exit__(self, *_: object) -> None:
        self._mujoco.set_mjcb_passive(None)
        self._mujoco.set_mjcb_control(None)

    def _push(self, model: Any, data: Any) -> None:
        for q, dof, signs, kept in self._joints:
            across = signs @ data.qpos[q], signs @ data.qvel[dof]
            s = Signals(position=np.array(across[:1]), velocity=np.array(across[1:]))
            s.time = np.array([data.time])
            x = kept.memory(s, data.time, model.opt.timestep)
            data.qfrc_passive[dof] += signs * float(np.ravel(kept.effect.push(s, x, _PLANT))[0])

    def _drive(self, model: Any, data: Any) -> None:
        # Values written here earlier are not the controller's commands.
        self._asked = np.where(data.ctrl == self._given, self._asked, data.ctrl)
        u = self._asked.copy()
        for at, kept in self._actuators:
            value = u[at : at + 1]
            s = Signals(command=value)
            x = kept.memory(s, data.time, model.opt.timestep)
            u[at] = float(np.ravel(kept.effect.passed(value, s, x, _PLANT))[0])
        data.ctrl[:] = u
        self._given = u


def corrected(page: str | Path) -> tuple[Any, MujocoCallbacks]:
    """Return the model of a simulator file, with its numbers, and its effects as callbacks."""
    simulator = read_simulator(page)
    if not isinstance(simulator, MujocoSimulator):
        raise SimulatorTypeError(f"{page} is a {simulator.kind}.", "a MuJoCo model", "Name its simulator file.")
    model = simulator.compiled()
    return model, MujocoCallbacks(model, simulator.effects, simulator.between)
