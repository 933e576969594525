"""Parameters that another tool fitted, read from the files that it writes, by the names of a simulator's numbers."""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Self

from ..errors import MissingDependencyError, ParameterError, SimulatorFileError, SimulatorNotFoundError
from ..errors import SimulatorSyntaxError as Broken
from ..explained import explained_fields
from ..simulators import MujocoSimulator, Simulator
from ..simulators.ports import ModelParameter
from ..systems import all_systems, read_system
from ..toml_files import TomlErrors, read_small_text, read_toml

_ERRORS = TomlErrors(SimulatorNotFoundError, SimulatorFileError, Broken)
_QUANTITIES = {
    "armature": "dof_armature", "rotor inertia": "dof_armature", "reflected inertia": "dof_armature",
    "viscous friction": "dof_damping", "friction viscous": "dof_damping", "viscous": "dof_damping",
    "joint damping": "dof_damping", "damping": "dof_damping",
    "static friction": "dof_frictionloss", "dry friction": "dof_frictionloss", "coulomb friction": "dof_frictionloss",
    "friction base": "dof_frictionloss", "frictionloss": "dof_frictionloss", "friction loss": "dof_frictionloss",
    "coulomb": "dof_frictionloss", "friction": "dof_frictionloss",
    "body mass": "body_mass", "mass": "body_mass", "gear": "actuator_gear",
    "kp": "actuator_kp", "pgain": "actuator_kp", "p gain": "actuator_kp", "stiffness": "actuator_kp",
    "kv": "actuator_kv", "kd": "actuator_kv", "dgain": "actuator_kv", "d gain": "actuator_kv",
}  # fmt: skip
"""Names of MuJoCo's numbers in other tools, longer names first where one contains another."""
_FILLERS = frozenset(("joint", "dof", "params", "parameters", "actuator", "pos", "value", "best", "mean"))
_PACE = ("armature", "damping", "friction", "bias")
"""What PACE's vector holds of each joint, in this order, before the delay."""
_ORDERS = ("joint_order", "joint_names", "joints", "names")


@dataclass(frozen=True)
class FittedNumber:
    """A number as a tool leaves it."""

    value: float
    """What it fitted."""
    lower: float | None = None
    upper: float | None = None
    """Bounds of its fit."""


@explained_fields
@dataclass(frozen=True)
class FittedParameters:
    """What a tool fitted.

    Examples
    --------
    >>> from pamid.opinion import FittedParameters
    >>> from pamid.opinion.fits import FittedNumber
    >>> FittedParameters({"mass": FittedNumber(2.1)}).numbers["mass"].value
    2.1
    """

    numbers: Annotated[dict[str, FittedNumber], "By the tool's own names, or by those of the simulator after `of`."] = (
        field(default_factory=dict)
    )
    unmatched: Annotated[tuple[str, ...], "Names that match no number of the simulator."] = ()
    model: Annotated[Path | None, "The fitted model or page itself, where that is what the tool writes."] = None
    source: Annotated[str, "The file's name."] = ""

    def of(self, simulator: Simulator) -> Self:
        """Return the fit by the names of a simulator's numbers, with `unmatched`, the names that match none.

        Of a fitted model, the numbers that differ from this simulator's are those fitted. A `ParameterError` says that
        none of the names matches.
        """
        if self.model is not None:
            return self._of_model(simulator)
        known = simulator.fit_numbers()
        found: dict[str, FittedNumber] = {}
        left: list[str] = []
        for name, number in self.numbers.items():
            own = _match(name, known)
            if own is None or own in found:
                left.append(name)
            else:
                found[own] = number
        if not found:
            said = ", ".join(list(self.numbers)[:8]) or "no number"
            raise ParameterError(
                f"{self.source or 'The fit'} names {said}, none of which is a parameter of the simulator.",
                f"some of {', '.join(list(known)[:12])}",
                "Rename them, or add them to [parameters] of the simulator file.",
            )
        return replace(self, numbers=found, unmatched=tuple(left))

    def _of_model(self, simulator: Simulator) -> Self:
        assert self.model is not None
        if self.model.suffix.lower() == ".xml":
            model: Simulator = MujocoSimulator(self.model)
            fitted = model.own_numbers()
        else:
            model = read_system(self.model)
            fitted = model.parameters
        if model.kind != simulator.kind:
            raise ParameterError(
                f"{self.source} is of the kind {model.kind}, the simulator of the kind {simulator.kind}.",
                "fitted values",
                "Give them as JSON.",
            )
        own = simulator.fit_numbers()
        changed = {k: FittedNumber(v.value) for k, v in fitted.items() if k in own and v.value != own[k].value}
        if not changed:
            raise ParameterError(
                f"{self.source} has the same numbers as the simulator.",
                "a model with fitted numbers",
                "Name the model before the fit with --sim, and the fitted one with --after.",
            )
        return replace(self, numbers=changed)


