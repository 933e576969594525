r"""The gas volume as a small network, evaluated in numpy.

The network works on standardised inputs that are clamped smoothly to the range it was trained on:

.. math:: V = V_s\, N(\xi), \qquad \xi_j = c_j\!\left(\frac{x_j - \mu_j}{\sigma_j}\right)

Inside the range the clamp `c` is the identity; outside its slope fades to zero, so the derivatives of the volume,
and with them the force or flow that a law reads from the network, fade too instead of growing without bound.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from scipy.special import expit

from ..errors import UnknownOptionError
from ..explained import explained_fields
from ..signals.state import Array, State
from .base import VolumeJet


@dataclass(frozen=True)
class InputScale:
    """Standardisation of the four inputs, and the range inside which the network is trusted.

    The volume of a muscle hardly depends on how fast it moves, but much on which way it moves: where the network is a
    correction to a geometry, rates are saturated, so that a faster motion than any in the data reads like a fast one.

    Parameters
    ----------
    mean, spread : ndarray, shape (4,)
        Mean and standard deviation of (ε, ε̇, P, Ṗ) in the data of the fit; a spread of one for a constant signal.
    lower, upper : ndarray, shape (4,)
        Range of the standardised inputs; infinite where nothing is clamped.
    saturated : ndarray of bool, shape (4,)
        Which inputs pass through z/√(1 + z²).
    fade : float
        Width, in standard deviations, over which the clamp's slope falls outside the range.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.volume.neural import InputScale
    >>> x = np.array([[0.05, -0.1, 2e5, -1e6], [0.15, 0.1, 4e5, 1e6]])  # ε, ε̇ (1/s), P (Pa), Ṗ (Pa/s)
    >>> xi, slope = InputScale.of(x).apply(x)
    >>> xi
    array([[-1., -1., -1., -1.],
           [ 1.,  1.,  1.,  1.]])
    """

    mean: np.ndarray
    spread: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    saturated: np.ndarray
    fade: float = 0.5

    @classmethod
    def of(cls, x: np.ndarray, weight: np.ndarray | None = None, *, correction: bool = False) -> Self:
        """Measure the scale of inputs of shape (n_samples, 4), for a network or for a correction to a geometry."""
        w = np.ones(len(x)) if weight is None else weight
        x, w = x[w > 0], w[w > 0]
        mean = np.average(x, axis=0, weights=w)
        spread = np.sqrt(np.average((x - mean) ** 2, axis=0, weights=w))
        spread[spread <= 1e-12 * np.maximum(np.abs(mean), 1e-300)] = 1.0
        n = x.shape[1]
        if correction:
            rate = np.zeros(n, dtype=bool)
            rate[[1, 3]] = True
            # A rate is measured from standstill: the direction of motion is what its saturated value tells.
            mean = np.where(rate, 0.0, mean)
            z = (x - mean) / spread
            return cls(mean, spread, z.min(axis=0), z.max(axis=0), rate)
        return cls(mean, spread, np.full(n, -np.inf), np.full(n, np.inf), np.zeros(n, dtype=bool))

    def apply(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the clamped standardised inputs and their slope dξ/dx, both of shape (n_samples, 4)."""
        z = (x - self.mean) / self.spread
        inside = np.minimum(np.maximum(z, self.lower), self.upper)
        if (z == inside).all():  # a sample of a control loop, as a rule
            bounded, slope = z, np.ones_like(z)
        else:
            past = np.tanh((z - inside) / self.fade)
            bounded, slope = inside + self.fade * past, 1.0 - past * past
        if any(self.saturated):  # of a handful, faster than numpy
            root = np.sqrt(1.0 + z * z)
            bounded = np.where(self.saturated, z / root, bounded)
            slope = np.where(self.saturated, 1.0 / (root * root * root), slope)
        return bounded, slope / self.spread


