"""A corrected FMU: a wrapper around the original one, whose inputs and outputs have the effects that were found."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..effects.base import Signals
from ..effects.plant import Surroundings
from ..errors import ExportError
from ..export.c_source import Writer, fill, statements
from ..export.expression import as_symbol, symbol
from ..export.fmu import binary_folder, compiled, packed
from .between import ends_of
from .catalogue import in_port_units, port_effects
from .fmu_model import FmuSimulator
from .fmu_worker import MOST_UNPACKED

SUBSTEPS = 10
"""Steps of the original per step of the wrapper; the signals that a force depends on are read before each."""
_ABSENT = (
    "GetFMUstate", "SetFMUstate", "FreeFMUstate", "SerializedFMUstateSize", "SerializeFMUstate", "DeSerializeFMUstate",
    "GetDirectionalDerivative", "SetRealInputDerivatives", "GetRealOutputDerivatives", "GetStatus", "GetRealStatus",
    "GetIntegerStatus", "GetBooleanStatus", "GetStringStatus",
)  # fmt: skip
_GASES = ("Pa", "hPa", "kPa", "bar", "MPa")


def wrapped(simulator: FmuSimulator, compiler: str | None = None) -> bytes:
    """Return an FMU that wraps the original with a simulator's effects and parameters."""
    with zipfile.ZipFile(simulator.path) as archive:
        if sum(i.file_size for i in archive.infolist()) > MOST_UNPACKED:
            large = f"{simulator.path.name} unpacks to more than {MOST_UNPACKED / 1e6:g} MB."
            raise ExportError(large, "a smaller FMU", "Check the file.")
        inside = {i.filename: archive.read(i) for i in archive.infolist() if not i.is_dir()}
    root = ET.fromstring(inside["modelDescription.xml"])
    described = root.find("CoSimulation")
    version = root.get("fmiVersion")
    if version != "2.0" or described is None:
        raise ExportError(
            f"{simulator.path.name} is of FMI {version}{'' if described is not None else ', without co-simulation'}.",
            "FMI 2.0 with co-simulation",
            "Use the corrected simulator file instead of an FMU.",
        )
    folder, ending = binary_folder(2)
    library = f"binaries/{folder}/{described.get('modelIdentifier')}{ending}"
    if ending == ".dll" or library not in inside:
        raise ExportError(
            f"{simulator.path.name} has no binary that can be wrapped here ({library}).",
            "a binary for this machine, under Linux or macOS",
            "Use the corrected simulator file instead of an FMU.",
        )
    name = re.sub(r"\W", "_", f"{described.get('modelIdentifier')}_corrected")
    code = {f"{name}.c": _source(simulator, root, name, library)}
    _rename(root, name, simulator.start_values())
    entries = {f"resources/original/{k}": v for k, v in inside.items() if not k.startswith("documentation/")}
    entries["modelDescription.xml"] = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    entries[f"binaries/{folder}/{name}{ending}"] = compiled(code, compiler)
    return packed(entries | {f"sources/{k}": v.encode() for k, v in code.items()})


def _rename(root: ET.Element, name: str, starts: Mapping[str, float]) -> None:
    """Turn a description into that of the wrapper: only co-simulation, with other start values."""
    for other in root.findall("ModelExchange"):
        root.remove(other)
    own = root.find("CoSimulation")
    assert own is not None
    own.set("modelIdentifier", name)
    own.attrib = {k: v for k, v in own.attrib.items() if "FMUstate" not in k and "Derivative" not in k}
    for files in own.findall("SourceFiles"):
        own.remove(files)
    for variable in root.iter("ScalarVariable"):
        real = variable.find("Real")
        if real is not None and variable.get("causality") == "parameter" and variable.get("name") in starts:
            real.set("start", repr(float(starts[str(variable.get("name"))])))


