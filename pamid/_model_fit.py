"""Whether the fitted attributes of a model belong to one fit: shapes, positions, order.

Each rule looks at attributes by their name, whatever estimator has them, and says what is wrong. Code that is compiled
reads arrays where such numbers say, and numpy stretches an array of one to any shape without a word.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from math import comb
from typing import Any

import numpy as np

MOST_FEATURES = 1_000_000
MOST_DEGREE = 50
_PER_FEATURE = ("mean_", "var_", "scale_", "center_", "min_", "data_min_", "data_max_", "data_range_", "max_abs_")
_PAIRS = (("input_mean_", "input_scale_"), ("target_mean_", "target_scale_"), ("output_mean_", "output_scale_"))
_ORDERED = (
    ("input_low_", "input_high_"),
    ("target_low_", "target_high_"),
    ("output_low_", "output_high_"),
    ("eps_low_", "eps_high_"),
    ("pressure_low_", "pressure_high_"),
    ("lower", "upper"),
)


def misfit(model: Any) -> str:
    """Return the inconsistency of an object, or ""."""
    held = getattr(model, "__dict__", {})
    return next((said for rule in _RULES if (said := rule(model, held))), "")


def _features(_: Any, held: Mapping[str, Any]) -> str:
    n, names = held.get("n_features_in_"), held.get("feature_names_in_")
    if "n_features_in_" in held and not (type(n) is int and 1 <= n <= MOST_FEATURES):
        return f"n_features_in_ is {n!r:.40}"
    if "feature_names_in_" in held:
        if not isinstance(names, np.ndarray) or names.ndim != 1 or not all(isinstance(x, str) for x in names):
            return "feature_names_in_ is not a list of names"
        if "n_features_in_" in held and len(names) != n:  # a search has it as a property
            return f"{len(names)} names for {n} features"
    return ""


def _positions(_: Any, held: Mapping[str, Any]) -> str:
    n = held.get("n_features_in_")
    found: list[Any] = list(_values(held.get("signal_columns_"))) + list(_values(held.get("column_indices_")))
    found += [] if held.get("time_index_") is None else [held["time_index_"]]
    for k in found:
        if isinstance(k, bool) or not isinstance(k, (int, np.integer)) or n is None or not 0 <= k < n:
            return f"column {k!r:.40} of {n}"
    return ""


def _values(of: Any) -> Sequence[Any]:
    return list(of.values()) if isinstance(of, dict) else [] if of is None else list(np.atleast_1d(of))


def _per_feature(model: Any, held: Mapping[str, Any]) -> str:
    if not type(model).__module__.startswith("sklearn.preprocessing"):
        return ""
    n = held.get("n_features_in_")
    for name in _PER_FEATURE:
        value = held.get(name)
        if value is not None and np.shape(np.asarray(value)) != (n,):
            return f"{name} has the shape {np.shape(value)} for {n} features"
    return ""


def _linear(model: Any, held: Mapping[str, Any]) -> str:
    if not type(model).__module__.startswith("sklearn.linear_model") or not {"coef_", "intercept_"} <= held.keys():
        return ""
    coef, start, n = np.shape(held["coef_"]), np.shape(held["intercept_"]), held.get("n_features_in_")
    if held["coef_"] is None or not 1 <= len(coef) <= 2 or coef[-1] != n:
        return f"coef_ has the shape {coef} for {n} features"
    return "" if start in ((), coef[:-1]) else f"intercept_ has the shape {start} beside coef_ of {coef}"


def _polynomial(model: Any, held: Mapping[str, Any]) -> str:
    degrees = [held[name] for name in ("degree", "_min_degree", "_max_degree") if name in held]
    flat = [d for item in degrees for d in (item if isinstance(item, (tuple, list)) else [item]) if d is not None]
    if not all(type(d) is int and 0 <= d <= MOST_DEGREE for d in flat):
        return f"a degree of {flat!r:.60}"
    n, most = held.get("n_features_in_"), held.get("_max_degree")
    if most is not None and n is not None and comb(n + most, most) > MOST_FEATURES:
        return f"degree {most} of {n} features makes more than {MOST_FEATURES} terms"
    powers, coef = held.get("powers_"), held.get("scaled_coef_", held.get("coef_"))
    if isinstance(powers, np.ndarray):
        if powers.ndim != 2 or powers.dtype.kind not in "iu" or not ((powers >= 0) & (powers <= MOST_DEGREE)).all():
            return "powers_ is not a table of degrees"
        if (found := np.shape(np.asarray(coef)))[-1:] != (len(powers),):
            return f"{len(powers)} terms and coefficients of {found}"
        if any(np.size(np.asarray(held[k])) != np.size(np.asarray(coef)) for k in ("coef_",) if k in held):
            return f"coefficients of {found} and {np.shape(np.asarray(held['coef_']))}"
        columns = len(held.get("_names", ())) + len(held.get("sign_of") or ())
        scales = np.shape(np.asarray(held.get("signal_scales_", ())))
        if "_names" in held and (powers.shape[1] != columns or scales not in ((0,), (len(held["_names"]),))):
            return f"powers_ of {powers.shape} and signal_scales_ of {scales} for {columns} signals"
        if len(held.get("terms_", powers)) != len(powers):
            return f"{len(held['terms_'])} names for {len(powers)} terms"
    return ""


def _layers(_: Any, held: Mapping[str, Any]) -> str:
    if "coefs_" in held:  # scikit-learn: (inputs, outputs) of each layer
        chain = [(np.shape(w), np.shape(b)) for w, b in zip(held["coefs_"], held["intercepts_"], strict=True)]
        return _chained(chain, held.get("n_features_in_"))
    weights = held.get("weights_")
    if isinstance(weights, dict) and "W0" in weights:
        n = len(weights) // 2
        if set(weights) != {f"{kind}{k}" for kind in "Wb" for k in range(n)}:
            return f"weights_ of {', '.join(map(str, weights))[:80]}"
        return _chained([(np.shape(weights[f"W{k}"]), np.shape(weights[f"b{k}"])) for k in range(n)], None)
    if isinstance(weights, list):
        if len(weights) % 2 or not all(isinstance(w, np.ndarray) and w.dtype.kind == "f" for w in weights):
            return "weights_ is not a list of weights and offsets"
        return _chained([(w.shape[::-1], b.shape) for w, b in zip(weights[::2], weights[1::2], strict=True)], None)
    return ""


def _chained(layers: list[tuple[tuple[int, ...], tuple[int, ...]]], inputs: int | None) -> str:
    for k, (weight, offset) in enumerate(layers):
        if len(weight) != 2 or offset != weight[1:]:
            return f"layer {k} has weights of {weight} and offsets of {offset}"
    if any(one[0][1] != other[0][0] for one, other in pairwise(layers)) or not layers:
        return f"layers of {[w for w, _ in layers]!r:.120} do not follow each other"
    return "" if inputs in (None, layers[0][0][0]) else f"the first layer takes {layers[0][0][0]} of {inputs} features"


def _recurrent(_: Any, held: Mapping[str, Any]) -> str:
    weights = held.get("weights_")
    if not isinstance(weights, dict) or "weight_hh_l0" not in weights:
        return ""
    n = np.shape(weights["weight_hh_l0"])[-1:]
    for name, value in weights.items():
        if name.startswith("weight_hh") and np.shape(value)[-1:] != n:
            return f"{name} has the shape {np.shape(value)}"
        if name.startswith("bias") and np.shape(value) != np.shape(weights["weight_hh_l0"])[:1]:
            return f"{name} has the shape {np.shape(value)}"
    return ""


def _scales(_: Any, held: Mapping[str, Any]) -> str:
    for mean, scale in _PAIRS:
        if mean in held and scale in held and np.shape(held[mean]) != np.shape(held[scale]):
            return f"{mean} of {np.shape(held[mean])} and {scale} of {np.shape(held[scale])}"
    for name in ("input_scale_", "target_scale_", "output_scale_", "spread"):
        value = held.get(name)
        if isinstance(value, (np.ndarray, float)) and not (np.isfinite(value) & (np.asarray(value) > 0)).all():
            return f"{name} is not positive"
    shapes = {np.shape(held[name]) for name in ("mean", "spread", "lower", "upper", "saturated") if name in held}
    return "" if len(shapes) < 2 else f"scales of the shapes {sorted(shapes)}"


def _order(_: Any, held: Mapping[str, Any]) -> str:
    for low, high in _ORDERED:
        one: Any = held.get(low)
        other: Any = held.get(high)
        if _numeric(one) and _numeric(other):
            if np.shape(one) != np.shape(other):
                return f"{low} of {np.shape(one)} and {high} of {np.shape(other)}"
            if (np.asarray(one) > np.asarray(other)).any():
                return f"{low} lies above {high}"
    knots, inside = np.asarray(held.get("knots_", [0.0])), np.asarray(held.get("input_range_", [[0.0], [1.0]]))
    if knots.ndim != 1 or knots.dtype.kind != "f" or not (np.diff(knots) > 0).all():
        return "knots_ do not rise"
    if "knots_" in held and len(knots) != held.get("pieces", 0) + 1:
        return f"{len(knots)} knots of {held.get('pieces')!r:.20} pieces"
    if inside.ndim != 2 or len(inside) != 2 or inside.dtype.kind != "f" or (inside[0] > inside[1]).any():
        return "input_range_ is not a range"
    return ""


def _numeric(value: Any) -> bool:
    return isinstance(value, (float, int, np.ndarray, np.number)) and not isinstance(value, bool)


def _square(_: Any, held: Mapping[str, Any]) -> str:
    for name in ("covariance_", "information_", "factor_"):
        value = held.get(name)
        if isinstance(value, np.ndarray) and (value.ndim != 2 or value.shape[0] != value.shape[1]):
            return f"{name} has the shape {value.shape}"
    names, covariance = held.get("fitted_names_"), held.get("covariance_")
    if isinstance(names, list) and isinstance(covariance, np.ndarray) and len(names) != len(covariance):
        return f"{len(names)} fitted parameters and a covariance of {covariance.shape}"
    return ""


_RULES: tuple[Callable[[Any, Mapping[str, Any]], str], ...] = (
    _features,
    _positions,
    _per_feature,
    _linear,
    _polynomial,
    _layers,
    _recurrent,
    _scales,
    _order,
    _square,
)
