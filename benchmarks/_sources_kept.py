"""What is compared where a source may not help: adapters, and fits of the same samples that know no source."""

from __future__ import annotations

from typing import Any

import numpy as np
from pamid.estimators import FullFineTuning, LoRA, PartialFineTuning, QAdapter


def adapters(network: Any, options: dict[str, Any]) -> dict[str, Any]:
    """Return the adapters, `Q as adapted` being one that keeps its source whole."""
    return {
        "Q": QAdapter(network, **options),
        "Q as adapted": QAdapter(network, blend=False, **options),
        "Q alone, as adapted": QAdapter(network, base="frozen", blend=False, **options),
        "LoRA": LoRA(network, **options),
        "PFT": PartialFineTuning(network, **options),
        "FFT": FullFineTuning(network, **options),
    }


def fresh() -> dict[str, tuple[Any, list[str]]]:
    """Return fits that know no source, with the columns that each reads."""
    from sklearn.ensemble import HistGradientBoostingRegressor
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Matern, WhiteKernel
    from sklearn.linear_model import RidgeCV
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import PolynomialFeatures, StandardScaler

    def process(kernel: Any) -> Any:
        whole = ConstantKernel(1.0) * kernel + WhiteKernel(1e-2, (1e-8, 1.0))
        return make_pipeline(StandardScaler(), GaussianProcessRegressor(whole, normalize_y=True))

    cubic = make_pipeline(StandardScaler(), PolynomialFeatures(3), RidgeCV(np.logspace(-6, 2, 20)))
    return {
        "Gaussian process (eps, P)": (process(RBF([1.0] * 2)), ["eps", "P"]),
        "Gaussian process (eps, P, dP)": (process(RBF([1.0] * 3)), ["eps", "P", "dP"]),
        "Matern process (eps, P, dP)": (process(Matern([1.0] * 3, nu=2.5)), ["eps", "P", "dP"]),
        "cubic ridge": (cubic, ["eps", "P", "dP"]),
        "boosted trees": (HistGradientBoostingRegressor(min_samples_leaf=5, random_state=0), ["eps", "P", "dP"]),
    }
