"""Models that are a formula of their signals, traced once and written as C99 or ONNX; a lift as a step with state."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..constants import ATMOSPHERIC_PRESSURE
from ..errors import ExportError
from ..requirements import WithFormulas, WithLift, WithScaledInputs
from .c_source import Writer, common_values, fill, statements
from .expression import Symbol, as_symbol, symbol
from .plan import UNITS, ModelPlan, Output
from .reference import Reference

SIGNALS = UNITS | {
    "F": "N",
    "load": "kg",
    "dx": "m/s",
    "q": "rad",
    "dq": "rad/s",
    "ddq": "rad/s^2",
    "V": "m^3",
    "V_eps": "m^3",
    "V_P": "m^3/Pa",
    "mdot": "kg/s",
    "direction": "1 up, -1 down, 0 before it moved",
}
"""Units of the signals that formulas read; what is not here has the unit that it had in the fit."""

TYPICAL = {
    "eps": (0.1, 0.04),
    "deps": (0.0, 0.2),
    "P": (3e5, 8e4),
    "dP": (0.0, 3e5),
    "dx": (0.0, 0.05),
    "V": (1e-4, 2e-5),
    "V_eps": (2e-4, 5e-5),
    "V_P": (1e-11, 1e-11),
}
"""Middle and width of signals at which an export is compared with ``predict``, where the model does not say."""


@dataclass(frozen=True)
class Lift:
    """A force of contractile element, spring and damper, by which a load moves."""

    elements: tuple[Symbol, ...]
    """Force of the contractile element (N), stiffness (N/m) and damping (N s/m) from ``P`` and ``dP``."""
    rest_length: float
    """L₀, m."""
    top: float
    """Contraction at which a lift is held, dimensionless."""
    gravity: float
    """m/s²."""


@dataclass(frozen=True)
class FormulaPlan(ModelPlan):
    """A formula of signals."""

    lift: Lift | None
    """By what a load moves."""


def formula_of(model: Any, name: str, notes: tuple[str, ...] = ()) -> FormulaPlan | None:
    """Trace a fitted model; None if it has no formula."""
    if not isinstance(model, WithFormulas):
        return None
    fitted: Any = model
    names = [*fitted.reads, *(["direction"] if getattr(model, "direction", False) else [])]
    if wrong := [n for n in names if not n.isidentifier() or not n.isascii()]:
        raise ExportError(
            f"The signal {wrong[0]!r} is not a C identifier.", "letters, digits and _", "Rename it before the fit."
        )
    columns = fitted.signal_columns_
    if len(set(columns.values())) < len(columns):
        raise ExportError(
            "Several signals share one column.", "a column for each signal", "Fit on one column for each signal."
        )
    signals = {n: symbol(n) for n in names}
    found = model.formulas(signals)
    if not found:
        return None
    outputs = tuple(Output(n, unit, as_symbol(value)) for n, (unit, value) in found.items())
    lift = None
    if isinstance(model, WithLift):
        elements, numbers = model.lift_formulas(signals)
        lift = Lift(tuple(as_symbol(e) for e in elements), **numbers)
    if "direction" in names:
        notes = (*notes, "direction is an input: 1 once its signal has risen, -1 once it has fallen by direction_step.")
    places = [_place(model, n) for n in names]
    centre, width = (np.array(a, dtype=float) for a in zip(*places, strict=True))
    units = {n: SIGNALS.get(n, "unit of the fit") for n in names}
    return FormulaPlan(name, type(model).__name__, units, outputs, _own(model, names), centre, width, notes, lift)


def _place(model: Any, name: str) -> tuple[float, float]:
    """Return where a signal lay in the fit, or usually lies."""
    if name == "direction":
        return 0.0, 0.0
    if isinstance(model, WithScaledInputs) and name in model.inputs:
        k = list(model.inputs).index(name)
        return float(model.input_mean_[k]), float(model.input_scale_[k])
    return TYPICAL.get(name, (0.5, 0.2))


def _own(model: Any, names: list[str]) -> Callable[[np.ndarray], np.ndarray]:
    """Return the model's own prediction on an array of its inputs, in their order."""

    def predict(x: np.ndarray) -> np.ndarray:
        table: Any = np.zeros((len(x), model.n_features_in_))
        for k, n in enumerate(names):
            if n in model.signal_columns_:
                table[:, model.signal_columns_[n]] = x[:, k]
        if hasattr(model, "feature_names_in_"):
            import pandas as pd

            table = pd.DataFrame(table, columns=model.feature_names_in_)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of states outside the data, which the reference holds on purpose
            given = {"groups": np.arange(len(x))} if getattr(model, "direction", False) else {}
            return np.asarray(model.predict(table, **given), dtype=float).reshape(len(x), -1)

    return predict


# --- C ------------------------------------------------------------------------------------------------------
def reference_rows(plan: FormulaPlan, n_rows: int = 64, seed: int = 0) -> Reference:
    """Return inputs inside and outside the model's data, and its outputs."""
    rng = np.random.default_rng(seed)
    x = plan.centre + plan.width * rng.uniform(-2.5, 2.5, (n_rows, len(plan.centre)))
    x[0], x[1] = plan.centre, plan.centre + 6.0 * plan.width
    for k, name in enumerate(plan.inputs):
        if name == "P":
            x[:, k] = np.maximum(x[:, k], 5e4)
            x[2, k] = ATMOSPHERIC_PRESSURE
        elif name in ("deps", "dP"):
            x[3, k] = 0.0
    x = x.astype(np.float32).astype(float)
    return Reference(x, plan.predict(x))


def formula_sources(plan: FormulaPlan, dtype: str = "float64") -> dict[str, str]:
    """Write a formula as C."""
    write = Writer(dtype)
    lines = statements([o.formula for o in plan.outputs], {n: f"s->{n}" for n in plan.inputs}, write, "y[{}]")
    values = common_values(plan, reference_rows(plan), dtype) | {
        "N_INPUTS": len(plan.inputs),
        "FIELDS": "\n".join(f"    {plan.name}_real {n}; /* {u} */" for n, u in plan.inputs.items()),
        "BODY": "\n".join(f"    {line}" for line in lines),
        "LIFT_HEADER": fill("lift.h", {"NAME": plan.name}) if plan.lift else "",
        "LIFT": _lift(plan, write) if plan.lift else "",
        "ASSIGNMENTS": "\n".join(
            f"        s.{n} = ({plan.name}_real)inputs[row][{k}];" for k, n in enumerate(plan.inputs)
        ),
    }
    endings = {".h": "formula.h", ".c": "formula.c", "_selftest.c": "formula_selftest.c"}
    return {f"{plan.name}{ending}": fill(template, values) for ending, template in endings.items()}


def _lift(plan: FormulaPlan, write: Writer) -> str:
    lift = plan.lift
    assert lift is not None
    lines = statements(lift.elements, {"P": "drive->P", "dP": "drive->dP"}, write, "element[{}]")
    numbers = {
        "NAME": plan.name,
        "ELEMENTS": "\n".join(f"    {line}" for line in lines),
        "REST_LENGTH": write.number(lift.rest_length),
        "TOP": write.number(lift.rest_length * lift.top),
        "GRAVITY": write.number(lift.gravity),
    }
    return fill("lift.c", numbers)
