"""A plan as C99: fixed code from `templates`, tables of numbers, and a self-test with reference values."""

from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

import numpy as np

from ..volume.contact import POINTS, SHARES
from .expression import Symbol, in_order, symbol
from .memory import BEFORE
from .plan import JET, STEP, UNITS, ExportPlan, ModelPlan
from .reference import SERIES_BELOW, Reference

REALS = {"float64": "double", "float32": "float"}
"""Floating types of C by those of numpy."""

AT_ONCE = 4
"""States that go through the network in one pass over its weights."""

_ACTIVATIONS = {"softplus": 0, "tanh": 1, "silu": 2}
_EXP_DEGREE = {"float64": 10, "float32": 6}
_LOG_DEGREE = {"float64": 9, "float32": 5}
_INFIX = {"add": "+", "sub": "-", "mul": "*", "div": "/", "gt": ">", "ge": ">=", "lt": "<", "le": "<=", "and": "&&"}


def c_sources(plan: ExportPlan, reference: Reference, dtype: str = "float64") -> dict[str, str]:
    """Write a plan as C."""
    write = Writer(dtype)
    tables = write.tables(plan)
    values = common_values(plan, reference, dtype, ("V", "dV/deps", "dV/dP")) | {
        "STACK": write.stack(plan),
        **_memory_parts(plan, write),
        "CONSTANTS": write.constants,
        "PROTOTYPES": "\n".join(
            f"/* {o.name} alone, {o.unit} */\n{plan.name}_real {plan.name}_{o.name}(const {plan.name}_state *s);"
            for o in plan.outputs
        ),
        "FUNCTIONS": _formulas(plan, write),
        "SINGLE": _single_outputs(plan),
    }
    sources = {f"{plan.name}{ending}": fill(name, values) for ending, name in _FILES.items()}
    sources[f"{plan.name}_parameters.h"] = tables
    return sources


_FILES = {".h": "model.h", ".c": "model.c", "_selftest.c": "selftest.c"}


def common_values(plan: ModelPlan, reference: Reference, dtype: str, further: Sequence[str] = ()) -> dict[str, Any]:
    """Return what the templates of all models say: names, units and notes, and the values of the self-test."""
    outputs = ", ".join(f"{o.name} ({o.unit})" for o in plan.outputs)
    inputs = ", ".join(f"{n} ({u})" for n, u in plan.inputs.items())
    return {
        "NAME_UPPER": plan.name.upper(),
        "NAME": plan.name,
        "REAL": REALS[dtype],
        "WHAT": f"{plan.title} by pamid",
        "NOTES": "\n * ".join([f"Inputs:  {inputs}", f"Outputs: {outputs}", *plan.notes]),
        "N_OUTPUTS": len(plan.outputs),
        "OUTPUTS_TEXT": outputs,
        "ROWS": len(reference.inputs),
        "INPUT_ROWS": _number_rows(reference.inputs),
        "EXPECTED_ROWS": _number_rows(reference.expected),
        "TOLERANCES": ", ".join(f"{v:.3g}" for v in reference.tolerance(dtype)),
        "COLUMN_NAMES": ", ".join(f'"{n}"' for n in (*(o.name for o in plan.outputs), *further)),
    }


def fill(template: str, values: Mapping[str, Any]) -> str:
    """Return a template with its ``@NAMES@`` replaced."""
    text = (files(__package__) / "templates" / template).read_text(encoding="utf-8")
    for name, value in values.items():
        text = text.replace(f"@{name}@", str(value))
    return text


def _number_rows(values: np.ndarray) -> str:
    """Return the rows of a C array of arrays."""
    return ",\n".join("    {" + ", ".join(repr(float(v)) for v in row) + "}" for row in values)


