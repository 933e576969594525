r"""What an effect is: what it adds to the equations, as pure functions of signals and its own memory.

An effect overrides the hooks of the equations that it enters, and no others:

========== ================================================= ==========================================================
hook       returns                                           enters
========== ================================================= ==========================================================
force      ΔF, N                                             tension F = nominal + ΔF
flow       (a, b), kg/s and kg/Pa                            flow into the muscle ṁ = nominal + a + b Ṗ
command    the command that the valve follows                u in the valve equation
supply     the pressure at the valve's inlet, Pa             P_s in the valve equation
valve      Δṁ, kg/s                                          flow through the valve ṁ = nominal + Δṁ
torque     Δτ, N m                                           J q̈ = nominal + Δτ
measure    the reading of a sensor                           the channel that `channel` names
adjust     changed parameters                                the nominal equations themselves
========== ================================================= ==========================================================

Memory (`start`, `step`) is explicit: `step` carries it from one instant to a later one and changes nothing in place.
The same `step` serves the simulator, where it is called from the start of an integration step to each of its stages,
and a log, where `trace` runs it along every run. Written as the exact answer to a signal that moves straight
between the two instants, it is stable for any step width.

Signals go by role, so that one class serves a muscle, a cylinder and a servo: for the muscle, position is the
contraction ratio and velocity its rate; for the joint, angle and angular velocity.
"""

from __future__ import annotations

import copy
from abc import ABC
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache
from operator import attrgetter
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np

from ..errors import ParameterError, UnknownParameterError
from ..explained import explained_fields
from ..names import refuse_others
from ..signals.paths import Path
from ..signals.state import STATE_ROLES, Array, State
from ._sources import explain
from .plant import Plant
from .values import Parameter, checked_value

EQUATIONS = ("force", "flow", "valve", "joint")
"""The equations that can have a gap."""

HOOKS = ("force", "flow", "command", "supply", "valve", "torque", "measure", "adjust")
"""The hooks that an effect may override."""

_ENTERED = {"command": "valve", "supply": "valve", "torque": "joint"} | {name: name for name in EQUATIONS[:3]}
"""The equation that a hook enters, where that does not depend on the effect."""

KINDS = ("bench", "muscle", "actuator", "joint", "motor", "gas")
"""What a diagnosis may be about: the antagonistic bench; one equation of a muscle, of the force of another actuator, of
the torque of a joint or the voltage of its motor, of a flow."""


@explained_fields
@dataclass(slots=True)
class Signals:
    """Signals by role, arrays of one shape (or shapes that broadcast); what an effect does not need stays None.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.effects import Signals
    >>> s = Signals(position=np.array([0.10, 0.12]), pressure=np.array([3.0e5, 3.2e5]))
    >>> float(s.at(0).pressure)  # Pa
    300000.0
    """

    time: Annotated[Array, "s."] = None
    position: Annotated[
        Array, "Contraction ratio and its rate (1/s) of a muscle; angle (rad) and its rate (rad/s) of a joint."
    ] = None
    velocity: Annotated[
        Array, "Contraction ratio and its rate (1/s) of a muscle; angle (rad) and its rate (rad/s) of a joint."
    ] = None
    pressure: Annotated[Array, "Absolute pressure, Pa, and its rate, Pa/s."] = None
    pressure_rate: Annotated[Array, "Absolute pressure, Pa, and its rate, Pa/s."] = None
    command: Annotated[Array, "Valve command, −1 … 1, held from this instant to the next."] = None
    flow: Annotated[Array, "Mass flow into the muscle, kg/s."] = None
    force: Annotated[Array, "Tension, N."] = None

    @classmethod
    def of_state(cls, state: State) -> Signals:
        """Return the signals of a muscle's state by their roles."""
        return cls(**{role: getattr(state, name) for name, role in STATE_ROLES.items()})

    def at(self, index: Any) -> Signals:
        """Return the signals at an index along the first axis."""
        return Signals(*(None if v is None else v[index] for v in _SIGNALS(self)))

    def with_(self, **changes: Array) -> Signals:
        """Return a copy with some signals replaced."""
        changed = Signals(*_SIGNALS(self))
        for role, values in changes.items():
            setattr(changed, role, values)
        return changed


_SIGNALS = attrgetter(*(f.name for f in fields(Signals)))
"""All signals, in the order of their fields."""


