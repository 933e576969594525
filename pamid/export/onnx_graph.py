"""A plan as an ONNX graph: one input of shape (n, 4), predictions, volume and its derivatives as outputs."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from ..errors import ExportError
from ..volume.contact import POINTS, SHARES
from .expression import Symbol, in_order
from .formula import FormulaPlan
from .memory import BEFORE
from .plan import JET, UNITS, ExportPlan
from .reference import SERIES_BELOW

OPSET = 17
"""Version of the operators; runtimes since 2022 know it."""

_COMPARISONS = {"gt": "Greater", "ge": "GreaterOrEqual", "lt": "Less", "le": "LessOrEqual"}
"""ONNX's names of operators; the others are called as here, with a capital letter."""


def onnx_model(plan: ExportPlan, dtype: str = "float64") -> Any:
    """Write a plan as an ONNX model."""
    graph = _Graph(_imported(), np.dtype(dtype))
    return _finished(graph, plan.name, UNITS, *_answers(graph, plan, {s: graph.column(k) for k, s in enumerate(UNITS)}))


def onnx_memory(plan: ExportPlan, dtype: str = "float64") -> dict[str, Any]:
    """Write a plan with memory as two ONNX models, for the first reading and for each next one; see `onnx_model`."""
    assert plan.memory is not None
    found = {}
    for end, formulas in (("_begin", plan.memory.begin), ("", plan.memory.follow)):
        graph = _Graph(_imported(), np.dtype(dtype))
        names = {s: graph.column(k) for k, s in enumerate(UNITS)}
        further: dict[str, list[Any]] = {}
        if not end:
            further = {"memory": ["n", len(formulas)], "dt": [1]}
            kept = [*(BEFORE + s for s in UNITS), *(f"x{k}" for k in range(len(formulas) - 4))]
            names |= {s: graph.column(k, "memory") for k, s in enumerate(kept)} | {"dt": "dt"}
        rows = graph.scaled(graph.column(0), 0.0)  # gives a constant as many rows as the input has
        now = [graph("Add", v, rows) for v in _formulas(graph, list(formulas), names)]
        of = dict(zip([*UNITS, *(f"x{k}" for k in range(len(now) - 4))], now, strict=True))
        results, said = _answers(graph, plan, of)
        results["memory_next"] = graph("Concat", *now, axis=1)
        found[end] = _finished(graph, plan.name + end, UNITS, results, said, further, {"memory_next": len(now)})
    return found


def _answers(graph: _Graph, plan: ExportPlan, names: dict[str, str]) -> tuple[dict[str, str], list[str]]:
    """Add predictions, volume and derivatives at signals of the muscle and states; return them, and the notes."""
    parts = []
    if plan.anchor is not None:
        parts.append(_anchor(graph, plan.anchor, names))
    if plan.network is not None:
        read = [names[s] for s in UNITS] + (_formulas(graph, list(plan.memory.inputs), names) if plan.memory else [])
        parts.append(_network(graph, plan.network, graph("Concat", *read, axis=1) if plan.memory else "X"))
    jet = parts[0] if len(parts) == 1 else [graph("Add", a, b) for a, b in zip(*parts, strict=True)]
    jet = [graph("Mul", v, graph.constant(plan.factor)) for v in jet]
    jet[0] = graph("Add", jet[0], graph.constant(plan.offset))
    results = _formulas(graph, [o.formula for o in plan.outputs], names | dict(zip(JET, jet, strict=True))) + jet
    outputs = [o.name for o in plan.outputs] + list(JET)
    said = [f"{o.name}: {o.unit}" for o in plan.outputs] + ["V: m^3", "V_eps: m^3", "V_P: m^3/Pa", *plan.notes]
    return dict(zip(outputs, results, strict=True)), said


