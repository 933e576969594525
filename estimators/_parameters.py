"""What methods of the same name have in common, and docstrings of methods that take it."""

from __future__ import annotations

import inspect
from typing import Any

from pamid.explained import Docstring, bases_of
from pamid.explained import parameters as parameters


class Methods:
    """What methods of the same name have in common; never made."""

    def fit(self, X: Any, y: Any, sample_weight: Any, groups: Any) -> Any:
        """Fit.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            Signals, SI units, absolute pressure.
        y : array_like, shape (n_samples,)
            Target, SI units.
        sample_weight : array_like, shape (n_samples,)
            Weights; a weight of 2 is the same row twice.
        groups : array_like, shape (n_samples,)
            Run of each row; a column ``trajectory`` of a DataFrame serves too.

        Returns
        -------
        self
            The fitted estimator.
        """

    partial_fit = fit

    def predict(self, X: Any, groups: Any) -> Any:
        """Predict.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            The signals that the fit read, SI units, absolute pressure.
        groups : array_like, shape (n_samples,)
            Run of each row; a column ``trajectory`` of a DataFrame serves too.

        Returns
        -------
        ndarray, shape (n_samples,)
            Prediction in the unit of y.
        """

    transform = assess = simulate = volume = predict_interval = predict

    def formulas(self, signals: Any) -> Any:
        """Return formulas.

        Parameters
        ----------
        signals : mapping of str to array or symbol
            Each signal that the model reads, SI units.

        Returns
        -------
        dict of str to (str, array or symbol)
            Unit and value of each output.
        """


def explain_methods(cls: type) -> None:
    """Complete the docstrings of the methods of a class from those of its bases and of its fit."""
    for name, method in vars(cls).items():
        if name.startswith("_") or not inspect.isfunction(method) or method.__doc__ is None:
            continue
        same = [Docstring(vars(c)[name].__doc__) for c in (*bases_of(cls), Methods) if name in vars(c)]
        fits = [Docstring(c.fit.__doc__) for c in (cls, Methods) if hasattr(c, "fit")]
        doc = Docstring(method.__doc__)
        doc.take("Parameters", [*same, *fits], list(inspect.signature(method).parameters.values())[1:])
        if "Returns" not in doc.sections and (told := [d.sections["Returns"] for d in same if "Returns" in d.sections]):
            doc.sections["Returns"] = told[0]
        method.__doc__ = str(doc)
