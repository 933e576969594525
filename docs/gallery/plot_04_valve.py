r"""
Why a muscle fills evenly when empty and slowly when full
=========================================================

The flow through the servo valve of the bench follows ISO 6358: it is
:math:`\dot m = C\,u\,\rho_0\,P_s\,\psi(P/P_s)` while it fills and
:math:`-C\,|u|\,\rho_0\,P\,\psi(P_\mathrm{atm}/P)` while it vents. Left of the dots the flow is choked: it does not
depend on the pressure behind the orifice. This is why a muscle fills at an even rate when empty and slowly when
nearly full, and the reverse when it vents.
"""

import matplotlib.pyplot as plt
import numpy as np

from pamid.laws.valve import valve_flow
from pamid.plots.style import INK

P_s, P_atm, b = 7e5, 101_325.0, 0.35
P = np.linspace(P_atm, P_s, 400)
fig, ax = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
commands = (1.0, 0.6, 0.3, -0.3, -0.6, -1.0)
for u in commands:
    mdot = valve_flow(u + 0 * P, P, P_s, P_atm, sonic_conductance=6e-9, critical_pressure_ratio=b)
    ax.plot(P / 1e5, 1e3 * mdot, color=plt.colormaps["PuOr"](0.5 + 0.42 * u), linewidth=2)
    x, y = (P[0], mdot[0]) if u > 0 else (P[-1], mdot[-1])
    ax.annotate(
        f"u = {u:+.1f}".replace("-", "−"),
        (x / 1e5, 1e3 * y),
        (-6 if u > 0 else 6, 0),
        textcoords="offset points",
        ha="right" if u > 0 else "left",
        va="center",
        fontsize=8,
    )
    edge = b * P_s if u > 0 else P_atm / b
    ax.plot(edge / 1e5, 1e3 * np.interp(edge, P, mdot), "o", color=INK, markersize=4)
ax.axhline(0, color=INK, linewidth=0.6)
ax.annotate("choked up to here", (b * P_s / 1e5, 5.0), (0, 8), textcoords="offset points", fontsize=8, ha="center")
ax.annotate(
    "choked from here on", (P_atm / b / 1e5, -2.05), (-8, -14), textcoords="offset points", fontsize=8, ha="right"
)
ax.set_xlim(0, 7.9)
ax.set_ylim(-5.6, 6.2)
ax.set_xlabel("pressure in the muscle / bar, absolute")
ax.set_ylabel("mass flow into the muscle / (g/s)")
ax.set_title("Filling from 7 bar and venting to the surroundings")
plt.show()