def onnx_formula(plan: FormulaPlan, dtype: str = "float64") -> Any:
    """Write a formula as an ONNX model."""
    graph = _Graph(_imported(), np.dtype(dtype))
    names = {s: graph.column(k) for k, s in enumerate(plan.inputs)}
    rows = graph.scaled(graph.column(0), 0.0)  # gives a constant as many rows as the input has
    results = [graph("Add", r, rows) for r in _formulas(graph, [o.formula for o in plan.outputs], names)]
    said = [*(f"{o.name}: {o.unit}" for o in plan.outputs), *plan.notes]
    return _finished(
        graph, plan.name, plan.inputs, dict(zip((o.name for o in plan.outputs), results, strict=True)), said
    )


def _imported() -> Any:
    try:
        import onnx
    except ImportError:
        raise ExportError(
            "onnx is not installed.", "the package", 'Install with pip install "pamid[export]".'
        ) from None
    return onnx


def _finished(
    graph: _Graph,
    name: str,
    inputs: Mapping[str, str],
    results: Mapping[str, str],
    said: list[str],
    further: Mapping[str, list[Any]] = MappingProxyType({}),
    widths: Mapping[str, int] = MappingProxyType({}),
) -> Any:
    """Return the checked model of a graph, its results under their own names."""
    onnx = graph.onnx
    helper = onnx.helper
    kind = onnx.TensorProto.DOUBLE if graph.dtype == np.float64 else onnx.TensorProto.FLOAT
    for output, result in results.items():
        graph.nodes.append(helper.make_node("Identity", [result], [output], name=output))
    made = helper.make_graph(
        graph.nodes,
        name,
        [
            helper.make_tensor_value_info(given, kind, shape)
            for given, shape in {"X": ["n", len(inputs)], **further}.items()
        ],
        [helper.make_tensor_value_info(output, kind, ["n", widths.get(output, 1)]) for output in results],
        graph.tensors,
        doc_string="; ".join([f"Inputs: {', '.join(f'{n} ({u})' for n, u in inputs.items())}", *said]),
    )
    model = helper.make_model(made, opset_imports=[helper.make_opsetid("", OPSET)], producer_name="pamid")
    model.ir_version = 8
    onnx.checker.check_model(model, full_check=True)
    return model


class _Graph:
    """Nodes and constants of a graph; calling it adds a node and returns the name of its result."""

    def __init__(self, onnx: Any, dtype: np.dtype) -> None:
        self.onnx = onnx
        self.dtype = dtype
        self.nodes: list[Any] = []
        self.tensors: list[Any] = []
        self._known: dict[bytes, str] = {}

    def __call__(self, op: str, *inputs: str, **attributes: Any) -> str:
        name = f"{op.lower()}_{len(self.nodes)}"
        # Nodes without names stop onnxruntime 1.20, which calls what it fuses by them.
        self.nodes.append(self.onnx.helper.make_node(op, list(inputs), [name], name=name, **attributes))
        return name

    def constant(self, value: Any, dtype: Any = None) -> str:
        """Return the name of a constant; a number takes the graph's floating type."""
        array = np.ascontiguousarray(value, dtype=dtype or self.dtype).reshape(np.shape(value))
        key = array.tobytes() + str((array.shape, array.dtype)).encode()
        if key not in self._known:
            self._known[key] = f"constant_{len(self.tensors)}"
            self.tensors.append(self.onnx.numpy_helper.from_array(array, self._known[key]))
        return self._known[key]

    def column(self, k: int, of: str = "X") -> str:
        """Return the k-th signal, or the k-th column of another input, shape (n, 1)."""
        return self("Gather", of, self.constant([k], np.int64), axis=1)

    def one_minus(self, x: str) -> str:
        return self("Sub", self.constant(1.0), x)

    def plus_one(self, x: str) -> str:
        return self("Add", x, self.constant(1.0))

    def scaled(self, x: str, factor: Any) -> str:
        return self("Mul", x, self.constant(factor))

    def ramp(self, x: str) -> str:
        """Return max(x, 0)."""
        return self("Max", x, self.constant(0.0))

    def logistic(self, x: str) -> tuple[str, str]:
        """Return σ(x) and e^(−|x|)."""
        e = self("Exp", self("Neg", self("Abs", x)))
        positive = self("GreaterOrEqual", x, self.constant(0.0))
        above = self("Where", positive, self.constant(1.0), e)
        return self("Div", above, self.plus_one(e)), e

    def softplus(self, x: str, e: str) -> str:
        """Return ln(1 + e^x) from x and e^(−|x|), by 2 artanh where ln(1 + e) would lose digits."""
        s = self("Div", e, self("Add", e, self.constant(2.0)))
        r = self("Mul", s, s)
        small = self.constant(1.0 / 13.0)
        for k in range(5, -1, -1):
            small = self("Add", self.constant(1.0 / (2 * k + 1)), self("Mul", r, small))
        small = self.scaled(self("Mul", s, small), 2.0)
        log = self("Where", self("Less", e, self.constant(0.05)), small, self("Log", self.plus_one(e)))
        return self("Add", self.ramp(x), log)


