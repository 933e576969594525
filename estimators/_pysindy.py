"""The one place that knows PySINDy: libraries of terms, sparse regression, differentiation.

PySINDy is imported when first needed. Its objects are made for one call and dropped, so that fitted estimators hold
numpy arrays alone. Its own estimators fail while metadata routing is on (2.1.0 lacks the routing methods), so every
call runs with routing off.
"""

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
import sklearn
from sklearn.base import clone

from pamid.errors import FitError, PamidWarning, UnknownOptionError

OPTIMIZERS = ("stlsq", "sr3", "frols")


def polynomial_powers(n_signals: int, degree: int, *, interaction: bool, bias: bool) -> np.ndarray:
    """Return the exponent of each signal in each term of PySINDy's polynomial library, (n_terms, n_signals)."""
    from pysindy import PolynomialLibrary

    with sklearn.config_context(enable_metadata_routing=False):
        library = PolynomialLibrary(degree=degree, include_interaction=interaction, include_bias=bias)
        return np.asarray(library.fit(np.zeros((2, n_signals))).powers_, dtype=int)


def term_names(powers: np.ndarray, names: Sequence[str]) -> list[str]:
    """Write each term as a product of powers, as PySINDy does: ``eps^2 P``."""
    return [
        " ".join(n if p == 1 else f"{n}^{p}" for n, p in zip(names, row, strict=True) if p) or "1" for row in powers
    ]


def sparse_regression(
    terms: np.ndarray, targets: np.ndarray, optimizer: Any, *, threshold: float, alpha: float, max_iter: int
) -> tuple[np.ndarray, int]:
    """Regress targets on few of the terms."""
    with sklearn.config_context(enable_metadata_routing=False), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Sparsity parameter is too big")  # reported in our own words below
        regression = _make(optimizer, threshold, alpha, max_iter)
        try:
            regression.fit(terms, targets)
        except ValueError as error:
            raise _dependent(type(regression).__name__, terms, str(error)) from error
        coefficients = np.array(regression.coef_, dtype=float).reshape(targets.shape[1], terms.shape[1])
    if optimizer == "frols":  # greedy selection goes on into rounding where a term follows from others
        for chosen in coefficients != 0:
            if np.linalg.matrix_rank(terms[:, chosen], tol=1e-10 * np.linalg.norm(terms)) < chosen.sum():
                raise _dependent("FROLS", terms, "it chose terms that depend on each other")
    if not coefficients.any(axis=1).all():
        warnings.warn(
            f"The sparse regression kept no term for {int((~coefficients.any(axis=1)).sum())} of {len(coefficients)} "
            f"targets, which are predicted as zero. Lower the threshold ({threshold:g} of the target's root mean "
            "square), or check that the target varies.",
            PamidWarning,
            stacklevel=5,
        )
    return coefficients, max(1, len(getattr(regression, "history_", ())) - 1)


def _dependent(name: str, terms: np.ndarray, why: str) -> FitError:
    return FitError(
        f"{name} failed on {terms.shape[1]} terms: {why}.",
        "terms that are linearly independent on the data",
        "Lower degree, drop a signal, give more varied data, or use optimizer='stlsq'.",
    )


def _make(optimizer: Any, threshold: float, alpha: float, max_iter: int) -> Any:
    import pysindy

    if not isinstance(optimizer, str):
        return clone(optimizer)
    if optimizer == "stlsq":
        return pysindy.STLSQ(threshold=threshold, alpha=alpha, max_iter=max_iter)
    if optimizer == "sr3":  # its L0 proximal step cuts below sqrt(2 λ ν); choose λ so that this is the threshold
        return pysindy.SR3(reg_weight_lam=threshold**2 / 2, relax_coeff_nu=1.0, max_iter=max_iter, unbias=True)
    if optimizer == "frols":
        return pysindy.FROLS(alpha=alpha, max_iter=max_iter)
    raise UnknownOptionError(
        f"optimizer is {optimizer!r}.",
        f"one of {', '.join(OPTIMIZERS)}, or an optimizer of PySINDy",
        "Choose one of them.",
    )


def differentiate(x: np.ndarray, t: np.ndarray, window: int) -> np.ndarray:
    """Differentiate the columns of one run: smoothed finite differences, plain ones for `window` below 5."""
    from pysindy import FiniteDifference, SmoothedFiniteDifference

    with sklearn.config_context(enable_metadata_routing=False):
        if window < 5:
            return np.asarray(FiniteDifference()(x, t=t))
        smoother = {"window_length": window, "polyorder": 3, "axis": 0}
        return np.asarray(SmoothedFiniteDifference(smoother_kws=smoother)(x, t=t))
