"""From a pressure and a load to force and contraction at the same time."""

import warnings
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np

from pamid.errors import ExtrapolationWarning

from ._one_layer import OneLayerRegressor
from ._parameters import parameters

_MARGIN = 0.05  # of an output's range, by which an answer may pass the outputs of the fit


class ForwardAnswer(NamedTuple):
    """Predictions of a forward model, row by row, with flags of their reliability.

    Parameters
    ----------
    outputs : ndarray, shape (n_samples, n_outputs)
        Outputs within their bounds.
    saturated : ndarray of bool, shape (n_samples,)
        Whether the output is at a bound.
    extrapolated : ndarray of bool, shape (n_samples,)
        Whether the fit had no rows nearby.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import ForwardModel
    >>> X = pd.DataFrame({"P": np.linspace(1e5, 7e5, 50), "load": np.tile([20.0, 40.0], 25)})
    >>> model = ForwardModel(hidden=3, random_state=0).fit(X, np.c_[9.81 * X["load"], 3e-7 * X["P"]])
    >>> answer = model.assess(pd.DataFrame({"P": [4e5, 2e6], "load": [20.0, 20.0]}))
    >>> answer.outputs.shape, answer.extrapolated.tolist()
    ((2, 2), [False, True])
    """

    outputs: np.ndarray
    saturated: np.ndarray
    extrapolated: np.ndarray


@parameters
class ForwardModel(OneLayerRegressor):
    r"""Integrated response of a loaded muscle: force and contraction together from pressure and load.

    .. math:: (F, \varepsilon) = N\!\left(P, m\right)

    with one hidden layer that both outputs share, trained by Levenberg–Marquardt. A force model needs the contraction
    and a contraction model the force; under a load neither is known, and both follow from the pressure.

    Parameters
    ----------
    inputs : sequence of str, default=("P", "load")
        Signals that the network reads: absolute pressure (Pa), load (kg); also ``"dP"`` (Pa/s) or any other column.
    direction : bool, default=False
        Whether the last direction of the first input is an input, too; needs runs in time order.
    direction_step : float, default=100000
        Reversal over which the direction switches, in its unit (Pa); the input changes gradually over it.

    See Also
    --------
    InverseModel : The pressure for a desired force and contraction.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import ForwardModel
    >>> rng = np.random.default_rng(0)
    >>> X = pd.DataFrame({"P": rng.uniform(1e5, 7e5, 500), "load": rng.uniform(15, 100, 500)})
    >>> force = 9.81 * X["load"]
    >>> eps = 0.25 * (1 - np.exp(-(X["P"] - 1e5) / (3e3 * X["load"] + 1e5)))
    >>> model = ForwardModel(random_state=0).fit(X, np.c_[force, eps])
    >>> model.predict(X).shape, bool(model.score(X, np.c_[force, eps]) > 0.99)
    ((500, 2), True)
    """

    inputs: Sequence[str] = ("P", "load")

    equations = ("dynamic",)
    _settings: ClassVar = {"": {}, "direction": {"direction": True}}
    _checked = ({"hidden": 3, "max_iter": 4, "n_starts": 1, "random_state": 0},)

    @property
    def _turning(self) -> str:  # type: ignore[override]
        return str(next(iter(self.inputs)))

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.target_tags.multi_output = True
        return tags

    def assess(self, X: Any, groups: Any = None) -> ForwardAnswer:
        """Predict within bounds, and flag rows whose prediction is unreliable.

        Returns
        -------
        ForwardAnswer
            Outputs in the units of y, and flags.
        """
        bare, outside = self._answer(X, groups)
        held = np.clip(bare, *self._limits())
        return ForwardAnswer(held, (held != bare).any(axis=1), outside)

    def _bounded(self, bare: np.ndarray, outside: np.ndarray) -> np.ndarray:
        if outside.any():
            warnings.warn(
                f"ForwardModel: {int(outside.sum())} of {len(bare)} rows lie outside the data of the fit. Expected "
                "pressures and loads that it covered. Predictions are bounded; assess() marks each row.",
                ExtrapolationWarning,
                stacklevel=4,
            )
        held = np.clip(bare, *self._limits())
        return held[:, 0] if self.n_outputs_ == 0 else held

    def _limits(self) -> tuple[np.ndarray, np.ndarray]:
        margin = _MARGIN * (self.target_high_ - self.target_low_)
        return self.target_low_ - margin, self.target_high_ + margin
