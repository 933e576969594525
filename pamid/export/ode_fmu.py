"""Ordinary differential equations as an FMU: FMI 2.0, co-simulation and model exchange, from formulas in Python."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any
from xml.sax.saxutils import quoteattr

from ..errors import ExportError
from .c_source import Writer, fill, statements
from .expression import Symbol, as_symbol, symbol
from .fmu import binary_folder, compiled, packed

_ABSENT = (
    *(f"{verb}{kind}" for verb in ("Get", "Set") for kind in ("Integer", "Boolean", "String", "FMUstate")),
    *("FreeFMUstate", "SerializedFMUstateSize", "SerializeFMUstate", "DeSerializeFMUstate", "CancelStep"),
    *("GetDirectionalDerivative", "SetRealInputDerivatives", "GetRealOutputDerivatives", "GetStatus"),
    *("GetRealStatus", "GetIntegerStatus", "GetBooleanStatus", "GetStringStatus"),
)


class Named:
    """Symbols by name, as items, attributes or by place: what a function of rates is given in place of numbers."""

    def __init__(self, symbols: Mapping[str, Symbol]) -> None:
        self._symbols = dict(symbols)

    def __getitem__(self, key: str | int) -> Symbol:
        return self._symbols[key] if isinstance(key, str) else list(self._symbols.values())[key]

    def __getattr__(self, name: str) -> Symbol:
        try:
            return self.__dict__["_symbols"][name]
        except KeyError:
            raise AttributeError(name) from None

    def __iter__(self) -> Any:
        return iter(self._symbols.values())

    def __len__(self) -> int:
        return len(self._symbols)


def ode_fmu(
    name: str,
    rates: Callable[[Any, Any, Any, Any], Any],
    states: Mapping[str, float],
    inputs: Mapping[str, float],
    parameters: Mapping[str, float],
    outputs: Callable[[Any, Any, Any, Any], Mapping[str, Any]] | None = None,
    *,
    units: Mapping[str, str] | None = None,
    substeps: int = 10,
    compiler: str | None = None,
) -> bytes:
    """Write the rates of states as C and pack them as an FMU."""
    given = ["time", *states, *inputs, *parameters]
    if len(set(given)) < len(given):
        raise ExportError(f"Two of {', '.join(given)} share a name.", "one name each", "Rename one.")
    t, x, u, p = symbol("time"), *(Named({n: symbol(n) for n in some}) for some in (states, inputs, parameters))
    found = _by_name(rates(t, x, u, p), states)
    shown = dict(outputs(t, x, u, p)) if outputs else {f"{n}_out": x[n] for n in states}
    roots = [as_symbol(v) for v in (*found, *shown.values())]
    lines = statements(roots, {n: f"v[{k}]" for k, n in enumerate(given)}, Writer("float64"), "out[{}]")
    starts = [0.0, *states.values(), *inputs.values(), *parameters.values()]
    values = {
        "NAME": name, "STATES": len(states), "INPUTS": len(inputs), "PARAMETERS": len(parameters),
        "OUTPUTS": len(shown), "SUBSTEPS": substeps, "STARTS": ", ".join(repr(float(v)) for v in starts),
        "FORMULAS": "\n".join(f"    {line}" for line in lines),
        "ABSENT": "\n".join(f"ABSENT({n})" for n in _ABSENT),
    }  # fmt: skip
    source = fill("ode_fmi2.c", values)
    token = hashlib.sha256(source.encode()).hexdigest()[:32]
    code = {f"{name}.c": source.replace("@TOKEN@", token)}
    folder, ending = binary_folder(2)
    entries = {
        "modelDescription.xml": _description(name, token, given, (states, inputs, parameters), list(shown), units or {},
                                             starts).encode(),
        f"binaries/{folder}/{name}{ending}": compiled(code, compiler),
        f"sources/{name}.c": code[f"{name}.c"].encode(),
    }  # fmt: skip
    return packed(entries)


def _by_name(answer: Any, names: Mapping[str, float]) -> list[Any]:
    values = [answer[n] for n in names] if isinstance(answer, Mapping) else list(answer)
    if len(values) != len(names):
        raise ExportError(f"There are {len(values)} rates.", f"one for each of {', '.join(names)}", "Return all.")
    return values


def _description(
    name: str, token: str, given: Sequence[str], kinds: tuple[Mapping[str, float], ...], outputs: Sequence[str],
    units: Mapping[str, str], starts: Sequence[float],
) -> str:  # fmt: skip
    states, inputs, parameters = kinds
    lines, count = [], len(given)

    def variable(what: str, reference: int, attributes: str, real: str) -> None:
        unit = f" unit={quoteattr(units[what])}" if what in units else ""
        lines.append(
            f'    <ScalarVariable name={quoteattr(what)} valueReference="{reference}" {attributes}>'
            f"<Real{unit}{real}/></ScalarVariable>"
        )

    for k, what in enumerate(given):
        start = f' start="{float(starts[k])!r}"'
        if k == 0:
            variable(what, k, 'causality="independent" variability="continuous"', "")
        elif what in states:
            variable(what, k, 'causality="local" variability="continuous" initial="exact"', start)
        elif what in inputs:
            variable(what, k, 'causality="input" variability="continuous"', start)
        elif what in parameters:
            variable(what, k, 'causality="parameter" variability="tunable"', start)
    for k, what in enumerate(states):
        variable(f"der({what})", count + k, 'causality="local" variability="continuous"', f' derivative="{2 + k}"')
    for k, what in enumerate(outputs):
        variable(what, count + len(states) + k, 'causality="output" variability="continuous"', "")
    rates = "".join(f'<Unknown index="{count + 1 + k}"/>' for k in range(len(states)))
    shown = "".join(f'<Unknown index="{count + len(states) + 1 + k}"/>' for k in range(len(outputs)))
    unit_list = "".join(f"<Unit name={quoteattr(u)}/>" for u in sorted(set(units.values())))
    return "\n".join(
        [
            '<?xml version="1.0" encoding="UTF-8"?>',
            f'<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{token}" generationTool="pamid" '
            'numberOfEventIndicators="0">',
            f'  <ModelExchange modelIdentifier="{name}"/>',
            f'  <CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true"/>',
            *([f"  <UnitDefinitions>{unit_list}</UnitDefinitions>"] if unit_list else []),
            "  <ModelVariables>",
            *lines,
            "  </ModelVariables>",
            f"  <ModelStructure><Outputs>{shown}</Outputs><Derivatives>{rates}</Derivatives>"
            f"<InitialUnknowns>{shown}{rates}</InitialUnknowns></ModelStructure>",
            "</fmiModelDescription>",
            "",
        ]
    )
