"""A muscle whose active part contracts by more, or by less, than the whole."""

from __future__ import annotations

from typing import ClassVar

from .end_cap import EndCap
from .values import Parameter


class EffectiveContraction(EndCap):
    r"""Single muscle whose active part contracts k times as much as the whole.

    .. math:: \Delta F = \frac{p}{L_0}\left(\left.\frac{\partial V}{\partial\varepsilon}\right|_{k\varepsilon} -
        \left.\frac{\partial V}{\partial\varepsilon}\right|_{\varepsilon}\right)

    Stiff fittings make k larger than 1; a braid that lengthens, or fittings that yield, smaller. The gas volume changes
    as in `EndCap` with s = 1.

    References
    ----------
    B. Tondu, P. Lopez, "Modeling and control of McKibben artificial muscle robot actuators", IEEE Control Systems
    Magazine 20(2), 2000. https://doi.org/10.1109/37.833638
    """

    name = "effective_contraction"
    kinds = ("muscle",)
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("factor", "-", 0.05, 1.6, 0.8, "contraction of the active part over that of the whole"),
    )
    swept = 1.0