def _network(g: _Graph, network: Any, x: str) -> list[str]:
    """Add the network: values forwards, gradient backwards."""
    scale, weights = network.scale, network.weights
    z = g("Div", g("Sub", x, g.constant(scale.mean)), g.constant(scale.spread))
    far = 1e30
    lower, upper = g.constant(np.maximum(scale.lower, -far)), g.constant(np.minimum(scale.upper, far))
    over, under = g.ramp(g("Sub", z, upper)), g.ramp(g("Sub", lower, z))
    bend = [g("Tanh", g.scaled(v, 1.0 / scale.fade)) for v in (over, under)]
    inside = g("Min", g("Max", z, lower), upper)
    xi = g("Add", inside, g.scaled(g("Sub", *bend), scale.fade))
    slope = g.one_minus(g("Add", g("Mul", bend[0], bend[0]), g("Mul", bend[1], bend[1])))
    if scale.saturated.any():
        mask = g.constant(scale.saturated, bool)
        root = g("Sqrt", g.plus_one(g("Mul", z, z)))
        xi = g("Where", mask, g("Div", z, root), xi)
        slope = g("Where", mask, g("Div", g.constant(1.0), g("Mul", root, g("Mul", root, root))), slope)
    slope = g("Div", slope, g.constant(scale.spread))
    slopes, h = [], xi
    for k in range(0, len(weights) - 2, 2):
        h, s = _activation(g, g("Gemm", h, g.constant(weights[k]), g.constant(weights[k + 1]), transB=1), network)
        slopes.append(s)
    value = g("Gemm", h, g.constant(weights[-2]), g.constant(weights[-1]), transB=1)
    gradient = g.constant(weights[-2])
    for k in range(len(slopes) - 1, -1, -1):
        gradient = g("MatMul", g("Mul", gradient, slopes[k]), g.constant(weights[2 * k]))
    gradient = g("Mul", gradient, slope)
    parts = [g("Gather", gradient, g.constant([j], np.int64), axis=1) for j in (0, 2)]
    return [g.scaled(v, network.volume_scale) for v in (value, *parts)]


def _activation(g: _Graph, z: str, network: Any) -> tuple[str, str]:
    if network.activation == "tanh":
        t = g("Tanh", z)
        return t, g.one_minus(g("Mul", t, t))
    s, e = g.logistic(z)
    if network.activation == "softplus":
        return g.softplus(z, e), s
    return g("Mul", z, s), g("Add", s, g("Mul", z, g("Sub", s, g("Mul", s, s))))