def read_fit(source: str | Path | Mapping[str, Any] | FittedParameters) -> FittedParameters:
    """Read the parameters that another tool fitted.

    Parameters
    ----------
    source : path-like, mapping or FittedParameters
        JSON or YAML of names and values (BAM; PACE, with lists in the order of joints; FMPy's start values), the YAML
        of MuJoCo's sysid with values and bounds, a fitted MJCF, a TOML file, the fitted page of a cylinder, joint or
        muscle, or the values themselves. Nothing in it is run: files that can carry code (``.pt``, ``.pkl``) are
        refused.

    Returns
    -------
    FittedParameters
        The numbers, by the tool's own names.

    Raises
    ------
    SimulatorNotFoundError, SimulatorSyntaxError
        The file cannot be read.
    ParameterError
        It holds no number.

    Examples
    --------
    >>> from pamid.opinion import read_fit
    >>> fit = read_fit({"joint_order": ["hip", "knee"], "armature": [0.01, 0.02], "delay": 0.0095})  # kg m^2, s
    >>> sorted(fit.numbers)
    ['armature.hip', 'armature.knee', 'delay']
    """
    if isinstance(source, FittedParameters):
        return source
    if isinstance(source, Mapping):
        return _of_table(source, "the fit")
    path = Path(source)
    ending = path.suffix.lower()
    if ending == ".xml":
        if not path.is_file():
            raise SimulatorNotFoundError(f"{path} does not exist.", "a fitted MJCF", "Check the path.")
        return FittedParameters(model=path, source=path.name)
    if ending in (".pt", ".pth", ".pkl", ".pickle", ".npy", ".npz"):
        raise Broken(
            f"{path.name} can carry code, and is not opened.",
            "JSON, YAML or TOML of names and values, or a fitted MJCF",
            "Write it in the tool that made it: json.dump({name: float(value)}, file).",
        )
    if ending == ".toml":
        table: Any = read_toml(path, "fitted parameters", _ERRORS)
        if table.get("kind") in all_systems():
            return FittedParameters(model=path, source=path.name)
        table = table.get("parameters", table)
    else:
        table = _parsed(read_small_text(path, "fitted parameters", _ERRORS), path)
    return _of_table(table, path.name)


def _parsed(text: str, path: Path) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        if path.suffix.lower() == ".json":
            raise Broken(f"{path.name} is not valid JSON: {error}.", "complete JSON", "Write it again.") from None
    try:
        import yaml  # type: ignore[import-untyped]
    except ImportError:
        raise MissingDependencyError(
            "PyYAML is not installed.", "the package pyyaml", "Install it: pip install pyyaml, or write JSON."
        ) from None
    try:
        return yaml.safe_load(text)
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        said = " ".join(str(error).split())[:120]
        raise Broken(
            f"{path.name} is not valid YAML: {said}.", "complete YAML of names and values", "Write it again."
        ) from None


def _of_table(table: Any, source: str) -> FittedParameters:
    if not isinstance(table, Mapping):
        raise ParameterError(f"{source} holds no table.", "names and values", "Write {name: value}.")
    names: Any = next((table[k] for k in _ORDERS if _is_names(table.get(k))), [])
    found = dict(_numbers(_by_joint(table, list(names)), "", list(names)))
    if not found:
        raise ParameterError(f"{source} holds no number.", "names and values", "Write {name: value}.")
    return FittedParameters(found, source=source)


def _by_joint(table: Mapping[Any, Any], joints: list[str]) -> dict[Any, Any]:
    """Return a table with PACE's vector of all numbers, if there is one, as lists by joint."""
    many, out = len(joints), dict(table)
    for key, value in table.items():
        numbers = _flat(value)
        if many and len(numbers) == len(_PACE) * many + 1:
            del out[key]
            out |= {word: numbers[k * many : (k + 1) * many] for k, word in enumerate(_PACE)}
            out["delay"] = numbers[-1]
    return out


def _is_names(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str) and all(isinstance(v, str) for v in value)


def _numbers(table: Mapping[Any, Any], above: str, joints: list[str]) -> Iterator[tuple[str, FittedNumber]]:
    for key, value in table.items():
        name = f"{above}.{key}" if above else str(key)
        if isinstance(value, Mapping) and "value" in value:
            yield from _one(name, value, joints)
        elif isinstance(value, Mapping):
            yield from _numbers(value, name, joints)
        else:
            yield from _one(name, {"value": value}, joints)


def _one(name: str, entry: Mapping[str, Any], joints: list[str]) -> Iterator[tuple[str, FittedNumber]]:
    """Yield a number with its bounds, those of a list by joint or by place; what is frozen was not fitted."""
    if entry.get("frozen") is True:
        return
    values = _flat(entry["value"])
    low, high = (_flat(entry.get(k)) for k in ("min_value", "max_value"))
    for k, value in enumerate(values):
        end = "" if len(values) == 1 else f".{joints[k]}" if len(joints) == len(values) else f"[{k}]"
        bounds = [b[k] if len(b) == len(values) else None for b in (low, high)]
        yield f"{name}{end}", FittedNumber(value, *bounds)


def _flat(value: Any) -> list[float]:
    if isinstance(value, str):  # start values of an FMU
        try:
            value = float(value)
        except ValueError:
            return []
    if isinstance(value, bool) or value is None:
        return []
    if isinstance(value, int | float):
        return [float(value)]
    if isinstance(value, Sequence):
        found = [_flat(v) for v in value]
        return [x for part in found for x in part] if all(found) else []
    return []


def _words(name: str) -> list[str]:
    split = re.sub(r"([a-z])([A-Z])", r"\1 \2", name)
    return [w for w in re.findall(r"[a-z]+|\d+", split.lower()) if w not in _FILLERS]


def _match(name: str, known: Mapping[str, ModelParameter]) -> str | None:
    """Return the simulator's number that a tool's name means: the same name, or the same quantity of the same joint."""
    if name in known:
        return name
    plain = "".join(_words(name))
    same = [k for k in known if "".join(_words(k)) == plain]
    if len(same) == 1:
        return same[0]
    text = " ".join(_words(name))
    for said, kind in sorted(_QUANTITIES.items(), key=lambda item: -len(item[0])):
        if not re.search(rf"\b{said}\b", text):
            continue
        rest = re.sub(rf"\b{said}\b", " ", text).split()
        of_kind = [k for k in known if k.startswith(f"{kind}.")]
        fits = [k for k in of_kind if "".join(_words(k.partition(".")[2])) == "".join(rest)]
        fits = fits or (of_kind if len(of_kind) == 1 and not rest else [])
        return fits[0] if len(fits) == 1 else None
    return None
