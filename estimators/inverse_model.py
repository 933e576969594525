"""From a wanted force and contraction to the pressure that brings both about."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from sklearn.utils.validation import column_or_1d

from pamid.errors import ExtrapolationWarning, ParameterError, UnreachableError

from ._base import Signals
from ._checks import check_option
from ._one_layer import OneLayerRegressor

POLICIES = ("warn", "clip", "raise")
_SLACK = 0.01  # of the range of pressure, by which a bare answer may pass a limit before it counts as saturated


class PressureAnswer(NamedTuple):
    """Answers of an inverse model, row by row, with flags of their reliability.

    Parameters
    ----------
    pressure : ndarray, shape (n_samples,)
        Absolute pressure within the limits, Pa.
    saturated : ndarray of bool, shape (n_samples,)
        Whether the pair asks for a pressure beyond a limit, so that the limit is the answer.
    extrapolated : ndarray of bool, shape (n_samples,)
        Whether the fit had no rows near the pair: the muscle may not reach it, or was not asked to.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.estimators import InverseModel
    >>> pairs = np.c_[np.tile([200.0, 400.0], 25), np.linspace(0.0, 0.2, 50)]
    >>> P = 1e5 + 500.0 * pairs[:, 0] + 2e6 * pairs[:, 1]
    >>> model = InverseModel(signals={"F": 0, "eps": 1}, hidden=3, random_state=0).fit(pairs, P)
    >>> answer = model.assess([[200.0, 0.1], [200.0, 0.6]])
    >>> answer.pressure.shape, answer.extrapolated.tolist()
    ((2,), [False, True])
    """

    pressure: np.ndarray
    saturated: np.ndarray
    extrapolated: np.ndarray


def answer_within(
    pressure: np.ndarray, saturated: np.ndarray, extrapolated: np.ndarray, policy: str, who: str
) -> np.ndarray:
    """Return the pressures, and warn or raise where the wanted pairs are out of reach."""
    flagged = saturated | extrapolated
    if policy == "clip" or not flagged.any():
        return pressure
    text = (
        f"{who}: of {len(pressure)} wanted pairs {int(saturated.sum())} ask for a pressure beyond its limits and "
        f"{int(extrapolated.sum())} lie outside the data of the fit (the first: row {int(np.argmax(flagged))})."
    )
    expected = "pairs of force and contraction that the muscle reached in the fit"
    if policy == "raise":
        raise UnreachableError(text, expected, "Ask for less, or fit on runs that reach them; assess() marks each row.")
    warnings.warn(
        f"{text} Expected {expected}. Pressures are bounded; assess() marks each row.",
        ExtrapolationWarning,
        stacklevel=5,
    )
    return pressure


class InverseModel(OneLayerRegressor):
    r"""Neural inverse model: the pressure that brings about a force and a contraction at the same time.

    .. math:: P = \bar P + \sigma_P \left(w^\top \tanh\!\left(W^\top s + b\right) + c\right), \quad
        s = \left(\frac{F - \bar F}{\sigma_F}, \frac{\varepsilon - \bar\varepsilon}{\sigma_\varepsilon}, \dots\right)

    with one hidden layer, trained by Levenberg–Marquardt. A muscle responds to a pressure with force and shortening
    together; the inverse turns a wanted pair into the set point of a pressure loop. Rates are further inputs
    (``inputs=("F", "eps", "deps")``), and so is the last direction of the motion, on which braid friction depends.

    Parameters
    ----------
    inputs : sequence of str, default=("F", "eps")
        Signals that the network reads: force (N), contraction ratio (dimensionless); also ``"deps"`` (1/s), ``"L"``
        (m) or any other column.
    hidden : int, default=20
        Units of the hidden layer.
    direction : bool, default=False
        Whether the last direction of the contraction is an input, too; needs runs in time order.
    direction_step : float, default=0.01
        Reversal of the contraction over which the direction switches, dimensionless; the input changes gradually over
        it.
    alpha : float, default=0.01
        Weight decay: factor of the squared weights in the sum of squares of the standardised target, dimensionless.
    max_iter : int, default=200
        Maximum number of Levenberg–Marquardt steps.
    tol : float, default=1e-5
        Relative improvement of the loss that counts, dimensionless; five steps with less end the fit.
    n_starts : int, default=3
        Initial weights tried for a few steps; the best are trained further.
    pressure_limits : (float, float), optional
        Least and largest answer, Pa absolute; by default the range of the fit.
    on_unreachable : {"warn", "clip", "raise"}, default="warn"
        What `predict` does about pairs that ask for a pressure beyond the limits or lie outside the data of the fit:
        bound the answer and warn, bound it silently, or raise `UnreachableError`.
    forget_rows : float, optional
        Rows over which `partial_fit` forgets; by default all rows count alike.
    one_trajectory : bool, default=False
        Whether all rows are one run, where neither groups nor a column says otherwise.
    trajectory_column : int, optional
        Position of the column that names the runs, for arrays that have no names.
    random_state : int or RandomState, optional
        Seed of the initial weights.
    signals : mapping of str to str or int, optional
        Column of a signal, by name or position, where it is not the signal's own name or place.

    Attributes
    ----------
    weights_ : dict of str to ndarray
        ``W0`` (n_inputs, hidden), ``b0``, ``W1`` (hidden, 1), ``b1``.
    input_mean_, input_scale_, input_low_, input_high_ : ndarray, shape (n_inputs,)
        Mean, standard deviation and range of the inputs, in their units.
    target_mean_, target_scale_, target_low_, target_high_ : ndarray, shape (1,)
        The same of the pressure, Pa.
    cells_ : ndarray of int, shape (n_cells, n_inputs)
        Cells of the input space that held rows of the fit.
    loss_curve_ : list of float
        Loss after each step, per row, in units of the target's variance.
    n_iter_ : int
        Steps of the last fit, and of `partial_fit` since.
    signal_columns_ : dict of str to int
        Column of each signal.
    n_outputs_ : int
        0 for a target without an axis of its own.
    n_features_in_ : int
        Number of columns seen in fit.
    feature_names_in_ : ndarray of str
        Names of these columns, if they have names.

    See Also
    --------
    InvertedForce : The inverse of a force model by root finding.
    ForwardModel : Force and contraction together from pressure and load.

    Notes
    -----
    The study that the settings follow predicted unseen sets to within 5 to 8 % of the range; it trained on a slow
    sinusoidal pressure, 0 to 7 bar, under loads of 15 to 100 kg.

    References
    ----------
    M. T. Hagan, M. B. Menhaj, "Training feedforward networks with the Marquardt algorithm", IEEE Transactions on
    Neural Networks 5(6), 1994. https://doi.org/10.1109/72.329697

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import InverseModel
    >>> rng = np.random.default_rng(0)
    >>> eps, P = rng.uniform(0, 0.2, 600), rng.uniform(1.5e5, 7e5, 600)
    >>> X = pd.DataFrame({"F": 3e-3 * (P - 1e5) * (1 - 4 * eps), "eps": eps})
    >>> model = InverseModel(random_state=0).fit(X, P)
    >>> bool(abs(model.predict(X) - P).max() < 0.02 * 6e5)
    True
    >>> too_much = pd.DataFrame({"F": [5e3], "eps": [0.1]})
    >>> answer = model.assess(too_much)
    >>> bool(answer.extrapolated[0]), bool(answer.pressure[0] <= P.max())
    (True, True)
    """

    equations = ("inverse",)
    _turning = "eps"

    @classmethod
    def settings(cls, equation: str) -> dict[str, dict[str, Any]]:  # noqa: D102
        return {
            "": {"on_unreachable": "clip"},
            "rates": {"inputs": ("F", "eps", "deps"), "on_unreachable": "clip"},
            "direction": {"direction": True, "on_unreachable": "clip"},
        }

    def __init__(
        self,
        inputs: Sequence[str] = ("F", "eps"),
        *,
        hidden: int = 20,
        direction: bool = False,
        direction_step: float = 0.01,
        alpha: float = 0.01,
        max_iter: int = 200,
        tol: float = 1e-5,
        n_starts: int = 3,
        pressure_limits: tuple[float, float] | None = None,
        on_unreachable: str = "warn",
        forget_rows: float | None = None,
        one_trajectory: bool = False,
        trajectory_column: int | None = None,
        random_state: Any = None,
        signals: Signals | None = None,
    ) -> None:
        self.inputs = inputs
        self.hidden = hidden
        self.direction = direction
        self.direction_step = direction_step
        self.alpha = alpha
        self.max_iter = max_iter
        self.tol = tol
        self.n_starts = n_starts
        self.pressure_limits = pressure_limits
        self.on_unreachable = on_unreachable
        self.forget_rows = forget_rows
        self.one_trajectory = one_trajectory
        self.trajectory_column = trajectory_column
        self.random_state = random_state
        self.signals = signals

    def assess(self, X: Any, groups: Any = None) -> PressureAnswer:
        """Answer within the limits, and flag rows whose answer is unreliable.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            Wanted signals, SI units.
        groups : array_like, shape (n_samples,), optional
            Run of each row, read if `direction` is set.

        Returns
        -------
        PressureAnswer
            Pressure (Pa, absolute) and flags.
        """
        return self._flagged(*self._answer(X, groups))

    def _check_parameters(self) -> None:
        super()._check_parameters()
        check_option(self, "on_unreachable", POLICIES)
        checked_limits(self.pressure_limits)

    def _flagged(self, bare: np.ndarray, outside: np.ndarray) -> PressureAnswer:
        (low,), (high,) = (a.tolist() for a in self._limits())
        slack = _SLACK * (high - low)
        beyond = (bare[:, 0] < low - slack) | (bare[:, 0] > high + slack)
        return PressureAnswer(np.clip(bare[:, 0], low, high), beyond, outside)

    def _limits(self) -> tuple[np.ndarray, np.ndarray]:
        low, high = checked_limits(self.pressure_limits) or (float(self.target_low_[0]), float(self.target_high_[0]))
        return np.array([low]), np.array([high])

    def _answers(self, number: int) -> list[tuple[str, str]]:
        return [("pressure", "Pa, absolute")]

    def _bounded(self, bare: np.ndarray, outside: np.ndarray) -> np.ndarray:
        return answer_within(*self._flagged(bare, outside), self.on_unreachable, type(self).__name__)

    @staticmethod
    def _target(y: Any) -> np.ndarray:
        return np.asarray(column_or_1d(y, warn=True), dtype=float)

    @staticmethod
    def _checked_instances() -> list[InverseModel]:
        small: dict[str, Any] = {"hidden": 3, "max_iter": 4, "n_starts": 2, "random_state": 0}
        return [
            InverseModel(signals={"F": 0, "eps": 0}, **small),
            InverseModel(("eps",), signals={"eps": 0}, direction=True, trajectory_column=0, **small),
        ]


def checked_limits(limits: Any) -> tuple[float, float] | None:
    """Return limits of the pressure, Pa absolute, the lower one first, or None."""
    if limits is None:
        return None
    low, high = (float(v) for v in limits)
    if not (np.isfinite(low) and np.isfinite(high) and 0.0 <= low < high):
        raise ParameterError(
            f"pressure_limits is {limits!r}.", "two absolute pressures in Pa, the lower one first", "Correct them."
        )
    return low, high
