"""From a desired force and contraction to the pressure that brings both about."""

import warnings
from collections.abc import Sequence
from dataclasses import KW_ONLY
from typing import Any, ClassVar, NamedTuple

import numpy as np
from sklearn.utils.validation import column_or_1d

from pamid.errors import ExtrapolationWarning, ParameterError, UnreachableError

from ._checks import check_option
from ._one_layer import OneLayerRegressor
from ._parameters import parameters

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


@parameters
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
    direction : bool, default=False
        Whether the last direction of the contraction is an input, too; needs runs in time order.
    direction_step : float, default=0.01
        Reversal of the contraction over which the direction switches, dimensionless; the input changes gradually over
        it.
    on_unreachable : {"warn", "clip", "raise"}, default="warn"
        What `predict` does about pairs that ask for a pressure beyond the limits or lie outside the data of the fit:
        bound the answer and warn, bound it silently, or raise `UnreachableError`.

    Attributes
    ----------
    target_mean_, target_scale_, target_low_, target_high_ : ndarray, shape (1,)
        Mean, standard deviation and range of the pressure, Pa.

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

    inputs: Sequence[str] = ("F", "eps")
    _: KW_ONLY
    hidden: int = 20
    direction_step: float = 0.01
    pressure_limits: tuple[float, float] | None = None
    on_unreachable: str = "warn"

    equations = ("inverse",)
    _turning = "eps"
    _settings: ClassVar = {
        "": {"on_unreachable": "clip"},
        "rates": {"inputs": ("F", "eps", "deps"), "on_unreachable": "clip"},
        "direction": {"direction": True, "on_unreachable": "clip"},
    }
    _small: ClassVar[dict[str, Any]] = {"hidden": 3, "max_iter": 4, "n_starts": 2, "random_state": 0}
    _checked = (_small, _small | {"inputs": ("eps",), "direction": True, "trajectory_column": 0})

    def assess(self, X: Any, groups: Any = None) -> PressureAnswer:
        """Answer within the limits, and flag rows whose answer is unreliable.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            Wanted signals, SI units.

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
