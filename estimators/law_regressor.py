"""A law as the last step of a pipeline: volume and its derivatives become force or flow."""

from collections.abc import Mapping
from dataclasses import KW_ONLY
from typing import Any, ClassVar, Self

import numpy as np

from pamid.errors import UnknownOptionError
from pamid.laws.base import Law
from pamid.signals.state import STATE_SIGNALS, State

from ._base import SignalRegressor
from ._laws import FlowLaw, ForceLaw, flow_of, force_of
from ._parameters import parameters

LAWS = ("quasi_static", "thermodynamic")


@parameters
class LawRegressor(ForceLaw, FlowLaw, SignalRegressor):
    r"""Apply a law to a volume that an earlier step of the pipeline gives.

    .. math:: y = a\,V + b_\varepsilon \frac{\partial V}{\partial\varepsilon} + b_P \frac{\partial V}{\partial P}

    with the law's coefficients at the measured state. There is nothing to fit: ``fit`` finds the columns.

    Parameters
    ----------
    law : {"quasi_static", "thermodynamic"} or Law, default="quasi_static"
        Force by virtual work, for `rest_length` and `atmospheric_pressure`; flow by the first law, for
        `heat_capacity_ratio`, `gas_constant` and `temperature`; or any `pamid.laws.base.Law`.
    signals : dict, optional
        Column of X for each of ``eps`` (−), ``deps`` (1/s), ``P`` (Pa, absolute), ``dP`` (Pa/s), ``V`` (m³), ``V_eps``
        (m³) and ``V_P`` (m³/Pa).

    See Also
    --------
    QAdapter : Gives the volume.

    Examples
    --------
    >>> import pandas as pd
    >>> from pamid.estimators import LawRegressor
    >>> X = pd.DataFrame({"eps": [0.1], "deps": [0.0], "P": [201325.0], "dP": [0.0],
    ...                   "V": [7e-5], "V_eps": [1e-4], "V_P": [0.0]})
    >>> LawRegressor("quasi_static", rest_length=0.2).fit(X, [50.0]).predict(X)
    array([50.])
    """

    law: Any = "quasi_static"
    _: KW_ONLY
    rest_length: float = 0.2

    equations = ()
    reads: ClassVar[tuple[str, ...]] = (*STATE_SIGNALS, "V", "V_eps", "V_P")
    _checked = ({}, {"law": "thermodynamic"})

    def laws(self) -> tuple[Law, ...]:
        """Return the law that is applied."""
        if self.law == "quasi_static":
            return (force_of(self),)
        if self.law == "thermodynamic":
            return (flow_of(self),)
        if isinstance(self.law, Law):
            return (self.law,)
        raise UnknownOptionError(
            f"law={self.law!r} is not known.", f"one of {', '.join(LAWS)}, or a Law", "Choose one."
        )

    def fit(self, X: Any, y: Any) -> Self:
        """Find the columns.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            Signals of the muscle, its volume and the volume's derivatives.
        y : array, shape (n_samples,)
            What was measured; only checked.
        """
        self.laws()
        self._read_targets(X, y, reset=True)
        return self

    def partial_fit(self, X: Any, y: Any) -> Self:
        """Find the columns at the first call, and check those of later ones: a law has nothing to learn."""
        if not hasattr(self, "signal_columns_"):
            return self.fit(X, y)
        self._read_targets(X, y, reset=False)
        return self

    def predict(self, X: Any) -> np.ndarray:
        """Apply the law: force in N or mass flow in kg/s."""
        table = self._read_fitted(X, "signal_columns_")
        state = State(*(self._signal(table, name) for name in STATE_SIGNALS))
        V, V_eps, V_P = (self._signal(table, name) for name in ("V", "V_eps", "V_P"))
        return np.asarray(self.laws()[0].predict(V, V_eps, V_P, state))

    def formulas(self, signals: Mapping[str, Any]) -> dict[str, tuple[str, Any]]:
        """Return the predictions as formulas of the signals, which may be symbols: what an export writes."""
        law, state = self.laws()[0], State(*(signals[s] for s in STATE_SIGNALS))
        return {law.equation: (law.unit, law.predict(signals["V"], signals["V_eps"], signals["V_P"], state))}
