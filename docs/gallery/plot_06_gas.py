r"""
Slow gas is isothermal, quick gas adiabatic
===========================================

Compressed quickly, air warms and has no time to cool: adiabatic, exponent 1.4. Compressed slowly, it stays at the
temperature of the walls: isothermal, exponent 1. With the effect ``heat_transfer`` the exponent rises from one to the
other as the frequency grows; a ``polytropic_exponent`` is the same at all frequencies. Here a chamber of fixed volume
is filled and vented by a sine of pressure; the flow shows the chamber's effective exponent.
"""

import matplotlib.pyplot as plt
import numpy as np

from pamid import BenchParameters
from pamid.effects import Signals, make_effect
from pamid.laws.gas import mass_flow
from pamid.plots.style import BLUE, GREY, INK, ORANGE

plant = BenchParameters.for_muscle("B").plant()
V = plant.volume(np.array([0.1]))


def shown_exponent(effect, frequency):
    """Return γ or 1 where the flow is that of an adiabatic or an isothermal chamber, and values in between."""
    t = np.linspace(0, 4 / frequency, 4000, endpoint=False)
    w = 2 * np.pi * frequency
    P, dP = 3e5 + 2e4 * np.sin(w * t), 2e4 * w * np.cos(w * t)
    s = Signals(position=0.1 + 0 * t, velocity=0 * t, pressure=P, pressure_rate=dP)
    x = effect.trace(s, plant, t[1], np.array([0]))
    added = effect.flow(s, x, plant)
    mdot = mass_flow(P, dP, V, 0 * P, heat_capacity_ratio=1.4) + added.a + added.b * dP
    last = slice(t.size // 2, None)
    return 1 / np.polyfit((dP * V / plant.RT)[last], mdot[last], 1)[0]


frequencies = np.logspace(-2, 1.5, 40)
fig, ax = plt.subplots(figsize=(6.4, 3.8), layout="constrained")
for tau, colour in ((0.05, ORANGE), (0.2, BLUE), (1.0, INK)):
    effect = make_effect("heat_transfer", time_constant=tau)
    ax.semilogx(
        frequencies, [shown_exponent(effect, f) for f in frequencies], color=colour, label=f"heat transfer, {tau:g} s"
    )
fixed = make_effect("polytropic_exponent", exponent=1.2)
ax.semilogx(
    frequencies, [shown_exponent(fixed, f) for f in frequencies], "--", color=GREY, label="polytropic exponent 1.2"
)
ax.set_xlabel("frequency of the pressure / Hz")
ax.set_ylabel("exponent that the flow shows / –")
ax.set_ylim(0.97, 1.43)
ax.set_title("The same muscle is isothermal when slow and adiabatic when fast")
ax.legend(loc="upper left")
plt.show()
