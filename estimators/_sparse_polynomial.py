"""Sparse polynomials of signals whose sizes differ by orders of magnitude: the common part of the SINDy estimators.

Every signal, every term and every target is divided by its root mean square before the regression. A threshold then
means the same for a pressure of 1e5 Pa and a contraction of 0.1: the part of the target below which a term is
dropped. Nothing is centred, because that would turn a sparse law of physics into a dense one.
"""

from collections.abc import Sequence
from dataclasses import KW_ONLY, field
from typing import Any

import numpy as np

from pamid.errors import ParameterError
from pamid.fitting.least_squares import compress

from ._checks import check_counts, check_sizes
from ._parameters import parameters
from ._pysindy import polynomial_powers, sparse_regression, term_names

FEW_FACTORS = 64
"""Rows up to which all terms are evaluated in one go: a single row of a control loop takes a fifth of the time."""


@parameters
class PolynomialLibraryMixin:
    """What `SINDyRegressor` and `SINDyModel` share: fitting, evaluating and writing out sparse polynomials.

    Parameters
    ----------
    degree : int
        Highest degree of a term.
    interaction : bool
        Whether terms mix signals.
    bias : bool
        Whether there is a constant term.
    sign_of : sequence of str
        Signals whose sign enters the library too, for effects of the direction of motion (``("deps",)``).
    optimizer : {"stlsq", "sr3", "frols"} or PySINDy optimizer
        Sparse regression: sequentially thresholded least squares, sparse relaxed regularised regression, or greedy
        orthogonal selection. An instance of PySINDy is cloned, and brings its own settings.
    threshold : float
        Terms whose coefficient is smaller are dropped; in units of the target's root mean square for a term scaled
        to root mean square one (dimensionless). No effect for "frols".
    alpha : float
        Ridge penalty in the scaled problem, dimensionless; no effect for "sr3".
    max_iter : int
        Maximum number of iterations; for "frols", of terms.

    Attributes
    ----------
    terms_ : list of str
        All terms of the library.
    powers_ : ndarray, shape (n_terms, n_signals + n_signs)
        Exponent of each signal, and of each sign, in each term.
    signal_scales_ : ndarray, shape (n_signals,)
        Root mean square of each signal, in the signal's unit.
    scaled_coef_ : ndarray, shape (n_targets, n_terms)
        Coefficients for signals in units of `signal_scales_`.
    n_iter_ : int
        Iterations of the sparse regression.
    factor_ : ndarray
        Triangular factor of terms and target over all rows seen, from which `partial_fit` continues.
    total_weight_ : float
        Sum of the weights of all rows seen.
    reference_scales_ : ndarray, shape (n_signals,)
        Scales of the signals in `factor_`.
    """

    _: KW_ONLY
    degree: int = 3
    interaction: bool = True
    bias: bool = True
    sign_of: Sequence[str] = ()
    optimizer: Any = "stlsq"
    threshold: float = 0.02
    alpha: float = 1e-6
    max_iter: int = 20

    factor_: np.ndarray = field(init=False)
    total_weight_: float = field(init=False)

    def _check_library(self, signals: Sequence[str]) -> None:
        check_counts(self, "degree", "max_iter")
        check_sizes(self, threshold=0.0, alpha=0.0)
        unknown = [name for name in self.sign_of if name not in signals]
        if unknown:
            raise ParameterError(
                f"sign_of names {', '.join(unknown)}.", f"signals among {', '.join(signals)}", "Correct sign_of."
            )

    def _fit_library(self, signals: np.ndarray, names: Sequence[str], targets: np.ndarray, weights: np.ndarray) -> None:
        """Find sparse coefficients of the targets, shape (n_samples, n_targets)."""
        n_signs = len(self.sign_of)
        powers = polynomial_powers(
            len(names) + n_signs, self.degree, interaction=bool(self.interaction), bias=bool(self.bias)
        )
        if n_signs:  # even powers of a sign are one, and odd ones the sign itself
            powers = powers[(powers[:, -n_signs:] <= 1).all(axis=1)]
        self._names = [str(name) for name in names]
        self.powers_ = powers
        self.terms_ = term_names(powers, [*names, *(f"sign({name})" for name in self.sign_of)])
        self.reference_scales_ = _nonzero(np.sqrt(weights / weights.sum() @ signals**2))
        self.factor_ = np.zeros((0, len(powers) + targets.shape[1]))
        self.total_weight_ = 0.0
        self._take_in(signals, targets, weights)

    def _take_in(self, signals: np.ndarray, targets: np.ndarray, weights: np.ndarray) -> None:
        """Add rows to the triangular factor of [terms | targets], and regress on all rows so far."""
        terms = self._terms(signals, self.reference_scales_)
        self.factor_ = compress(self.factor_, terms, targets, weights)
        self.total_weight_ += float(weights.sum())
        n_terms, n_signals = len(self.powers_), len(self._names)
        root = self.factor_ / np.sqrt(self.total_weight_)  # a weight counts like so many repetitions of its row
        size = np.linalg.norm(root, axis=0)
        single = np.eye(n_signals, self.powers_.shape[1], dtype=int)  # powers of the terms that are one signal each
        alone = [int(np.flatnonzero((self.powers_ == unit).all(axis=1))[0]) for unit in single]
        self.signal_scales_ = self.reference_scales_ * _nonzero(size[alone])
        scaling = np.prod((self.reference_scales_ / self.signal_scales_) ** self.powers_[:, :n_signals], axis=1)
        term_scales, target_scales = _nonzero(size[:n_terms]), _nonzero(size[n_terms:])
        coefficients, self.n_iter_ = sparse_regression(
            root[:, :n_terms] / term_scales,
            root[:, n_terms:] / target_scales,
            self.optimizer,
            threshold=float(self.threshold),
            alpha=float(self.alpha),
            max_iter=int(self.max_iter),
        )
        self.scaled_coef_ = coefficients / (term_scales * scaling) * target_scales[:, None]

    def _terms(self, signals: np.ndarray, scales: np.ndarray) -> np.ndarray:
        """Evaluate the terms on scaled signals, shape (n_samples, n_terms)."""
        signs = [np.sign(signals[:, self._names.index(name)]) for name in self.sign_of]
        factors = np.column_stack([signals / scales, *signs])
        if len(factors) <= FEW_FACTORS:
            return np.asarray(np.prod(factors[:, None, :] ** self.powers_, axis=2))
        terms = np.ones((len(factors), len(self.powers_)))
        for column, row in enumerate(self.powers_):
            for signal in np.flatnonzero(row):
                terms[:, column] *= factors[:, signal] ** row[signal]
        return terms

    def _evaluate(self, signals: np.ndarray) -> np.ndarray:
        return self._terms(signals, self.signal_scales_) @ self.scaled_coef_.T

    def _physical_coefficients(self) -> np.ndarray:
        """Coefficients for signals in their own units, shape (n_targets, n_terms)."""
        n = len(self.signal_scales_)
        return self.scaled_coef_ / np.prod(self.signal_scales_ ** self.powers_[:, :n], axis=1)

    def _equations(self, targets: Sequence[str], digits: int = 4) -> list[str]:
        """Write out the polynomials for reading."""
        lines = []
        for target, row in zip(targets, self._physical_coefficients(), strict=True):
            parts = [
                f"{c:.{digits}g}" if term == "1" else f"{c:.{digits}g} {term}"
                for c, term in zip(row, self.terms_, strict=True)
                if c != 0
            ]
            lines.append(f"{target} = {' + '.join(parts) or '0'}".replace("+ -", "- "))
        return lines


def _nonzero(scales: np.ndarray) -> np.ndarray:
    return np.where(scales > 0, scales, 1.0)
