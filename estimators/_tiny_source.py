"""A small fitted model, built without a fit, from which the common checks of the adapters start."""

from __future__ import annotations

from typing import Any

import numpy as np
from sklearn.frozen import FrozenEstimator

from pamid.volume.neural import InputScale

from .static_pihm import StaticPIHM


def tiny_source() -> Any:
    """Return a frozen model of force with a network of six units, for signals of the order of one."""
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
