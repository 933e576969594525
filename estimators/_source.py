"""The fitted model that an adaptation starts from, however it is handed over."""

from __future__ import annotations

from typing import Any, cast

from sklearn.frozen import FrozenEstimator
from sklearn.pipeline import Pipeline

from pamid.errors import IncompatibleError

from ._base import SignalEstimator
from ._pihm import HybridModel


def hybrid_of(source: Any, who: str) -> HybridModel:
    """Return the fitted hybrid model behind a source; the source is never altered."""
    found = source
    while True:
        if isinstance(found, FrozenEstimator):
            found = found.estimator
        elif isinstance(found, Pipeline):
            found = found.steps[-1][1]
        elif isinstance(inner := getattr(found, "model_", None), HybridModel):
            found = inner
        else:
            break
    if not isinstance(found, HybridModel) and not (
        isinstance(found, SignalEstimator) and "source" in found.get_params(deep=False)
    ):
        raise IncompatibleError(
            f"The source of {who} is {type(source).__name__ if source is not None else None}.",
            "a fitted StaticPIHM, ThermodynamicPIHM or JointPIHM, or an adaptation of one",
            "Fit one on the muscle whose data are plenty, and pass it as source.",
        )
    if "weights_" not in vars(found):
        raise IncompatibleError(
            f"The source of {who}, {type(found).__name__}, is not fitted.",
            "a fitted model",
            "Fit it first. If it was fitted, a clone has stripped its fit, as searches and cross-validation do: pass "
            "source=sklearn.frozen.FrozenEstimator(fitted), which clones leave whole.",
        )
    if getattr(found, "effect_values_", None):
        raise IncompatibleError(
            f"The source of {who} was fitted with effects: {', '.join(found.effect_values_)}.",
            "a source without effects",
            "Fit the source without effects.",
        )
    return cast("HybridModel", found)
