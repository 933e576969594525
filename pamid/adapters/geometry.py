"""Where the factor on the volume starts: two muscles' lengths and diameters."""

from typing import NamedTuple

import numpy as np

from ..errors import ParameterError


class Scale(NamedTuple):
    """A factor on the volume and its standard uncertainty.

    Examples
    --------
    >>> from pamid.adapters.geometry import volume_ratio
    >>> q = volume_ratio((0.2, 0.01), (0.45, 0.02), relative=(0.02, 0.05))
    >>> print(f"Q = {q.value:.1f} ± {q.uncertainty:.1f}")
    Q = 9.0 ± 1.3
    """

    value: float
    uncertainty: float


def volume_ratio(
    source: tuple[float, float], target: tuple[float, float], relative: tuple[float, float] = (0.0, 0.0)
) -> Scale:
    r"""Return :math:`Q_0 = (D_t / D_s)^2 L_t / L_s` of two (length, diameter), m, with its uncertainty to first order.

    Examples
    --------
    >>> from pamid.adapters.geometry import volume_ratio
    >>> volume_ratio((0.2, 0.01), (0.2, 0.02)).value  # from lengths and diameters, m
    4.0
    """
    sizes = np.array([source, target], dtype=float)
    spread = np.array(relative, dtype=float)
    if not (np.isfinite(sizes).all() and (sizes > 0).all()):
        raise ParameterError(
            f"The lengths and diameters are {sizes.tolist()} m.",
            "finite numbers above 0",
            "Give both muscles' rest length and rest diameter in metres.",
        )
    if not (np.isfinite(spread).all() and (spread >= 0).all()):
        raise ParameterError(
            f"The relative uncertainties are {spread.tolist()}.",
            "finite numbers from 0 on",
            "Give one for the lengths and one for the diameters.",
        )
    length, diameter = sizes[1] / sizes[0]
    q0 = float(length * diameter**2)
    # each size enters the ratio twice, once for each muscle
    return Scale(q0, q0 * float(np.sqrt(2 * spread[0] ** 2 + 2 * (2 * spread[1]) ** 2)))
