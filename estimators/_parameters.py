"""What methods of estimators have in common, for the docstrings of those of the same name."""

from __future__ import annotations

from typing import Any

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

    def get_feature_names_out(self, input_features: Any) -> Any:
        """Name columns.

        Parameters
        ----------
        input_features : array_like of str, optional
            Names of the columns, where X has none.
        """

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