@explained_fields
class FlowTerm(NamedTuple):
    """Contribution to the flow equation, linear in the pressure rate: Δṁ = a + b Ṗ.

    Examples
    --------
    >>> from pamid.effects import FlowTerm
    >>> leak = FlowTerm(a=-2e-6, b=0.0)
    >>> leak.a + leak.b * 1e5  # kg/s at a pressure rate of 1 bar/s
    -2e-06
    """

    a: Annotated[Array, "Part without the pressure rate, kg/s."]
    b: Annotated[Array, "Factor of the pressure rate, kg/Pa."]


class Effect(ABC):
    """Something that the nominal equations leave out.

    A subclass states the class attributes below and overrides the hooks of the equations that it enters. Defining it
    is enough: it is then found by `all_effects` and `make_effect`.

    Parameters
    ----------
    **values : float
        Values of the parameters; those left out take their nominal value.

    Attributes
    ----------
    values : dict of str to float
        The parameters' values; each is also an attribute of its own name.

    Examples
    --------
    >>> from pamid.effects import Effect, parameter
    >>> class Preload(Effect):
    ...     'A constant tension.'
    ...     name, family, equations, source = "preload", "elasticity", ("force",), "own measurement"
    ...     tension = parameter("N", 0.0, 50.0, 5.0, "tension of the springs", linear=True)
    ...     def force(self, s, x, plant):
    ...         return self.tension
    >>> Preload(tension=8)
    preload(tension=8 N)
    >>> del Effect.registry["preload"]  # forgets it; not needed in real life
    """

    name: ClassVar[str] = ""
    """Name, unique in the library; without one it is no effect of the library, but of a port."""
    family: ClassVar[str]
    """Family of effects that are alike."""
    equations: ClassVar[tuple[str, ...]] = ()
    """Equations that change, of `EQUATIONS`: by default those that its hooks enter; for a sensor those that read it."""
    parameters: ClassVar[tuple[Parameter, ...]]
    """Parameters, in order: by default the attributes that are one, after those of the base that are not restated."""
    source: ClassVar[str]
    """DOI or standard."""
    roles: ClassVar[tuple[str, ...]] = ()
    """Signals that it reads, of the fields of `Signals`."""
    n_states: ClassVar[int] = 0
    """Number of internal states per muscle (or joint); 0 for an effect without memory."""
    site: ClassVar[str] = "muscle"
    """``"muscle"`` (one for each) or ``"joint"``."""
    path_dependent: ClassVar[bool] = False
    """Whether the memory depends on the path of the position alone, not on time: it then takes one step per
    reversal."""
    holds: ClassVar[bool] = False
    """Whether it holds a motion at rest, by a force that turns over within `turns_within`."""
    sampled: ClassVar[bool] = False
    """Whether the memory moves once per control period rather than continuously."""
    on_braid: ClassVar[bool] = False
    """Whether its force grows with the pressure that presses on the braid, which another effect may hold back."""
    least_difference: ClassVar[float] = 0.0
    """Relative difference of two signals that its equations must tell apart; 0 where rounding only blurs the result."""
    channel: ClassVar[str] = ""
    """Sensor channel that `measure` changes: ``"q"``, ``"P"``, ``"F"`` or ``"mdot"``."""

    kinds: ClassVar[tuple[str, ...]] = KINDS
    """The `KINDS` whose gap it may cause by default; empty if it is only used by name."""
    fastest: ClassVar[float] = 1.0
    """Shortest of its memories, as a share of the time of the one that is at its `Parameter.simplest`."""
    domain: ClassVar[str] = "store"
    """Of an effect on a flow, what is kept where it acts: a ``"store"`` of gas or liquid, or a ``"temperature"``."""
    prior: ClassVar[float] = 0.0
    """Logarithm of the odds with which it is expected: less than 0 for what another effect holds as a special case."""

    extends: ClassVar[str] = ""
    """Name of an effect that it holds as a special case, and whose form it shares."""

    registry: ClassVar[dict[str, type[Effect]]] = {}
    """Effects by name, filled as they are defined."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if "parameters" not in cls.__dict__:
            cls._collect_parameters()
        whole = cls.__doc__ and getattr(cls, "parameters", None) and not cls.__name__.startswith("_")
        if whole and cls.__module__.startswith("pamid.effects."):
            explain(cls)
        if cls.name and not cls.equations:
            cls.equations = tuple(dict.fromkeys(_ENTERED[hook] for hook in cls.hooks() if hook in _ENTERED))
        if "name" not in cls.__dict__:
            return  # a shared base, or of ports alone
        present = Effect.registry.get(cls.name)
        if present is not None and (present.__module__, present.__qualname__) != (cls.__module__, cls.__qualname__):
            raise ParameterError(
                f"{cls.__qualname__} is named {cls.name!r}, as is {present.__qualname__} already.",
                "a name of its own",
                "Choose another name.",
            )
        Effect.registry[cls.name] = cls

    @classmethod
    def _collect_parameters(cls) -> None:
        """Name the parameters among the attributes; a base's one that is a number here is fixed at it."""
        own = {name: replace(p, name=name) for name, p in vars(cls).items() if isinstance(p, Parameter)}
        inherited = getattr(cls, "parameters", ())
        if own or any(p.name in vars(cls) for p in inherited):
            cls.parameters = (*(p for p in inherited if p.name not in vars(cls)), *own.values())

    @classmethod
    def narrowed(
        cls, hidden: Collection[str] = (), parameters: Sequence[Parameter] | None = None, **changes: Any
    ) -> type[Effect]:
        """Return it with some parameters fixed at their nominal values, or bounded anew, and other attributes."""
        kept = tuple(p for p in parameters or cls.parameters if p.name not in hidden)
        fixed = {p.name: p.nominal for p in cls.parameters if p.name in hidden}
        return type(cls.__name__, (cls,), {"parameters": kept, **fixed, **changes})

    def __init__(self, **values: float) -> None:
        known = {p.name: p for p in self.parameters}
        none = "" if known else "none"
        refuse_others(values, known, f"The effect {self.name} has no parameter", none, spelt=repr)
        self.values: dict[str, float] = {}
        for p in self.parameters:
            self.values[p.name] = checked_value(self.name, p, values.get(p.name, p.nominal))
            setattr(self, p.name, self.values[p.name])

    @classmethod
    def in_units(cls, **values: float) -> Effect:
        """Return the effect with all its values in the units of another system than a muscle, whose bounds do not
        apply.

        What has a sign, or is a plain number, keeps its bounds.
        """
        known = {p.name: p for p in cls.parameters}
        values = {**{p.name: p.nominal for p in cls.parameters if p.refines}, **values}
        if set(values) != set(known):
            raise UnknownParameterError(
                f"The effect {cls.name} has {', '.join(values) or 'no parameters'}.",
                f"all of {', '.join(known)}, in the units of the system",
                "Give each parameter of the effect, and no other.",
            )
        sized = {n: p.of_any_size() if p.unit != "-" or p.position else p for n, p in known.items()}
        return cls().unchecked(**{name: checked_value(cls.name, sized[name], v) for name, v in values.items()})

    def __repr__(self) -> str:
        units = {p.name: p.unit for p in self.parameters}
        values = [f"{k}={v:g} {units[k]}".removesuffix(" -") for k, v in self.values.items()]
        return f"{self.name or type(self).__name__}({', '.join(values)})"

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and isinstance(other, Effect) and self.values == other.values

    def __hash__(self) -> int:
        return hash((self.name, tuple(self.values.items())))

    @classmethod
    def hooks(cls) -> tuple[str, ...]:
        """Return the hooks that the effect overrides."""
        return _hooks(cls)

    @classmethod
    def filters_readings(cls) -> bool:
        """Return whether it is a fault of a sensor with memory: undoing it filters the reading's noise."""
        return cls.n_states > 0 and "measure" in cls.hooks()

    def replace(self, **values: float) -> Effect:
        """Return the same effect with some values changed."""
        return type(self)(**{**self.values, **values})

    def unchecked(self, **values: float) -> Self:
        """Return a copy with some values, also beyond their bounds."""
        out = copy.copy(self)
        out.values = {**self.values, **values}
        for name, value in values.items():
            setattr(out, name, value)
        return out

    # --- memory ---------------------------------------------------------------------------------------------
    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return the memory at rest under the signals ``s``, states along the first axis.

        ``dt`` is the sampling interval in s, for memory that holds samples.
        """
        return np.zeros((0,))

    @property
    def turns_within(self) -> float:
        """How far a motion that it holds goes until its force has turned over; 0 where it holds none."""
        return 0.0

    def sharp(self) -> Self:
        """Return it as it holds a motion within the least distance and at any speed."""
        return self

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Return the memory at ``s1`` from the memory ``x`` at ``s0``, ``dt`` seconds before; ``x`` stays as it is."""
        return x

    @classmethod
    def follows_path(cls) -> bool:
        """Return whether it depends on a path alone: on a path without reversals it could be any function of time."""
        return cls.path_dependent or tuple(cls.roles) == ("position",)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the memory along the runs of a log, shape (n_states, n_samples, ...).

        Signals have time along the first axis, ``dt`` is the sampling interval in s, and memory starts afresh at the
        rows ``starts``, of which 0 is the first.
        """
        if not self.n_states:
            return np.zeros((0,))
        used = Signals(**{role: np.asarray(getattr(s, role)) for role in self.roles if getattr(s, role) is not None})
        n = len(next(v for v in (getattr(used, f.name) for f in fields(used)) if v is not None))
        starts = np.asarray(starts, dtype=np.int64)
        if self.path_dependent:
            return self.trace_along(Path(used.position, starts), plant, dt)
        lengths = np.diff(np.append(starts, n))
        # All runs advance together; those that have ended stay at their last row.
        rows = starts[None, :] + np.minimum(np.arange(lengths.max())[:, None], lengths[None, :] - 1)
        before = used.at(rows[0])
        x = self.start(before, plant, dt)
        out = np.empty((x.shape[0], n, *x.shape[2:]))
        out[:, rows[0]] = x
        for k in range(1, len(rows)):
            now = used.at(rows[k])
            x = self.step(x, before, now, dt, plant)
            alive = k < lengths
            out[:, rows[k][alive]] = x[:, alive]
            before = now
        return out

    def trace_along(self, path: Path, plant: Plant, dt: float) -> Array:
        """Return the memory along a path, where that alone decides: a monotone stretch of any length is one step."""
        turns = path.turns
        # All lanes advance from turn to turn together, then all rows from the turn before them at once.
        states = np.empty((self.n_states, *turns.values.shape))
        before = Signals(position=turns.values[0])
        states[:, 0] = self.start(before, plant, dt)
        for k in range(1, len(turns.values)):
            now = Signals(position=turns.values[k])
            states[:, k] = self.step(states[:, k - 1], before, now, dt, plant)
            before = now
        held = states.reshape(self.n_states, -1)[:, turns.last]
        return self.step(held, Signals(position=turns.before), Signals(position=path.position), dt, plant)

    # --- hooks ----------------------------------------------------------------------------------------------
    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the addition to the tension, N."""
        return 0.0

    def braid_pressure(self, s: Signals, plant: Plant) -> Array:
        """Return the pressure that presses on the braid, Pa absolute; the muscle's where nothing is held back."""
        return s.pressure

    def beginnings(self, spans: Mapping[str, float], plant: Plant) -> tuple[tuple[str, float, float], ...]:
        """Return the unknown initial condition of a run: equation, time constant of its decay (s), standard deviation.

        ``spans`` are the ranges of the log's signals, by role.
        """
        return ()

    def elastic(self, seconds: float) -> bool:
        """Return whether most of it does not relax within a run of this length: it is a spring there."""
        return False

    def push(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the addition to what moves a port with a position: force (N) and torque (N m)."""
        return self.force(s, x, plant) + self.torque(s, x, plant)

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return the addition to the flow into the muscle, kg/s, as a + b Ṗ."""
        return FlowTerm(0.0, 0.0)

    def command(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the command that the valve follows when it is given ``u``."""
        return u

    def passed(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return what an input becomes that is given ``u``: as a command, or as a sensor would read it."""
        return self.measure(self.command(u, s, x, plant), x)

    def supply(self, P_supply: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the pressure at the valve's inlet, Pa absolute, where the nominal one is ``P_supply``."""
        return P_supply

    def valve(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the addition to the flow through the valve, kg/s."""
        return 0.0

    def torque(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the addition to the torque on the joint, N m."""
        return 0.0

    def measure(self, value: Array, x: Array) -> Array:
        """Return the reading of the sensor at the true ``value``."""
        return value

    def restore(self, reading: Array, dt: float, starts: Array) -> Array:
        """Return the true values behind the readings of a log, the inverse of `measure` along time."""
        return reading

    def restore_next(self, before: Array, reading: Array, dt: Array) -> Array:
        """Return the true value behind a reading from the one ``dt`` seconds before: `restore` as a step of time."""
        return reading

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return changed parameters of the nominal equations, by their names in a simulator file."""
        return {}


@cache
def _hooks(cls: type[Effect]) -> tuple[str, ...]:
    return tuple(hook for hook in HOOKS if getattr(cls, hook) is not getattr(Effect, hook))