def _anchor(g: _Graph, anchor: Any, names: Mapping[str, str]) -> list[str]:
    """Add the geometric volume; the last point of the quadrature, with no weight, is the contraction itself."""
    eps = names["eps"]
    p = g("Sub", names["P"], g.constant(anchor.atmospheric_pressure))
    at = g("Mul", eps, g.constant(POINTS[None]))
    v = g.scaled(at, 1.0 / anchor.max_contraction)
    braid = g("Mul", g.one_minus(v), g.plus_one(g.scaled(v, anchor.curvature)))
    braid = g.scaled(braid, anchor.rest_length * anchor.area)
    fall = g("Exp", g.scaled(g.ramp(at), -1.0 / anchor.contact_contraction))
    x = g.scaled(g("Sub", fall, g.constant(1.0)), anchor.contact_pressure / anchor.contact_width)
    phi, slope = _contact(g, x, g.scaled(p, 1.0 / anchor.contact_width))
    weights = SHARES[:, None]
    mean = g("MatMul", g("Mul", braid, phi), g.constant(weights))
    # The width goes into the weights: onnxruntime joins a product and a factor after it in single precision.
    rise = g("MatMul", g("Mul", braid, slope), g.constant(weights / anchor.contact_width))
    left = g.scaled(g.one_minus(eps), anchor.stretch)
    V = g("Add", g.constant(anchor.rest_volume), g("Add", g("Mul", left, p), g("Mul", eps, mean)))
    end = g("Gather", g("Mul", braid, phi), g.constant([len(POINTS) - 1], np.int64), axis=1)
    V_eps = g("Sub", end, g.scaled(p, anchor.stretch))
    return [V, V_eps, g("Add", left, g("Mul", eps, rise))]


def _contact(g: _Graph, x: str, u: str) -> tuple[str, str]:
    """Add the share of the pressure that reaches the braid, and its derivative by u."""
    small = g("Less", g("Abs", u), g.constant(SERIES_BELOW[g.dtype.name]))
    safe = g("Where", small, g.constant(1.0), u)
    y = g("Add", x, u)
    _, e = g.logistic(y)
    # The slope from what φ and the logistic function lack of 1, or of 0: their difference loses digits.
    left, zero = g("Sub", g.softplus(g("Neg", g("Abs", y)), e), g.softplus(x, g.logistic(x)[1])), g.constant(0.0)
    over, part = g("Greater", y, zero), g("Div", e, g.plus_one(e))
    phi = g("Div", g("Add", g.ramp(y), left), safe)
    lacking = g("Div", g("Add", g("Where", over, x, zero), left), safe)
    slope = g("Div", g("Sub", g("Where", over, g("Neg", part), part), lacking), safe)
    m, _ = g.logistic(g("Add", x, g.scaled(u, 0.5)))
    a, odd, v = g("Mul", m, g.one_minus(m)), g.one_minus(g.scaled(m, 2.0)), g("Mul", u, u)
    twelve = g.one_minus(g.scaled(a, 12.0))
    first = g(
        "Mul", g.scaled(g("Mul", g("Mul", a, odd), v), 1.0 / 24.0), g.plus_one(g.scaled(g("Mul", twelve, v), 1 / 80))
    )
    fourth = g.plus_one(g("Mul", a, g("Sub", g.scaled(a, 120.0), g.constant(30.0))))
    even = g("Add", g.constant(0.5), g.scaled(g("Mul", g.one_minus(g.scaled(a, 6.0)), v), 1.0 / 48.0))
    even = g("Add", even, g.scaled(g("Mul", fourth, g("Mul", v, v)), 1.0 / 3840.0))
    tilt = g("Add", g.constant(1.0 / 12.0), g.scaled(g("Mul", twelve, v), 1.0 / 480.0))
    second = g("Mul", a, g("Add", even, g("Mul", g("Mul", odd, u), tilt)))
    return g("Where", small, g("Add", m, first), phi), g("Where", small, second, slope)


def _formulas(g: _Graph, roots: list[Symbol], names: dict[str, str]) -> list[str]:
    known: dict[int, str] = {}
    for s in in_order(roots):
        if s.op == "input":
            known[id(s)] = names[s.args[0]]
        elif s.op == "const":
            known[id(s)] = g.constant(s.args[0])
        else:
            known[id(s)] = g(_COMPARISONS.get(s.op, s.op.capitalize()), *(known[id(a)] for a in s.args))
    return [known[id(r)] for r in roots]
