"""A MuJoCo model as a simulator: joints, actuators and sensors are ports, residuals are torques of inverse dynamics."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from ..errors import ParameterError, SimulatorSyntaxError
from ..face import AnySimulator
from ..files import named_from, write_whole
from .base import Carried, Limited, Simulator
from .integrate import STEPS
from .mujoco_actuators import FED_BACK, FORCE, SERVO, ForceRange, Gain
from .mujoco_body import PAYLOAD, PLACE, Body, hands
from .mujoco_commands import gains_last, taken_delays
from .mujoco_loading import given_state, loaded_model, running
from .mujoco_loading import mujoco_module as _mujoco
from .mujoco_loops import Loops
from .mujoco_pieces import KeptPieces
from .mujoco_samples import SingleSteps, rolled
from .mujoco_versions import rolls_out, write_full_inertia
from .mujoco_written import CALLBACKS, NUMBERS, written
from .ports import ModelParameter, Port, merged

_UNITS = {
    "body_mass": ("kg", "kg"), "dof_damping": ("N m s/rad", "N s/m"), "dof_armature": ("kg m^2", "kg"),
    "dof_frictionloss": ("N m", "N"), "jnt_stiffness": ("N m/rad", "N/m"), "actuator_gear": ("-", "-"),
    "actuator_kp": ("N m/rad", "N/m"), "actuator_kv": ("N m s/rad", "N s/m"), FORCE: ("N m", "N"),
    "payload_mass": ("kg", "kg"), **dict.fromkeys(PLACE, ("m", "m")),
}  # fmt: skip
"""Units at a hinge and at a slide."""
_IN_REST = ("body_mass", "payload", "dof_armature", "actuator_gear")
"""Numbers from which MuJoCo computes others where the model begins."""


class MujocoSimulator(Simulator):
    """A MuJoCo model (MJCF) whose joints are hinges, slides, or free.

    For a joint ``arm`` there are the states ``arm_q`` and ``arm_dq``, an input ``arm_tau`` (a torque there in addition
    to the actuators, 0 by default) and the joint ``arm``; each actuator is an input, each scalar sensor an output. An
    actuator named like the joint is the input ``arm_ctrl``. A body that moves freely has the slides ``x``, ``y`` and
    ``z`` and the hinges ``yaw``, ``pitch`` and ``roll``, turned in this order; of several, ``BODY_x`` and so on.

    Parameters
    ----------
    model : path-like
        An ``.xml`` file.
    ports : sequence of Port, optional
        Ports whose columns, units or starts differ from the model's own.
    parameters : mapping, optional
        Numbers of the model with tolerances, named ``body_mass.NAME``, ``dof_damping.NAME``, ``dof_armature.NAME``,
        ``dof_frictionloss.NAME``, ``jnt_stiffness.NAME``, ``actuator_gear.NAME`` or, of a servo, ``actuator_kp.NAME``,
        ``actuator_kv.NAME`` and ``actuator_forcerange.NAME``; a plain number is the value itself, not a factor.
    effects : sequence of (str, str, mapping), optional
        Effects that are part of it. Delays of the model's own actuators are effects, too; one that is given at the same
        actuator replaces it.

    Raises
    ------
    MissingDependencyError
        MuJoCo is not installed.
    SimulatorSyntaxError
        The file is not valid MJCF, or has joints or actuators of other kinds.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> from pamid.simulators.mujoco_model import MujocoSimulator
    >>> xml = '<mujoco><worldbody><body><joint name="arm"/><geom size="0.1" pos="0.3 0 0"/></body></worldbody></mujoco>'
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = (pathlib.Path(folder) / "arm.xml").write_text(xml)
    ...     MujocoSimulator(pathlib.Path(folder) / "arm.xml").states
    ('arm_q', 'arm_dq')
    """

    kind: ClassVar[str] = "mujoco"
    kinds: ClassVar[tuple[str, ...]] = ("mujoco",)
    executes: ClassVar[bool] = False
    one_by_one: ClassVar[bool] = True
    corrected_files: ClassVar[tuple[str, ...]] = ("corrected.toml", "corrected.xml", "corrected.py")

    def __init__(
        self,
        model: str | Path,
        ports: Sequence[Port] = (),
        parameters: Mapping[str, Any] | None = None,
        effects: Sequence[tuple[str, str, Mapping[str, float]]] = (),
    ) -> None:
        self.path = Path(model)
        self._m = _loaded(self.path)
        delays = taken_delays(self._m)
        self._given = given_state(self.path, self._m)
        self._d = _mujoco().MjData(self._m)
        self._joints = _names(self._m, "joint")
        _mujoco().mj_forward(self._m, self._d)
        self._own_inertias = np.diag(write_full_inertia(self._m, self._d, np.zeros((self._m.nv, self._m.nv)))).copy()
        self._actuators = actuators_of(self._m)
        self._inputs = [*self._actuators, *(f"{j}_tau" for j in self._joints)]
        given = dict(parameters or {})
        self._hands = {_names(self._m, "body")[k]: k for k in hands(self._m)}
        own = {f"dof_armature.{j}": float(a) for j, a in zip(self._joints, self._m.dof_armature, strict=True)}
        dry = zip(self._joints, self._m.dof_frictionloss, strict=True)  # as loaded: an evaluation changes it
        self._dry = {j: (f"dof_frictionloss.{j}", float(loss)) for j, loss in dry}
        own |= dict(self._dry.values())
        own |= {f"{kind}.{body}": 0.0 for kind in PAYLOAD for body in self._hands}
        ranked = list(self._actuators.values())
        own |= {f"{FORCE}.{n}": ForceRange(self._m, ranked.index(n))[0] for n in self._bearers(FORCE)}
        for name, value in own.items():  # none by default, but a model may lack some
            given.setdefault(name, ModelParameter(value, 0.0, self._unit(name)))
        self._bodies: dict[int, Body] = {}
        effects, delayed = list(effects), {where for name, where, _ in effects if name == "actuator_delay"}
        for k, name in enumerate(self._actuators):
            if k in delays and name not in delayed:
                effects.append(("actuator_delay", name, {"delay": delays[k]}))
        super().__init__(merged(self._own_ports(), ports), given, effects)
        self._slots = [self._slot(name) for name in self.parameters]
        self._nominal = [np.array(array[at]) for array, at in self._slots]
        self._in_rest = [name.startswith(_IN_REST) for name in self.parameters]
        self._has = np.array([float(v) for v in self._nominal])
        self._pieces = KeptPieces(self._m, self._d, self._each)
        fourth_order = int(_mujoco().mjtIntegrator.mjINT_RK4)
        self.own_step = 0.0 if int(self._m.opt.integrator) == fourth_order else float(self._m.opt.timestep)

    def _own_ports(self) -> list[Port]:
        m = self._m
        found = [Port(name, "input", _unit_of(m, k)) for k, name in enumerate(self._actuators)]
        for k, name in enumerate(self._joints):
            angle, torque = ("rad", "N m") if self._turns(k) else ("m", "N")
            found += [
                Port(f"{name}_q", "state", angle, start=float(m.qpos0[k])),
                Port(f"{name}_dq", "state", f"{angle}/s"),
                Port(f"{name}_tau", "input", torque),
                Port(name, "joint", torque, position=f"{name}_q", velocity=f"{name}_dq", through=f"{name}_tau"),
            ]
        taken = {p.name for p in found}
        names = [n for k, n in enumerate(_names(m, "sensor")) if m.sensor_dim[k] == 1]
        return found + [Port(f"{n}_sensor" if n in taken else n, "output") for n in names]

    def _turns(self, k: int) -> bool:
        """Return whether a joint is a hinge."""
        return int(self._m.jnt_type[k]) == int(_mujoco().mjtJoint.mjJNT_HINGE)

    def _unit(self, name: str) -> str:
        """Return the unit of a number of the model."""
        kind, _, of = name.partition(".")
        turning, sliding = _UNITS[kind]
        if kind in SERVO:
            at = list(self._actuators.values()).index(of)
            return turning if _unit_of(self._m, at).startswith("rad") else sliding
        return turning if NUMBERS[kind] == "joint" and self._turns(self._joints.index(of)) else sliding

    def joint_inertias(self) -> dict[str, tuple[str, float]]:
        """Return for each joint its armature, and its inertia where the model begins."""
        return {j: (f"dof_armature.{j}", float(M)) for j, M in zip(self._joints, self._own_inertias, strict=True)}

    def dry_joints(self) -> dict[str, tuple[str, float]]:
        """Return the ``frictionloss`` of each joint."""
        return self._dry

    def carried(self) -> dict[str, Carried]:
        """Return for each body that may carry a payload the numbers of one."""
        m = self._m
        return {
            body: Carried(
                {"value": f"payload_mass.{body}"} | {name[-1]: f"{name}.{body}" for name in PLACE},
                tuple(map(float, m.body_ipos[k])), float(m.body_subtreemass[0]), float(m.stat.extent),
            )
            for body, k in self._hands.items()
        }  # fmt: skip

    def limits(self) -> tuple[str, ...]:
        """Return the numbers that limit the forces of servos."""
        return tuple(f"{FORCE}.{name}" for name in self._bearers(FORCE))

    def limited(self, x: np.ndarray, u: np.ndarray) -> dict[str, Limited]:
        """Return for each servo the number that limits its force, and the largest force along a motion."""
        numbers = set(self.limits())
        there = [(k, name, f"{FORCE}.{of}") for k, (name, of) in enumerate(self._actuators.items())]
        if not numbers or not x.shape[1]:
            return {}
        p = np.repeat(self.numbers[:, None], x.shape[1], axis=1)
        forces = np.abs(self._each(x, u, p, self._m.nu, lambda: self._d.actuator_force))
        return {name: Limited(number, float(np.nanmax(forces[k]))) for k, name, number in there if number in numbers}

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Return the ranges of joints that have stops, and of commands that are limited."""
        m, found = self._m, {}
        for k, name in enumerate(self._joints):
            if m.jnt_limited[k]:
                found[f"{name}_q"] = (float(m.jnt_range[k, 0]), float(m.jnt_range[k, 1]))
        for k, name in enumerate(self._actuators):
            if m.actuator_ctrllimited[k]:
                found[name] = (float(m.actuator_ctrlrange[k, 0]), float(m.actuator_ctrlrange[k, 1]))
        return found

    def driven(self) -> dict[str, str]:
        """Return the joint of each actuator that acts on one."""
        m, at = self._m, int(_mujoco().mjtTrn.mjTRN_JOINT)
        return {
            name: self._joints[int(m.actuator_trnid[k, 0])]
            for k, name in enumerate(self._actuators)
            if int(m.actuator_trntype[k]) == at
        }

    def _slot(self, name: str) -> tuple[Any, Any]:
        """Return the array of the model that holds a parameter, and where."""
        kind, _, thing = name.partition(".")
        if thing not in self._bearers(kind):
            known = [f"{k}.{n}" for k in NUMBERS for n in self._bearers(k)]
            raise ParameterError(f"The model has no {name!r}.", f"one of {', '.join(known[:30])}", "Correct the name.")
        at: Any = _names(self._m, NUMBERS[kind]).index(thing)
        if NUMBERS[kind] == "body":
            return self._bodies.setdefault(at, Body(self._m, at)), kind
        if kind in FED_BACK:
            return Gain(self._m, at), FED_BACK[kind]
        if kind == FORCE:
            return ForceRange(self._m, at), 0
        return getattr(self._m, kind), (at, 0) if kind == "actuator_gear" else at

    def _bearers(self, kind: str) -> list[str]:
        """Return the elements that have a number of a kind: only servos have gains."""
        if kind in PAYLOAD:
            return list(self._hands)
        names = _names(self._m, NUMBERS[kind]) if kind in NUMBERS else []
        return [n for k, n in enumerate(names) if _unit_of(self._m, k) != "-"] if kind in SERVO else names

    @classmethod
    def from_page(
        cls, kind: str, table: Mapping[str, Any], ports: Sequence[Port], parameters: Mapping[str, ModelParameter],
        effects: Sequence[tuple[str, str, Mapping[str, float]]], folder: Path,
    ) -> Self:  # fmt: skip
        """Return the simulator of a file; its table has ``model``, the ``.xml`` file."""
        return cls(folder / cls.text_of(table, "model"), ports, parameters, effects)

    def page_table(self, folder: Path) -> dict[str, Any]:
        """Return the entries of the simulator file's table."""
        return {"model": named_from(self.path, folder)}

    def number(self, name: str) -> float:
        """Return a number that the model has, by the name of a parameter."""
        array, at = self._slot(name)
        return float(array[at])

    def own_numbers(self) -> dict[str, ModelParameter]:
        """Return the numbers of the model that are not zero."""
        found = {}
        for kind in NUMBERS:
            for name in self._bearers(kind) if kind != "actuator_kv" else ():  # kv is damping of the joint
                array, at = self._slot(f"{kind}.{name}")
                if float(array[at]) != 0.0:
                    found[f"{kind}.{name}"] = ModelParameter(float(array[at]), 0.0, self._unit(f"{kind}.{name}"))
        return found

    def fit_numbers(self) -> dict[str, ModelParameter]:
        """Return the numbers that another tool may have fitted, those that are zero among them."""
        found = super().fit_numbers()
        for joint in (p.name for p in self.ports if p.kind == "joint"):
            for kind in ("dof_damping", "dof_frictionloss", "dof_armature"):
                found.setdefault(f"{kind}.{joint}", ModelParameter(0.0, unit=self._unit(f"{kind}.{joint}")))
        for name in [n for n in found if n.startswith("actuator_kp.")]:
            damping = f"actuator_kv.{name.partition('.')[2]}"
            found.setdefault(damping, ModelParameter(self.number(damping), unit=self._unit(damping)))
        return found

    def freed(self, parameters: Mapping[str, ModelParameter]) -> Simulator:
        """Return a copy with further parameters, or others; further ones need a model of their own."""
        if parameters.keys() <= self.parameters.keys():
            return super().freed(parameters)
        return type(self)(self.path, self.ports, {**self.parameters, **parameters}, self.effects)

    def as_fitted(self, model: Path, kept: Collection[str]) -> Self:
        """Return the simulator of a model that another tool wrote, with some parameters as they are here."""
        own = {n: self.parameters[n] for n in kept if n in self.parameters}
        return type(self)(model, self.ports, own, self.effects)

    def _set(self, numbers: np.ndarray) -> None:
        moved = False
        for k in (numbers != self._has[: len(numbers)]).nonzero()[0].tolist():
            (array, at), value = self._slots[k], numbers[k]
            moved = moved or self._in_rest[k]
            array[at] = self._has[k] = value
        if moved:
            _mujoco().mj_setConst(self._m, self._d)

    def own_steps(
        self, x: np.ndarray, starts: np.ndarray, ends: np.ndarray, p: np.ndarray, dt: float, step: float,
        exact: int = STEPS,
    ) -> np.ndarray:  # fmt: skip
        """Return the states a sample later by MuJoCo's own integrator, or for steps of 0 by its Runge-Kutta method."""
        m = self._m
        count, known = max(round(dt / step), 1) if step > 0.0 else exact, (m.opt.timestep, m.opt.integrator)

        def singly(some: Any) -> np.ndarray:
            way = SingleSteps(m, self._d, starts[:, some], ends[:, some], count)
            found = self._each(x[:, some], starts[:, some], p[:, some], len(x), way.read, advance=way.advance)
            return np.where(np.isfinite(ends[:, some]).all(axis=0), found, np.nan)

        m.opt.timestep = dt / count
        m.opt.integrator = known[1] if step > 0.0 else _mujoco().mjtIntegrator.mjINT_RK4
        try:
            if not (rolls_out() and x.shape[1] and np.array_equal(p, np.repeat(p[:, :1], x.shape[1], axis=1))):
                return singly(slice(None))
            self._set(p[:, 0])
            with running(self.path):
                out = rolled(m, x, starts, ends, count)
            lost = np.flatnonzero(np.isnan(out).any(axis=0))  # some of them by a mere warning
            out[:, lost] = singly(lost)
            return out
        finally:
            m.opt.timestep, m.opt.integrator = known

    def _each(
        self, x: np.ndarray, u: np.ndarray, p: np.ndarray, size: int, read: Callable[[], np.ndarray],
        sensors: bool = False, advance: Callable[[int], None] | None = None,
    ) -> np.ndarray:  # fmt: skip
        """Return readings of the model at many instants, or once it went on from there; NaN where one is not finite."""
        mj, m, d, n, spec = _mujoco(), self._m, self._d, x.shape[1], self._given
        stage, put, forward = int(mj.mjtStage.mjSTAGE_NONE), mj.mj_setState, mj.mj_forwardSkip
        out, given, numbers = np.full((n, size), np.nan), np.empty((n, len(x) + len(u))), np.ascontiguousarray(p.T)
        given[:, : m.nv], given[:, m.nv : 2 * m.nv], given[:, 2 * m.nv :] = x[0::2].T, x[1::2].T, u.T
        rows: Iterable[int] = range(n)
        if not (np.isfinite(given).all() and np.isfinite(numbers).all()):
            rows = np.flatnonzero(np.isfinite(given).all(axis=1) & np.isfinite(numbers).all(axis=1)).tolist()
        differs, at = (numbers[1:] != numbers[:-1]).any(axis=1).tolist(), -1
        with running(self.path):
            for k in rows:
                if at < 0 or any(differs[at:k]):
                    self._set(numbers[k])
                at = k
                put(m, d, given[k], spec)
                if advance is None:
                    forward(m, d, stage, not sensors)
                else:
                    advance(k)
                out[k] = read()
        return out.T

    def rate(self, t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return velocities and accelerations, shape (n_states, n)."""
        out = np.empty_like(x)
        out[0::2] = x[1::2]
        pieces = self._pieces.find(x, u, p)
        acceleration = self._d.qacc
        out[1::2] = self._each(x, u, p, self._m.nv, lambda: acceleration) if pieces is None else pieces(u)
        return out

    def closed(self, x: np.ndarray, known: Collection[str], along: bool = False) -> np.ndarray:
        """Return states, those that are not known where they satisfy the equality constraints of the model."""
        if not self._m.neq or set(self.states) <= set(known) or not np.isfinite(x).all():
            return x
        with running(self.path):
            return Loops(self._m, self._d).closed(x, [s in known for s in self.states], along)

    def output(self, t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return the readings of the scalar sensors, shape (n_outputs, n)."""
        at = self._m.sensor_adr[self._m.sensor_dim == 1]
        return self._each(x, u, p, len(at), lambda: self._d.sensordata[at], sensors=True)

    def inertia(self, x: np.ndarray) -> np.ndarray:
        """Return the inertia matrix of the joints, shape (n, n_joints, n_joints)."""
        n = self._m.nv
        full = np.zeros((n, n))
        still, numbers = np.zeros((len(self._inputs), x.shape[1])), np.repeat(self.numbers[:, None], x.shape[1], axis=1)
        found = self._each(x, still, numbers, n * n, lambda: write_full_inertia(self._m, self._d, full).ravel())
        return found.T.reshape(-1, n, n)

    def in_elements(self, but: Collection[str] = ()) -> MujocoSimulator:
        """Return the simulator with those of its effects that MJCF has elements for as numbers of its model.

        Viscous friction becomes ``damping``, dry friction ``frictionloss``, the gain of a motor its gear unless an
        effect on its command comes later that a gain would change, a payload a body of its own.

        Parameters
        ----------
        but : collection of str, default=()
            Names of effects that stay effects; where one of them is dry friction, the joint's own ``frictionloss`` is
            stated.
        """
        numbers, rest = dict(self.parameters), []
        for name in (n for load in self.carried().values() for n in load.numbers.values()):
            numbers[name] = replace(numbers[name], value=0.0)

        def change(key: str, factor: float, more: float) -> None:
            array, at = self._slot(key)
            own = numbers.get(key, ModelParameter(float(array[at]), unit=self._unit(key)))
            numbers[key] = replace(own, value=factor * float(own.value) + more)

        for name, where, values, last in gains_last(self.effects):
            if name == "coulomb_friction" and where in self._joints:
                change(f"dof_frictionloss.{where}", 1.0, 0.0 if name in but else values["amplitude"])
                rest += [(name, where, values)] if name in but else []
            elif name == "viscous_friction" and where in self._joints:
                change(f"dof_damping.{where}", 1.0, values["coefficient"])
            elif last and where in self._actuators and not self._feeds_back(where):
                change(f"actuator_gear.{self._actuators[where]}", 1.0 + values["deviation"], 0.0)
            else:
                rest.append((name, where, values))
        out = type(self)(self.path, self.ports, numbers, rest)
        return out.with_(between=self.between)  # type: ignore[return-value]

    def _feeds_back(self, where: str) -> bool:
        """Return whether an actuator is a servo, whose gear also scales its feedback."""
        at = list(self._actuators).index(where)
        return int(self._m.actuator_biastype[at]) != int(_mujoco().mjtBias.mjBIAS_NONE)

    def compiled(self) -> Any:
        """Return the model for MuJoCo itself, with the values of the parameters; delays in it are effects."""
        self._set(np.asarray(self.numbers, dtype=float))
        return copy(self._m)

    def corrected_xml(self) -> tuple[str, list[tuple[str, str, dict[str, float]]]]:
        """Return the model with those of its effects and numbers that MJCF has elements for, and the other effects.

        See `in_elements`; the gain of a servo's command becomes its ``gainprm``, a delay of a command ``delay``, its
        saturation ``ctrlrange``. Parameters are written as they stand.

        Returns
        -------
        text : str
            MJCF.
        rest : list of (str, str, dict)
            Effects that MJCF has no element for.
        """
        return written(self, self._actuators)

    @property
    def inexact(self) -> tuple[str, ...]:
        """Names of effects for which the elements of MJCF are not quite the same: no displacement before sliding."""
        return ("coulomb_friction",) if any(name == "coulomb_friction" for name, *_ in self.effects) else ()

    def write_corrected(
        self, stage: Path, folder: Path, read: Callable[[Path], AnySimulator], but: Collection[str] = ()
    ) -> AnySimulator:
        """Write the corrected model with its simulator file and callbacks; return what they say."""
        page, model, callbacks = (stage / name for name in self.corrected_files)
        text, rest = self.corrected_xml()
        shown = self.in_elements(but)
        rest = [*(e for e in shown.effects if e[0] in but), *rest]
        write_whole(model, text)
        said = shown.with_({}, rest).page_text(folder)
        write_whole(page, re.sub(r"(?m)^model = .*$", 'model = "corrected.xml"', said, count=1))
        if rest:
            write_whole(callbacks, CALLBACKS)
        return read(page)

    def own(self, name: str) -> float:
        """Return a parameter's value in the model as it was loaded."""
        return float(self._nominal[list(self.parameters).index(name)])


def _loaded(path: Path) -> Any:
    mj, m = _mujoco(), loaded_model(path)
    straight = (int(mj.mjtJoint.mjJNT_HINGE), int(mj.mjtJoint.mjJNT_SLIDE))
    if m.njnt == 0:
        raise SimulatorSyntaxError(f"{path} has no joints.", "at least one joint", "Add the joints that move.")
    if any(int(t) not in straight for t in m.jnt_type):
        only = "only hinges, slides and free joints"
        raise SimulatorSyntaxError(f"{path} has ball joints.", only, "Replace each by three hinges.")
    if m.na:
        raise SimulatorSyntaxError(
            f"{path} has actuators with states of their own.",
            "actuators without dynamics",
            "Leave their dynamics out, and add the effect actuator_lag instead.",
        )
    return m


def _names(m: Any, what: str) -> list[str]:
    mj = _mujoco()
    kind, count = {
        "joint": (mj.mjtObj.mjOBJ_JOINT, m.njnt), "actuator": (mj.mjtObj.mjOBJ_ACTUATOR, m.nu),
        "sensor": (mj.mjtObj.mjOBJ_SENSOR, m.nsensor), "body": (mj.mjtObj.mjOBJ_BODY, m.nbody),
    }[what]  # fmt: skip
    return [mj.mj_id2name(m, kind, k) or f"{what}{k}" for k in range(count)]


def actuators_of(m: Any) -> dict[str, str]:
    """Return the inputs that the actuators of a model are, with the names that they have there."""
    joints = _names(m, "joint")
    taken = {*joints, *(f"{j}{end}" for j in joints for end in ("_q", "_dq", "_tau"))}
    return {f"{n}_ctrl" if n in taken else n: n for n in _names(m, "actuator")}


def _unit_of(m: Any, k: int) -> str:
    """Return the unit of an actuator's command where it is a position or a speed of its joint."""
    mj = _mujoco()
    at_joint = int(m.actuator_trntype[k]) == int(mj.mjtTrn.mjTRN_JOINT)
    if not at_joint or int(m.actuator_biastype[k]) != int(mj.mjtBias.mjBIAS_AFFINE):
        return "-"
    turns = int(m.jnt_type[m.actuator_trnid[k, 0]]) == int(mj.mjtJoint.mjJNT_HINGE)
    angle, (stiffness, damping) = "rad" if turns else "m", -m.actuator_biasprm[k, 1:3]
    return angle if stiffness > 0.0 else f"{angle}/s" if damping > 0.0 else "-"
