"""The interface of simulators to the diagnosis: ports, parameters, and one of three forms of the system."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import numpy as np

from ..errors import MissingParameterError, PamidError, ParameterError, SimulatorRunError
from ..explained import explain
from ..face import AnySimulator
from ..files import write_whole
from ..names import refuse_others
from ..toml_files import toml_lines
from .between import Between, ends_of
from .ports import ModelParameter, Port, as_parameters

if TYPE_CHECKING:
    import pandas as pd

    from .problem import Problem


class Carried(NamedTuple):
    """Numbers of a payload on a body."""

    numbers: Mapping[str, str]
    """Names of its mass, as ``"value"``, and of its place, as ``"x"``, ``"y"`` and ``"z"``."""
    centre: tuple[float, ...]
    """Centre of the body, m: where a payload is first looked for."""
    mass: float
    """Mass of the whole, kg."""
    reach: float
    """Size of the whole, m."""


class Limited(NamedTuple):
    """The force of an actuator, which a number of the simulator limits."""

    number: str
    """Name of that number, which is 0 where there is no limit."""
    largest: float
    """Largest force that the actuator has along a motion."""


class Simulator(AnySimulator):
    """A model of a system with ports, of any origin.

    A subclass states its `form` and overrides the methods of that form: ``output`` for an algebraic one; ``rate`` (and
    ``output``, where not every state is one) for one of states; ``run`` for whole runs.

    Parameters
    ----------
    ports : sequence of Port
        Its ports.
    parameters : mapping of str to float, tuple or ModelParameter, optional
        Its numbers: values, or (value, tolerance, unit).
    effects : sequence of (str, str, mapping), optional
        Effects that are part of it: name, port, values of the parameters.

    Raises
    ------
    ParameterError
        Two ports share a name, or one refers to a port that does not exist.

    Examples
    --------
    >>> from pamid.simulators import FunctionSimulator, Port
    >>> ports = [Port("voltage", "input", "V"), Port("speed", "state", "rad/s")]
    >>> motor = FunctionSimulator(lambda t, x, u, p: [(u.voltage - p.k * x.speed) / p.J], ports, {"k": 0.04, "J": 1e-4})
    >>> motor.form, motor.inputs, motor.states
    ('ode', ('voltage',), ('speed',))
    """

    form: str = "ode"
    kind: ClassVar[str] = "function"
    """Kind of its simulator file, see `read_simulator`."""
    kinds: ClassVar[tuple[str, ...]] = ()
    """Kinds that simulator files may name."""
    executes: ClassVar[bool] = True
    """Whether reading a simulator file runs code that it names."""
    any_step: ClassVar[bool] = False
    """Whether runs may take steps of any length, not just those of a log's rows."""
    one_by_one: ClassVar[bool] = False
    """Whether it is evaluated one instant at a time."""
    unsteady: str | None = None
    """What was said of it where it is not repeatable, empty where it is; None until tried."""
    states_equation: ClassVar[bool] = False
    """Whether it states one equation of pamid's own signals, see `problem`, instead of having one of the forms."""
    sense: str | int = 1
    """Of an equation that it states: 1 where effects subtract from the target, -1 where they add to it, or "auto"."""
    settings: ClassVar[tuple[str, ...]] = ()
    """Numbers that say how a log is read: a fit cannot tell them."""
    own_step: float = 0.0
    """Step by which it is integrated wherever it is used, s; 0 where nothing says one."""
    undefined: str = ""
    """What its code last raised where it has no value."""
    between: tuple[Between, ...] = ()
    """Pairs of ports between which effects may act, besides those that it couples itself."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        explain(cls)

    def __init__(
        self,
        ports: Sequence[Port],
        parameters: Mapping[str, Any] | None = None,
        effects: Sequence[tuple[str, str, Mapping[str, float]]] = (),
    ) -> None:
        self.ports = tuple(ports)
        kinds = {p.kind for p in self.ports}
        self._by_kind = {kind: tuple(p.name for p in self.ports if p.kind == kind) for kind in kinds}
        self.parameters: dict[str, ModelParameter] = as_parameters(parameters)
        self.effects: tuple[Any, ...] = tuple((name, where, dict(values)) for name, where, values in effects)
        names = [p.name for p in self.ports]
        if twice := sorted({n for n in names if names.count(n) > 1 or n in self.parameters}):
            raise ParameterError(
                f"{', '.join(twice)} names more than one port or parameter.", "different names", "Rename one."
            )
        for port in self.ports:
            self._check_links(port)

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Return the range of the ports that have one, in their units."""
        return {}

    def plausible(self, name: str) -> tuple[float, float]:
        """Return the plausible range of a number."""
        return -np.inf, np.inf

    def driven(self) -> dict[str, str]:
        """Return the joint that an input drives, by input, where the simulator knows it."""
        return {}

    def _check_links(self, port: Port) -> None:
        for what in ("position", "velocity", "level"):
            named = getattr(port, what)
            if named and not any(p.name == named and p.kind in ("state", "output") for p in self.ports):
                raise ParameterError(
                    f"{what} of the {port.kind} {port.name} is {named!r}.",
                    f"a state or an output: {', '.join((*self.states, *self.outputs)) or 'there is none'}",
                    "Name a state or an output of the simulator.",
                )
        if port.through and port.through not in self.inputs:
            raise ParameterError(
                f"'through' of the {port.kind} {port.name} is {port.through!r}.",
                f"an input: {', '.join(self.inputs) or 'there is none'}",
                "Name the input through which forces act there.",
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its parameters."""
        return tuple(self.parameters)

    @property
    def hidden_states(self) -> tuple[str, ...]:
        """States that only stand inside the model: no log has a column of them."""
        return ()

    @property
    def own_ports(self) -> tuple[Port, ...]:
        """Its ports."""
        return self.ports

    def _of(self, kind: str) -> tuple[str, ...]:
        return self._by_kind.get(kind, ())

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self._of("input")

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return self._of("state")

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self._of("output")

    def port(self, name: str) -> Port:
        """Return a port by its name; raise a `ParameterError` where there is none."""
        for p in self.ports:
            if p.name == name:
                return p
        if name in self.parameters:
            return Port(name, "parameter", self.parameters[name].unit)
        known = [p.name for p in self.ports] + list(self.parameters)
        raise ParameterError(f"There is no port {name!r}.", f"one of {', '.join(known)}", "Correct the name.")

    @property
    def at_once(self) -> bool:
        """Whether a call for many instants takes hardly longer than one for a few."""
        return not self.one_by_one

    @property
    def numbers(self) -> np.ndarray:
        """Values of the parameters, in order."""
        return np.array([p.value for p in self.parameters.values()], dtype=float)

    @property
    def tolerance(self) -> dict[str, float]:
        """Tolerances of the parameters that have one, relative."""
        return {name: p.tolerance for name, p in self.parameters.items() if p.tolerance > 0.0}

    def get(self, name: str) -> float:
        """Return the value of a parameter."""
        return float(self.parameters[name].value)

    def with_(
        self,
        parameters: Mapping[str, float] | None = None,
        effects: Sequence[tuple[str, str, Mapping[str, float]]] | None = None,
        between: Sequence[Between] | None = None,
    ) -> Simulator:
        """Return the same simulator with other values of parameters, other effects, or ports named as pairs.

        Parameters
        ----------
        parameters : mapping of str to float, optional
            New values; the others stay.
        effects : sequence of (str, str, mapping), optional
            All effects: name, port (``"A and B"`` between two), values.
        between : sequence of Between, optional
            All pairs of ports between which effects may act.

        Returns
        -------
        Simulator
            A copy.

        Raises
        ------
        UnknownParameterError
            It has no parameter of such a name.
        """
        refuse_others(parameters or {}, self.parameters, "The simulator has no parameter", remedy="Correct it.")
        out = copy(self)
        changed = {k: replace(self.parameters[k], value=float(v)) for k, v in (parameters or {}).items()}
        out.parameters = {**self.parameters, **changed}
        if effects is not None:
            out.effects = tuple((name, where, dict(values)) for name, where, values in effects)
        if between is not None:
            out.between = tuple(between)
        return out

    def corrected(self, effects: Sequence[Any], sense: int, unit: str) -> Simulator:
        """Return it with further effects on the equation that it states, which act in a sense on a target in a unit."""
        raise NotImplementedError

    def identity(self) -> dict[str, Any]:
        """Return the identity of the simulator: kind, ports, numbers, tolerances and effects, as plain data."""
        return {
            "name": self.kind,
            "kind": self.kind,
            "numbers": {name: float(p.value) for name, p in self.parameters.items()},
            "tolerance": self.tolerance,
            "effects": [[f"{name} at {where}", dict(values)] for name, where, values in self.effects],
            "ports": {p.name: f"{p.kind} in {p.unit}" for p in self.ports},
        }

    # --- its simulator file -------------------------------------------------------------------------------------------
    @classmethod
    def from_page(
        cls, kind: str, table: Mapping[str, Any], ports: Sequence[Port], parameters: Mapping[str, ModelParameter],
        effects: Sequence[tuple[str, str, Mapping[str, float]]], folder: Path,
    ) -> Self:  # fmt: skip
        """Return the simulator of a file from its kind, the table of that name, and the entries of all kinds."""
        raise NotImplementedError

    def page_table(self, folder: Path) -> dict[str, Any]:
        """Return the entries of the table of its kind, files named as seen from a folder."""
        raise NotImplementedError

    def page_text(self, folder: Path) -> str:
        """Return its simulator file, in which files are named as seen from a folder."""
        table = self.page_table(folder)
        lines = ["# Simulator with ports. What each entry means: docs/simulators.md", f'kind = "{self.kind}"', ""]
        lines += [f"[{self.kind}]", *toml_lines(table), "", "[ports]"]
        for port in self.ports:
            own = {f.name: value for f in fields(Port)[2:] if (value := getattr(port, f.name)) != f.default}
            lines += toml_lines({port.name: {"kind": port.kind, **own}})
        none = [name for name, _ in self.joint_inertias().values()]
        none += [name for load in self.carried().values() for name in load.numbers.values()]
        unsaid = dict.fromkeys([*none, *self.limits()], 0.0) | dict(self.dry_joints().values())
        numbers = {n: p for n, p in self.parameters.items() if (p.value, p.tolerance) != (unsaid.get(n), 0.0)}
        if numbers:
            lines += ["", "[parameters]"]
            for name, p in numbers.items():
                said = {"value": float(p.value), "tolerance": float(p.tolerance), "unit": p.unit}
                lines += toml_lines({name: said})
        for b in self.between:
            lines += ["", "[[between]]", *toml_lines({"ends": (b.first, b.second)})]
            lines += toml_lines({"ratio": float(b.ratio)}) if b.ratio is not None else []
            lines += toml_lines({"inertia": b.inertia}) if b.inertia is not None else []
        for name, where, values in self.effects:
            lines += ["", "[[effects]]", *toml_lines({"effect": name, "at": ends_of(where) or where})]
            lines += toml_lines({k: float(v) for k, v in values.items()})
        return "\n".join(lines) + "\n"

    def write_corrected(
        self, stage: Path, folder: Path, read: Callable[[Path], AnySimulator], but: Collection[str] = ()
    ) -> AnySimulator:
        """Write its simulator file, which read again is the same one."""
        write_whole(path := stage / self.corrected_files[0], self.page_text(stage))
        again: Any = read(path)
        known, shown = self.at_rest(), again.at_rest()
        same = known is None or (shown is not None and np.allclose(known, shown, rtol=1e-9, equal_nan=True))
        if list(again.effects) != list(self.effects) or not same:
            raise SimulatorRunError(
                "corrected.toml, read back, is not the simulator that was written.",
                "the simulator of the report",
                "This is a mistake in pamid: please report it.",
            )
        write_whole(path, self.page_text(folder))
        return self

    def at_rest(self) -> np.ndarray | None:
        """Return what it gives at a few instants at rest; None where it has nothing there."""
        t = 0.01 * np.arange(10)
        x, u = (np.zeros((len(names), len(t))) for names in (self.states, self.inputs))
        try:
            if self.form == "run":
                return self.run(t, u, self.numbers, x[:, 0])
            p = np.repeat(self.numbers[:, None], len(t), axis=1)
            return (self.rate if self.form == "ode" else self.output)(t, x, u, p)
        except PamidError:
            return None

    def own_numbers(self) -> dict[str, ModelParameter]:
        """Return the numbers that the model itself has and that a simulator file may give a tolerance."""
        return dict(self.parameters)

    def own_states(self) -> list[Port]:
        """Return states of the model whose start values may be set and that are no ports."""
        return []

    def fit_numbers(self) -> dict[str, ModelParameter]:
        """Return the numbers that another tool may have fitted."""
        return {n: p for n, p in {**self.own_numbers(), **self.parameters}.items() if n not in self.settings}

    def freed(self, parameters: Mapping[str, ModelParameter]) -> Simulator:
        """Return a copy with further parameters, or others."""
        out = self.with_()
        out.parameters = {**self.parameters, **parameters}
        return out

    def as_fitted(self, model: Path, kept: Collection[str]) -> Simulator:
        """Return the simulator of a model that another tool wrote, with some parameters as they are here."""
        return self

    def pieces(self, logs: Iterable[pd.DataFrame]) -> Iterable[pd.DataFrame]:
        """Return the pieces of a log that it can be evaluated on one by one."""
        return logs

    def spoken(self, log: pd.DataFrame, columns: Mapping[str, str]) -> dict[str, str]:
        """Return plain names of the state that effects read, of which `columns` are names in a log."""
        return {k: {"eps": "position", "deps": "speed"}.get(k, k) for k in columns}

    def fitted_to(self, logs: Mapping[str, pd.DataFrame]) -> Simulator:
        """Return it with the numbers that are fitted to logs, shared by all of them."""
        return self

    def joint_inertias(self) -> dict[str, tuple[str, float]]:
        """Return for each joint the number to which additional inertia is added, and its present inertia."""
        return {}

    def dry_joints(self) -> dict[str, tuple[str, float]]:
        """Return for each joint the number that is dry friction in the model's own solver, and its value there."""
        return {}

    def carried(self) -> dict[str, Carried]:
        """Return for each body that may carry a payload the numbers of one."""
        return {}

    def limits(self) -> tuple[str, ...]:
        """Return the numbers that limit forces of actuators inside the model, 0 where they do not."""
        return ()

    def limited(self, x: np.ndarray, u: np.ndarray) -> dict[str, Limited]:
        """Return for each actuator with such a number it and the largest force along states and inputs, by input."""
        return {}

    @staticmethod
    def text_of(table: Mapping[str, Any], name: str, others: Sequence[str] = ()) -> str:
        """Return the required text entry of a simulator file's table; raise on any others."""
        refuse_others(table, (name, *others), "The simulator file has")
        value = table.get(name)
        if not isinstance(value, str) or not value:
            raise MissingParameterError(f"{name} is {value!r}.", "text in quotes", f'Write {name} = "...".')
        return value

    # --- the forms ------------------------------------------------------------------------------------------
    def problem(self, log: pd.DataFrame) -> Problem:
        """Return the one equation that it states, on a log."""
        raise NotImplementedError

    def rate(self, t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return the rates of the states, shape (n_states, n); t (n,), x (n_states, n), u (n_inputs, n), p (n_p, n)."""
        raise NotImplementedError

    def own_steps(
        self, x: np.ndarray, starts: np.ndarray, ends: np.ndarray, p: np.ndarray, dt: float, step: float,
        exact: int = 0,
    ) -> np.ndarray | None:  # fmt: skip
        """Return the states a sample of dt later, inputs going straight from starts to ends, by its own integrator.

        In steps of about `step` s, or for 0 in so many of the Runge-Kutta method, by default as good as exact; None
        where it has no integrator of its own.
        """
        return None

    def closed(self, x: np.ndarray, known: Collection[str], along: bool = False) -> np.ndarray:
        """Return states, shape (n_states, n), those that are not known where they leave no loop of the model open.

        The nearest such ones; `along` a path, nearest to the one before.
        """
        return x

    def output(self, t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return the outputs, shape (n_outputs, n)."""
        raise NotImplementedError

    def inertia(self, x: np.ndarray) -> np.ndarray | None:
        """Return the matrix from rates of the velocities to forces, shape (n, n_velocities, n_velocities), or None."""
        return None

    def run(self, t: np.ndarray, u: np.ndarray, p: np.ndarray, x0: np.ndarray) -> np.ndarray:
        """Return the outputs of a run, shape (n_outputs, n); t (n,), u (n_inputs, n), p (n_p,), x0 (n_states,)."""
        raise NotImplementedError

    def runs(self, t: np.ndarray, u: np.ndarray, p: np.ndarray, x0: np.ndarray) -> np.ndarray:
        """Return several runs of the same times, shape (n_runs, n_outputs, n); a run's arrays are stacked first."""
        return np.stack([self.run(t, *one) for one in zip(u, p, x0, strict=True)])
