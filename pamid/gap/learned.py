r"""A learned remainder: the residual of the named causes, predicted by a nonparametric function of the signals.

.. math:: r(s) = w_0 + \sum_j w_j \cos(\omega_j^\top s + b_j)

over the signals s and how far each is from its exponentially weighted past, with weights by ridge regression. How much
of what is left it predicts is measured on unseen runs; where that share is zero, the remainder is zero.

References
----------
A. Rahimi, B. Recht, "Random features for large-scale kernel machines", Advances in Neural Information Processing
Systems 20, 2007.
"""

from collections.abc import Mapping

import numpy as np

from ..fitting.grouped_ridge import grouped_ridge
from ..signals.recursion import past
from ..signals.thinning import spaced
from .inference.discrepancy import AGES
from .inference.floor import FOLDS

_COSINES = 120
_RIDGES = (0.01, 0.1, 1.0, 10.0, 1e2, 1e3, 1e4)
_ROWS = 20_000  # rows that weights are fitted to

Model = dict[str, np.ndarray]
"""A fitted remainder, arrays by name."""


def learn(signals: Mapping[str, np.ndarray], left: np.ndarray, codes: np.ndarray, dt: float, seed: int) -> Model:
    """Fit a remainder."""
    S = _past_and_present(signals, codes, dt)
    middle, size = np.median(S, axis=0), np.maximum(np.quantile(S, 0.95, axis=0) - np.quantile(S, 0.05, axis=0), 1e-12)
    rng = np.random.RandomState(seed)
    omega = rng.standard_normal((S.shape[1], _COSINES)) * np.where(np.arange(_COSINES) % 2, 1.0, 3.0)
    reads = np.argsort(rng.random_sample(omega.shape), axis=0) < min(3, S.shape[1])
    model: Model = {"middle": middle, "size": size, "omega": omega * reads}
    model["phase"] = rng.uniform(0.0, 2.0 * np.pi, _COSINES)
    rows = np.arange(len(left))[spaced(len(left), _ROWS)]
    B, r = _basis(model, S[rows]), left[rows]
    names, fold = np.unique(codes[rows], return_inverse=True)
    # One run carries no information about others: its parts replace them.
    fold = fold % FOLDS if len(names) > 2 else (2 * FOLDS * np.arange(len(rows)) // len(rows)) % FOLDS
    fit = grouped_ridge(B, r, fold, _RIDGES)
    model["share"], model["weights"] = np.array(fit.share), fit.weights
    return model


def predict(model: Model, signals: Mapping[str, np.ndarray], codes: np.ndarray, dt: float) -> np.ndarray:
    """Return the remainder that a model predicts; the arguments are those of `learn`."""
    return np.asarray(_basis(model, _past_and_present(signals, codes, dt)) @ model["weights"])


def _basis(model: Model, S: np.ndarray) -> np.ndarray:
    # Outside the data the function keeps its value.
    x = np.clip((S - model["middle"]) / model["size"], -1.0, 1.0)
    return np.column_stack([np.ones(len(x)), x, np.cos(x @ model["omega"] + model["phase"])])


def _past_and_present(signals: Mapping[str, np.ndarray], codes: np.ndarray, dt: float) -> np.ndarray:
    starts = np.flatnonzero(np.diff(codes, prepend=codes[0] - 1))
    found = []
    for x in signals.values():
        found.append(x)
        found += [x - past(x, float(np.exp(-dt / age)), starts) for age in AGES]
    return np.column_stack(found)