class Writer:
    """Numbers of one floating type; counts the bytes of its tables."""

    def __init__(self, dtype: str) -> None:
        self.type = np.dtype(dtype)
        self.block = 64 // self.type.itemsize
        self.constants = 0

    def number(self, value: float) -> str:
        """Return a literal."""
        rounded = self.type.type(value)
        text = repr(float(rounded)) if self.type.itemsize == 8 else f"{rounded:.9g}"
        text = text if any(c in text for c in ".en") else f"{text}.0"
        return text if self.type.itemsize == 8 else f"{text}f"

    def table(self, name: str, values: np.ndarray, const: str = "static const real") -> str:
        """Return the definition of an array."""
        flat = np.ravel(values)
        self.constants += flat.size * self.type.itemsize
        body = ", ".join(self.number(v) for v in flat)
        return f"{const} {name}[{flat.size}] = {{{_wrapped(body)}}};"

    def padded(self, width: int) -> int:
        """Return a width, rounded up to whole blocks."""
        return -(-width // self.block) * self.block

    def filled(self, values: Any) -> np.ndarray:
        """Return an array whose last axis is filled up with zeros to whole blocks."""
        given = np.asarray(values)
        return np.pad(given, [(0, 0)] * (given.ndim - 1) + [(0, self.padded(given.shape[-1]) - given.shape[-1])])

    def series(self, function: Any, degree: int, low: float, high: float, name: str) -> str:
        """Return the nested polynomial of a function on an interval, through its Chebyshev points."""
        near = np.polynomial.Chebyshev.interpolate(function, degree, (low, high))
        first, *others = reversed(near.convert(kind=np.polynomial.Polynomial).coef)
        text = self.number(first)
        for c in others:
            text = f"{self.number(c)} + ({name}) * ({text})"
        return text

    def define(self, name: str, value: float) -> str:
        """Return a constant."""
        return f"#define {name} ({self.number(value)})"

    def stack(self, plan: ExportPlan) -> int:
        """Return how many bytes a call keeps on the stack, rounded up."""
        first = len(plan.network.scale.mean) if plan.network else 0
        widths = [first, *(len(b) for b in plan.network.weights[1:-1:2])] if plan.network else [0]
        return 1024 + AT_ONCE * (1 + len(widths)) * self.padded(max(widths)) * self.type.itemsize

    def tables(self, plan: ExportPlan) -> str:
        """Return the header with all numbers of a model."""
        half = np.log(2.0) / 2.0
        exp = self.series(np.exp, _EXP_DEGREE[self.type.name], -half, half, "q")
        # log(1 + e) = 2 artanh(s) with s = e/(2 + e): a series in r = s^2 up to 1/9.
        log = self.series(
            lambda r: np.arctanh(np.sqrt(r)) / np.sqrt(r), _LOG_DEGREE[self.type.name], 1e-9, 1.0 / 9.0, "r"
        )
        wide = self.type.itemsize == 8
        lines = [
            f"/* Numbers of {plan.name}, included by {plan.name}.c alone. */",
            f"#define INPUTS {4 + (len(plan.memory.inputs) if plan.memory else 0)}",
            f"#define SQUARE_ROOT(x) {'sqrt' if wide else 'sqrtf'}(x)",
            f"#define BITS {'uint64_t' if wide else 'uint32_t'}",
            f"#define SIGN ((BITS)1 << {63 if wide else 31})",
            f"#define MANTISSA {52 if wide else 23}",
            f"#define EXPONENT {1023 if wide else 127}",
            self.define("ROUNDER", 1.5 * 2.0 ** (52 if wide else 23)),
            self.define("EXP_LIMIT", 44.0),
            f"#define EXP_SERIES(q) {_wrapped(exp, continued=True)}",
            f"#define LOG_SERIES(r) {_wrapped(log, continued=True)}",
            f"#define BLOCK {self.block}",
            f"#define AT_ONCE {AT_ONCE}",
            f"#define SUMS {AT_ONCE * self.block}",
            # Fused where it is quick and a compiler would not do it by itself.
            f"#ifdef FP_FAST_FMA{'' if wide else 'F'}",
            f"#define MULTIPLY_ADD(a, b, c) {'fma' if wide else 'fmaf'}(a, b, c)",
            "#else",
            "#define MULTIPLY_ADD(a, b, c) ((a) * (b) + (c))",
            "#endif",
            self.define("VOLUME_FACTOR", plan.factor),
            self.define("VOLUME_OFFSET", plan.offset),
            f"#define HAS_ANCHOR {int(plan.anchor is not None)}",
            f"#define HAS_NETWORK {int(plan.network is not None)}",
        ]
        if plan.anchor is not None:
            lines += self._anchor(plan.anchor)
        if plan.network is not None:
            lines += self._network(plan.network)
        return "\n".join(lines) + "\n"

    def _anchor(self, anchor: Any) -> list[str]:
        return [
            f"#define POINTS {self.padded(len(POINTS))}",
            f"#define LAST {len(POINTS) - 1}",
            self.define("CONTACT_SMALL", SERIES_BELOW[self.type.name]),
            self.define("ANCHOR_AMBIENT", anchor.atmospheric_pressure),
            self.define("ANCHOR_LENGTH_AREA", anchor.rest_length * anchor.area),
            self.define("ANCHOR_MAX_CONTRACTION", anchor.max_contraction),
            self.define("ANCHOR_CURVATURE", anchor.curvature),
            self.define("ANCHOR_CONTACT_PRESSURE", anchor.contact_pressure / anchor.contact_width),
            self.define("ANCHOR_CONTACT_CONTRACTION", anchor.contact_contraction),
            self.define("ANCHOR_CONTACT_WIDTH", anchor.contact_width),
            self.define("ANCHOR_REST_VOLUME", anchor.rest_volume),
            self.define("ANCHOR_STRETCH", anchor.stretch),
            self.table("anchor_nodes", self.filled(POINTS)),
            self.table("anchor_weights", self.filled(SHARES)),
        ]

    def _network(self, network: Any) -> list[str]:
        weights, scale = network.weights, network.scale
        hidden = list(zip(weights[:-2:2], weights[1:-2:2], strict=True))
        saturated = ", ".join(str(int(s)) for s in scale.saturated)
        far = 1e30  # beyond any standardised input, and a finite float
        lines = [
            f"#define HIDDEN_LAYERS {len(hidden)}",
            f"#define ACTIVATION {_ACTIVATIONS[network.activation]}",
            f"#define ACTIVATION_STRETCH {2 if network.activation == 'tanh' else 1}",
            self.define("INPUT_FADE", scale.fade),
            self.define("VOLUME_SCALE", network.volume_scale),
            self.table("input_mean", scale.mean),
            self.table("input_spread", scale.spread),
            self.table("input_lower", np.maximum(scale.lower, -far)),
            self.table("input_upper", np.minimum(scale.upper, far)),
            f"static const int input_saturated[{len(scale.saturated)}] = {{{saturated}}};",
            self.table("last_weights", weights[-2]),
            f"static const real last_bias = {self.number(float(np.ravel(weights[-1])[0]))};",
        ]
        widths = [len(scale.mean), *(len(b) for _, b in hidden)]
        lines += [
            f"#define WIDEST {self.padded(max(widths))}",
            f"static const int widths[{len(widths)}] = {{{', '.join(map(str, widths))}}};",
        ]
        widest = self.padded(max(widths))
        tables = {"weights": [w.T for w, _ in hidden], "transposed": [w for w, _ in hidden]}
        for kind, layers in tables.items() if hidden else ():
            filled = [np.ravel(self.filled(values)) for values in layers]
            starts = np.cumsum([0, *(len(values) for values in filled[:-1])])
            lines += [
                self.table(kind, np.concatenate(filled)),
                f"static const int {kind}_at[{len(starts)}] = {{{', '.join(map(str, starts))}}};",
            ]
        if hidden:  # of one width, so that no compiler fears an index beyond the last
            lines.append(self.table("biases", np.array([np.pad(b, (0, widest - len(b))) for _, b in hidden])))
        return lines


def _wrapped(body: str, continued: bool = False) -> str:
    """Return a long text on lines of readable length."""
    words, lines, line = body.split(" "), [], ""
    for word in words:
        if len(line) + len(word) > 110:
            lines.append(line)
            line = ""
        line = f"{line} {word}".strip()
    return (" \\\n    " if continued else "\n    ").join([*lines, line])


# --- formulas -----------------------------------------------------------------------------------------------
def _formulas(plan: ExportPlan, write: Writer) -> str:
    """Return the function that reads all predictions from a volume."""
    name, upper = plan.name, plan.name.upper()
    names = _fields(plan) | {v: f"jet->{v}" for v in JET}
    lines = statements([o.formula for o in plan.outputs], names, write, "y[{}]")
    lines += [] if any("s->" in line for line in lines) else ["(void)s;"]
    head = f"static inline void formulas(const {name}_state *s, const {name}_jet *jet, real y[{upper}_OUTPUTS])"
    return _function(head, lines)


def _function(head: str, lines: Sequence[str]) -> str:
    return "\n".join([head, "{", *(f"    {line}" for line in lines), "}"])


def _fields(plan: ExportPlan) -> dict[str, str]:
    """Return where formulas find the signals of the muscle and the states of its effects."""
    states = plan.memory.states if plan.memory else ()
    return {s: f"s->{s}" for s in UNITS} | {f"x{k}": f"s->memory[{k}]" for k in range(len(states))}


def _network_inputs(plan: ExportPlan, write: Writer) -> str:
    """Return the function that gathers the network's inputs."""
    further = plan.memory.inputs if plan.memory else ()
    lines = statements([*map(symbol, UNITS), *further], _fields(plan), write, "x[{}]")
    return _function(f"INLINE void network_inputs(const {plan.name}_state *s, real x[INPUTS])", lines)


def _memory_parts(plan: ExportPlan, write: Writer) -> dict[str, str]:
    """Return the parts of the templates that only a model with memory has, and those that it has otherwise."""
    name, memory = plan.name, plan.memory
    given = ", ".join(f"({name}_real)inputs[row][{k}]" for k in range(4))
    if memory is None:
        return {
            **dict.fromkeys(("READING", "WHAT_MEMORY", "MEMORY_FIELD", "MEMORY_PROTOTYPES", "MEMORY_FUNCTIONS"), ""),
            "PATH": "",
            "NETWORK_INPUTS": _network_inputs(plan, write),
            "TAKE": f"        const {name}_state s = {{{given}}};\n",
        }
    signals = "\n".join(f"    {name}_real {s}; /* {u} */" for s, u in UNITS.items())
    step = f"void {name}_follow({name}_state *s, const {name}_reading *r, {name}_real dt)"
    begin = f"void {name}_begin({name}_state *s, const {name}_reading *r)"
    n = max(len(memory.states), 1)
    return {
        "READING": f"/* What the sensors read at one instant. */\ntypedef struct {{\n{signals}\n}} {name}_reading;\n\n",
        "WHAT_MEMORY": ", behind its sensors, and what was before",
        "MEMORY_FIELD": f"\n    {name}_real memory[{n}]; /* {', '.join(memory.states) or 'none'} */",
        "MEMORY_PROTOTYPES": (
            f"\n\n/* Begins with a first reading, as at rest. */\n{begin};\n\n/* Follows the next reading, dt seconds "
            f"after the one before; {name}_predict then tells of it. */\n{step};"
        ),
        "NETWORK_INPUTS": _network_inputs(plan, write),
        "MEMORY_FUNCTIONS": "\n\n"
        + "\n\n".join(
            _advance(head, formulas, write) for head, formulas in ((begin, memory.begin), (step, memory.follow))
        ),
        "PATH": f"\n    {name}_state s;",
        "TAKE": (
            f"        const {name}_reading r = {{{given}}};\n        if (row)\n            {name}_follow(&s, &r, "
            f"({name}_real){STEP!r});\n        else\n            {name}_begin(&s, &r);\n"
        ),
    }


def _advance(head: str, formulas: Sequence[Symbol], write: Writer) -> str:
    """Return the function that replaces a state by that at a reading."""
    names = {s: f"r->{s}" for s in UNITS} | {BEFORE + s: f"s->{s}" for s in UNITS} | {"dt": "dt"}
    names |= {f"x{k}": f"s->memory[{k}]" for k in range(len(formulas) - 4)}
    lines = statements(formulas, names, write, "const real next{}")
    unused = ["(void)dt;"] if "dt)" in head and not any("dt" in line for line in lines) else []
    targets = [*(f"s->{s}" for s in UNITS), *(f"s->memory[{k}]" for k in range(len(formulas) - 4))]
    # All from what was before, then all at once.
    return _function(head, [*lines, *(f"{target} = next{k};" for k, target in enumerate(targets)), *unused])


def _single_outputs(plan: ExportPlan) -> str:
    """Return a function for each prediction alone."""
    name, upper = plan.name, plan.name.upper()
    return "\n\n".join(
        f"{name}_real {name}_{output.name}(const {name}_state *s)\n{{\n    {name}_real y[{upper}_OUTPUTS];\n"
        f"    {name}_predict(s, y, 0);\n    return y[{k}];\n}}"
        for k, output in enumerate(plan.outputs)
    )


def statements(roots: Sequence[Symbol], names: Mapping[str, str], write: Writer, target: str) -> list[str]:
    """Return a C statement for each operation, and those that assign the results to targets such as ``y[{}]``."""
    lines: list[str] = []
    known: dict[int, str] = {}
    for s in in_order(list(roots)):
        if s.op == "input":
            known[id(s)] = names[s.args[0]]
        elif s.op == "const":
            known[id(s)] = f"({write.number(s.args[0])})"
        else:
            a = [known[id(x)] for x in s.args]
            kind = "int" if s.op in ("gt", "ge", "lt", "le", "and") else "real"
            lines.append(f"const {kind} t{len(lines)} = {_operation(s.op, a)};")
            known[id(s)] = f"t{len(lines) - 1}"
    return lines + [f"{target.format(k)} = {known[id(r)]};" for k, r in enumerate(roots)]


def _operation(op: str, a: Sequence[str]) -> str:
    if op in _INFIX:
        return f"{a[0]} {_INFIX[op]} {a[1]}"
    if op == "neg":
        return f"-{a[0]}"
    if op == "abs":
        return f"{a[0]} < 0 ? -{a[0]} : {a[0]}"
    if op in ("min", "max"):
        # A NaN in the first place stays one, as in numpy.
        return f"{a[0]} {'>' if op == 'min' else '<'} {a[1]} ? {a[1]} : {a[0]}"
    if op == "where":
        return f"{a[0]} ? {a[1]} : {a[2]}"
    return f"(real){op}({', '.join(f'(double){x}' for x in a)})"
