"""Does a volume make physical sense?"""

import warnings
from typing import Annotated, NamedTuple

import numpy as np

from ..errors import VolumeWarning
from ..explained import explained_fields
from ..signals.state import Array, State
from .base import VolumeJet


@explained_fields
class VolumeReport(NamedTuple):
    """What `check_volume` found.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.signals import State
    >>> from pamid.volume import VolumeJet, check_volume
    >>> state = State(np.array([0.1]), np.array([0.0]), np.array([3e5]), np.array([0.0]))
    >>> jet = VolumeJet(np.array([-7e-5]), np.array([4e-4]), np.array([0.0]))
    >>> check_volume(jet, state, warn=False).sensible
    False
    """

    positive: Annotated[float, "Share of samples with V > 0; NaN if the level of V was not to be checked."]
    growing: Annotated[float, "Share of samples with ∂V/∂ε > 0: a muscle that shortens under pressure gains volume."]
    relative_size: Annotated[float, "Median of V over the volume of the cylinder at rest; NaN if that is not known."]
    messages: Annotated[tuple[str, ...], "One sentence for each thing that makes no sense; empty if all is well."]

    @property
    def sensible(self) -> bool:
        """Whether nothing was found."""
        return not self.messages


def check_volume(
    jet: VolumeJet, state: State, *, rest_volume: float | None = None, level_known: bool = True, warn: bool = True
) -> VolumeReport:
    """Return whether an identified volume makes physical sense.

    Parameters
    ----------
    jet : VolumeJet
        Volume and its derivatives, numpy arrays or torch tensors.
    state : State
        Where: signals of the muscle, SI units, absolute pressure.
    rest_volume : float, optional
        Volume of the muscle as a cylinder at rest, π D₀² L₀/4, m³. Between half of it and ten times of it is taken as
        sensible (a braided muscle gains a factor of about three at most).
    level_known : bool, default=True
        Whether the data determine V itself; a force determines ∂V/∂ε alone, and then V is not judged.
    warn : bool, default=True
        Whether to issue a `VolumeWarning` for each finding.

    Returns
    -------
    VolumeReport
        Shares, size and messages.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.signals import State
    >>> from pamid.volume import check_volume
    >>> from pamid.volume.braided import BraidedVolume
    >>> eps = np.linspace(0, 0.2, 5)
    >>> state = State(eps, 0 * eps, 3e5 + 0 * eps, 0 * eps)
    >>> jet = BraidedVolume(rest_length=0.2, rest_diameter=0.02, braid_angle=0.4363).jet(state)
    >>> check_volume(jet, state, rest_volume=6.28e-5).sensible
    True
    """
    V, V_eps, P, eps = (_numpy(a) for a in (jet.V, jet.V_eps, state.P, state.eps))
    positive = float(np.mean(V > 0)) if level_known else float("nan")
    growing = float(np.mean(V_eps > 0))
    size = float(np.median(V) / rest_volume) if level_known and rest_volume else float("nan")
    where = f"over ε from {eps.min():.3g} to {eps.max():.3g} and P from {P.min():.3g} to {P.max():.3g} Pa"
    messages = []
    if positive < 1.0:
        messages.append(
            f"The volume is not positive in {1 - positive:.1%} of the samples {where} (least {V.min():.3g} m³). "
            "Expected V > 0. Check the units of eps, P and the flow, or give data that excite the pressure rate more."
        )
    if growing < 0.99:
        messages.append(
            f"The volume falls with contraction in {1 - growing:.1%} of the samples {where}. "
            "Expected ∂V/∂ε > 0 where a muscle pulls. Check that eps grows when the muscle shortens, that P is "
            "absolute, and that F is a tension."
        )
    if not 0.5 <= size <= 10.0 and np.isfinite(size):
        messages.append(
            f"The median volume is {size:.3g} times that of the cylinder at rest ({rest_volume:.3g} m³) {where}. "
            "Expected 0.5 to 10 times. Check the lengths (m) and the units of the measured quantity."
        )
    if warn:
        for message in messages:
            warnings.warn(message, VolumeWarning, stacklevel=2)
    return VolumeReport(positive, growing, size, tuple(messages))


def _numpy(a: Array) -> np.ndarray:
    """Return a tensor's or array's values as a numpy array of at least one entry."""
    return np.atleast_1d(np.asarray(a.detach().cpu() if hasattr(a, "detach") else a, dtype=float))
