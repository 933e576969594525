"""What a fit found: parameters with units, standard errors and bounds, as a table and as JSON."""

from __future__ import annotations

import math
from typing import Any

from ..requirements import WithBounds
from .common import number, table


def fitted_parameters(model: Any) -> dict[str, dict[str, Any]]:
    """Return value, unit, error, bounds and flags of each fitted parameter by name; empty without physical meaning."""
    values = getattr(model, "parameters_", None) or getattr(model, "coefficients_", None) or {}
    if any(isinstance(value, dict) for value in values.values()):
        return {}
    errors, units = getattr(model, "standard_errors_", {}), getattr(model, "units_", {})
    inner = model if isinstance(model, WithBounds) else getattr(model, "model_", model)
    bounds = inner.parameter_bounds() if isinstance(inner, WithBounds) else {}
    names = getattr(inner, "fitted_names_", list(values))
    held = set(getattr(inner, "at_bound_", ()))
    return {
        name: {
            "value": float(value),
            "unit": units.get(name),
            "standard_error": _finite(errors.get(name)) if name in names else None,
            "lower": _finite(bounds.get(name, (None, None))[0]),
            "upper": _finite(bounds.get(name, (None, None))[1]),
            "fitted": name in names,
            "at_bound": name in held,
        }
        for name, value in values.items()
    }


def _finite(value: float | None) -> float | None:
    return float(value) if value is not None and math.isfinite(value) else None


def parameter_lines(parameters: dict[str, dict[str, Any]]) -> str:
    """Return a table of the parameters."""
    rows = []
    for name, p in parameters.items():
        if not p["fitted"]:
            note = "held"
        elif p["at_bound"]:
            note = "at its bound"
        else:
            note = "" if p["standard_error"] is not None else "no standard error: the data do not determine it"
        error = "" if p["standard_error"] is None else number(p["standard_error"])
        low, high = (
            ("-inf" if p["lower"] is None else number(p["lower"])),
            ("inf" if p["upper"] is None else number(p["upper"])),
        )
        rows.append([name, number(p["value"]), error, p["unit"] or "", f"{low} to {high}", note])
    return table(["parameter", "value", "std. error", "unit", "bounds", ""], rows)