def _source(simulator: FmuSimulator, root: ET.Element, name: str, library: str) -> str:
    variables = {v.get("name"): v for v in root.iter("ScalarVariable")}
    names = {port: simulator.name_of(port) for port in (*simulator.inputs, *simulator.outputs)}
    references = {port: str(variables[own].get("valueReference")) for port, own in names.items()}
    starts = [_started(variables[names[n]]) for n in simulator.inputs]
    ins, outs = [references[n] for n in simulator.inputs], [references[n] for n in simulator.outputs]
    numbers = {str(variables[n].get("valueReference")): v for n, v in simulator.start_values().items()}
    pushed, read = _formulas(simulator)
    values = {
        "NAME": name, "LIBRARY": library, "SUBSTEPS": SUBSTEPS, "INPUTS": len(ins), "OUTPUTS": len(outs),
        "INPUT_REFERENCES": ", ".join([*ins, "0"]), "OUTPUT_REFERENCES": ", ".join([*outs, "0"]),
        "PARAMETERS": len(numbers), "PARAMETER_REFERENCES": ", ".join([*numbers, "0"]),
        "PARAMETER_VALUES": ", ".join([*map(repr, numbers.values()), "0"]),
        "INPUT_STARTS": ", ".join([*map(repr, starts), "0"]),
        "PUSHED": "\n".join(pushed), "READ": "\n".join(read), "ABSENT": "\n".join(f"ABSENT({n})" for n in _ABSENT),
    }  # fmt: skip
    return fill("wrap_fmi2.c", values)


def _started(variable: ET.Element) -> float:
    real = variable.find("Real")
    return float(real.get("start", 0.0)) if real is not None else 0.0


def _formulas(simulator: FmuSimulator) -> tuple[list[str], list[str]]:
    """Return the effects on inputs and outputs as C, one block per effect."""
    pushed, read, known = [], [], port_effects()
    places = {n: f"y[{k}]" for k, n in enumerate(simulator.outputs)}
    forces = []
    for name, where, values in simulator.effects:
        kind, cls = known[name]
        if ends_of(where) is not None:
            raise ExportError(
                f"The effect {name} acts between {where}.", "effects at one port", "Use the simulator file instead."
            )
        if cls.n_states or kind == "parameter":
            raise ExportError(
                f"{name} at {where} has memory.", "an effect without memory", "Use the simulator file instead."
            )
        effect: Any = in_port_units(name, where, values)
        if kind in ("output", "encoder"):
            port = simulator.port(where)
            both = [places[n] for n in ([where] if kind == "output" else [port.position, port.velocity])]
            read += [_block(at, effect.measure(symbol("v"), ()), {"v": at}) for at in both]
        elif kind == "input":
            at = f"u[{simulator.inputs.index(where)}]"
            s = Signals(command=symbol("v"))
            pushed.append(_block(at, effect.passed(s.command, s, (), None), {"v": at}))
        else:
            forces.append(_force(simulator, kind, where, effect, places))
    return [*pushed, *forces], read  # forces act on what commands have become


def _force(simulator: FmuSimulator, kind: str, where: str, effect: Any, places: Mapping[str, str]) -> str:
    """Return the addition of an effect at a joint or chamber to the input through which it acts."""
    port = simulator.port(where)
    s, used = Signals(), {}
    given = {"position": port.position, "velocity": port.velocity} if kind == "joint" else {"pressure": port.level}
    if kind == "chamber" and simulator.port(port.level).unit in _GASES:
        raise ExportError(f"{where} holds a gas.", "a chamber of a liquid", "Use the simulator file instead.")
    for role, name in given.items():
        if name:
            setattr(s, role, symbol(role))
            used[role] = places[name]
    plant = Surroundings(0.0)
    total = symbol("v") + effect.push(s, (), plant)
    if "flow" in effect.hooks():
        total = total - np.abs(effect.flow(s, (), plant)[0])
    at = f"u[{simulator.inputs.index(port.through)}]"
    return _block(at, total, {"v": at, **used})


def _block(at: str, formula: Any, names: Mapping[str, str]) -> str:
    lines = statements([as_symbol(formula)], names, Writer("float64"), at)
    return "\n".join(["    {", *(f"        {line}" for line in lines), "    }"])
