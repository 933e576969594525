"""The fitted model that an adaptation starts from, however it is handed over."""

from typing import Any, cast

import numpy as np
from sklearn.frozen import FrozenEstimator
from sklearn.pipeline import Pipeline

from pamid.errors import IncompatibleError
from pamid.volume.neural import InputScale

from ._base import SignalEstimator
from ._pihm import HybridModel


def inside(source: Any) -> Any:
    """Return the estimator inside frozen ones, and at the end of pipelines."""
    while isinstance(source, FrozenEstimator | Pipeline):
        source = source.estimator if isinstance(source, FrozenEstimator) else source.steps[-1][1]
    return source


def hybrid_of(source: Any, who: str) -> HybridModel:
    """Return the fitted hybrid model behind a source; the source is never altered."""
    found = inside(source)
    while isinstance(inner := inside(getattr(found, "model_", None)), HybridModel):
        found = inner
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


def tiny_source() -> Any:
    """Return a small model of force, frozen and made without a fit, from which the common checks of adapters start."""
    from .static_pihm import StaticPIHM

    rng = np.random.default_rng(0)
    one = dict.fromkeys(("eps", "deps", "P", "dP"), 0)
    model = StaticPIHM(0.2, 0.01, volume_model="neural", hidden_layer_sizes=(6,), signals=one, random_state=0)
    model.input_scale_ = InputScale.of(rng.uniform(0.0, 1.0, (50, 4)))
    model.input_range_ = np.array([[0.0] * 4, [1.0] * 4])
    model.target_scale_, model.volume_scale_, model.anchor_ = np.array([1.0]), 1e-6, None
    model.weights_ = [0.5 * rng.normal(size=shape) for shape in ((6, 4), (6,), (1, 6), (1,))]
    model.n_iter_, model.loss_curve_, model.validation_curve_, model.status_ = 1, [0.1], [], "finished"
    model.n_features_in_, model.signal_columns_ = 1, dict(one)
    return FrozenEstimator(model)
