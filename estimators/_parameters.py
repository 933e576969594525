"""What all estimators have in common: entries of docstrings, data frames of other libraries, requests for runs."""

import inspect
from collections.abc import Callable
from functools import wraps
from typing import Any

from pamid.explained import explain_methods
from pamid.explained import parameters as parameters
from pamid.signals.frames import as_pandas, is_foreign


class Methods:
    """What methods of the same name have in common; never made."""

    def fit(self, X: Any, y: Any, sample_weight: Any, groups: Any) -> Any:
        """Fit.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            Signals, SI units, absolute pressure.
        y : array_like, shape (n_samples,)
            Target, SI units, such as force (N) or mass flow (kg/s).
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

    assess = simulate = predict_interval = predict

    def transform(self, X: Any, y: Any, sample_weight: Any, groups: Any) -> Any:
        """Transform.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            The signals that the fit read, SI units, absolute pressure.

        Returns
        -------
        DataFrame or ndarray, shape (n_samples, n_features_out)
            X with the columns appended, a DataFrame where X is one and ``set_output(transform="default")`` was not
            asked for.
        """

    fit_transform = transform

    def score(self, X: Any, y: Any, sample_weight: Any, groups: Any) -> Any:
        """Score.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            As in `predict`.
        y : array_like, shape (n_samples,) or (n_samples, n_outputs)
            Measured target.

        Returns
        -------
        float
            R², dimensionless; one is perfect.
        """

    def volume(self, X: Any) -> Any:
        """Return the volume.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            The signals that the fit read, SI units, absolute pressure.

        Returns
        -------
        VolumeJet
            V (m³), ∂V/∂ε (m³) and ∂V/∂P (m³/Pa), each of shape (n_samples,).
        """

    def laws(self) -> Any:
        """Return laws.

        Returns
        -------
        tuple of Law
            One law, of force (N) or of flow (kg/s), or both.
        """

    def get_feature_names_out(self, input_features: Any) -> Any:
        """Name columns.

        Parameters
        ----------
        input_features : array_like of str, optional
            Names of the columns, where X has none.

        Returns
        -------
        ndarray of str
            Names of the columns.
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


class TakesFrames:
    """Base of estimators whose methods of X take data frames of other libraries.

    Its own methods and those of mixins of this package are wrapped, so none is forgotten; scikit-learn's call them.
    A warning's ``stacklevel`` counts the wrapper. A method that takes runs, or which rows count, requests these from
    metadata routing.

    Parameters
    ----------
    rest_length : float
        Rest length L₀ of the muscle, m.
    rest_diameter : float
        Rest diameter D₀ of the muscle, m.
    atmospheric_pressure : float
        Ambient pressure, Pa, absolute.
    pressure_limits : (float, float), optional
        Least and largest answer, Pa absolute; by default the range of the fit.
    hidden : int
        Units of the hidden layer.
    one_trajectory : bool
        Whether all rows are one run, where neither groups nor a column says otherwise.
    device : str
        Where to train, for instance ``"cuda"``.
    random_state : int or RandomState, optional
        Seed of the initial weights.

    Attributes
    ----------
    n_features_in_ : int
        Number of columns seen in fit.
    feature_names_in_ : ndarray of str
        Names of these columns, if they have names.
    """

    def __init_subclass__(cls, **kwargs: Any) -> None:
        for name in ("fit", "partial_fit", "predict", "score", "transform"):
            taken = inspect.signature(getattr(cls, name)).parameters if name in dir(cls) else ()
            if asked := {key: True for key in ("groups", "where") if key in taken}:
                setattr(cls, f"__metadata_request__{name}", asked)
        super().__init_subclass__(**kwargs)
        for name in [n for n in dir(cls) if not n.startswith("_")]:
            method = inspect.getattr_static(cls, name)
            if inspect.isfunction(method) and _reads_table(method):
                setattr(cls, name, _of_any_frame(method))
        explain_methods(cls, Methods)


def _reads_table(method: Callable[..., Any]) -> bool:
    """Return whether a method of this package has X as first parameter and is not wrapped yet."""
    own = method.__module__.startswith("pamid.") and not getattr(method, "takes_frames", False)
    return own and [*inspect.signature(method).parameters][1:2] == ["X"]


def _of_any_frame(method: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(method)
    def taking_frames(self: Any, X: Any, *args: Any, **kwargs: Any) -> Any:
        return method(self, as_pandas(X) if is_foreign(X) else X, *args, **kwargs)

    taking_frames.takes_frames = True  # type: ignore[attr-defined]
    return taking_frames
