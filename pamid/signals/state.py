"""The state of one muscle over many samples, the input of every law and volume model; roles of columns."""

from typing import Annotated, Any, NamedTuple

from ..explained import explained_fields

Array = Any
"""A numpy array or a torch tensor; the laws and volume models take either."""


@explained_fields
class State(NamedTuple):
    """Signals of one muscle, one entry per sample.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.signals import State
    >>> state = State(eps=np.array([0.1]), deps=np.array([0.2]), P=np.array([3e5]), dP=np.array([0.0]))
    >>> state.P  # Pa, absolute
    array([300000.])
    """

    eps: Annotated[Array, "Contraction ratio ε = (L₀ − L)/L₀, dimensionless; an array of shape (n_samples,)."]
    deps: Annotated[Array, "Its rate ε̇, 1/s; an array of shape (n_samples,)."]
    P: Annotated[Array, "Gas pressure in the muscle, Pa, absolute; an array of shape (n_samples,)."]
    dP: Annotated[Array, "Its rate Ṗ, Pa/s; an array of shape (n_samples,)."]  # noqa: N815 - the field's own name


STATE_SIGNALS = State._fields
"""The signals in the order in which a plain array holds them: ``("eps", "deps", "P", "dP")``."""

ROLES = {
    "eps": "position", "deps": "velocity", "q": "position", "dq": "velocity", "P": "pressure", "dP": "pressure_rate",
    "u": "command", "time": "time", "mdot": "flow", "F": "force",
}  # fmt: skip
"""Role of each column; contraction of a muscle and angle of a joint are both positions."""

STATE_ROLES = {name: ROLES[name] for name in STATE_SIGNALS}
"""Roles of the columns of a muscle's state."""