@explained_fields
@dataclass(frozen=True)
class NeuralVolume:
    """A trained volume network.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.signals import State
    >>> from pamid.volume.neural import InputScale, NeuralVolume
    >>> scale = InputScale.of(np.array([[0.05, -0.1, 2e5, -1e6], [0.15, 0.1, 4e5, 1e6]]))
    >>> weights = [np.ones((2, 4)), np.zeros(2), np.ones((1, 2)), np.zeros(1)]
    >>> volume = NeuralVolume(weights, scale, volume_scale=1e-5)
    >>> float(volume.jet(State(0.1, 0.0, 3e5, 0.0)).V[0].round(8))  # m³
    1.386e-05
    """

    weights: Annotated[
        list[np.ndarray], "Weights and biases in turn, ``[W1, c1, W2, c2, ...]``; W of shape (n_out, n_in)."
    ]
    scale: Annotated[InputScale, "Standardisation of the inputs."]
    volume_scale: Annotated[float, "Volume V_s that one unit of the network's output stands for, m³."]
    activation: Annotated[str, '``"softplus"``, ``"tanh"`` or ``"silu"``.'] = "softplus"

    def jet(self, state: State) -> VolumeJet:
        """Return V, ∂V/∂ε and ∂V/∂P at each sample; inputs beyond the state, which tell of the past, are at rest."""
        return self.jet_at(self._columns(state))

    def jet_at(self, x: np.ndarray) -> VolumeJet:
        """Return the same at inputs of shape (n_samples, n_inputs): the state, then the effects' memory."""
        xi, slope = self.scale.apply(x)
        value, (d_eps, d_P) = network_jet(self.weights, xi, (0, 2), self.activation)
        return VolumeJet(
            self.volume_scale * value, self.volume_scale * d_eps * slope[:, 0], self.volume_scale * d_P * slope[:, 2]
        )

    def slope_at(self, state: State) -> Array:
        """Return ∂V/∂ε alone."""
        return self.slope_at_inputs(self._columns(state))

    def slope_at_inputs(self, x: np.ndarray) -> np.ndarray:
        """Return the same at inputs, as `jet_at` takes them."""
        xi, slope = self.scale.apply(x)
        _, (d_eps,) = network_jet(self.weights, xi, (0,), self.activation)
        return np.asarray(self.volume_scale * d_eps * slope[:, 0])

    def _columns(self, state: State) -> np.ndarray:
        x = np.array(state, dtype=float).reshape(len(state), -1).T
        return np.pad(x, ((0, 0), (0, len(self.scale.mean) - x.shape[1])))


def network_jet(
    weights: Sequence[Array], x: np.ndarray, inputs: Sequence[int], activation: str
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return a network's output, dimensionless, and its partial derivatives with respect to some `inputs`.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.volume.neural import network_jet
    >>> weights = [np.ones((2, 4)), np.zeros(2), np.ones((1, 2)), np.zeros(1)]
    >>> value, (d_first, d_third) = network_jet(weights, np.zeros((1, 4)), (0, 2), "softplus")
    >>> value.round(3), d_first
    (array([1.386]), array([1.]))
    """
    h, slopes = x, []
    for layer in range(0, len(weights) - 2, 2):
        h, slope = _activate(h @ weights[layer].T + weights[layer + 1], activation)
        slopes.append(slope)
    value = h @ weights[-2][0] + weights[-1][0]
    # Backwards a layer costs one product, forwards one for each of the inputs.
    back = weights[-2]
    for k in range(len(slopes) - 1, -1, -1):
        back = (back * slopes[k]) @ (weights[2 * k] if k else weights[0][:, inputs])
    gradient = back if slopes else np.broadcast_to(back[:, inputs], (len(x), len(inputs)))
    return value, list(gradient.T)


def _activate(z: np.ndarray, activation: str) -> tuple[np.ndarray, np.ndarray]:
    """Return σ(z) and σ'(z)."""
    if activation == "tanh":
        t = np.tanh(z)
        return t, 1.0 - t * t
    s = expit(z)
    if activation == "softplus":
        return np.maximum(z, 0.0) + np.log1p(np.exp(-np.abs(z))), s
    if activation == "silu":
        return z * s, s + z * (s - s * s)
    raise UnknownOptionError(
        f"activation={activation!r} is not known.", "softplus, tanh or silu", "Choose one of these."
    )
