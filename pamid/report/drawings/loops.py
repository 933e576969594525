"""The residual of one run as loops over the state, and over time, before and after, with the noise."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...gap.diagnosis.result import Diagnosis
from ...plots.curves import drawn
from ...plots.style import BLUE, FAINT, GREY, ORANGE, new_figure, style
from ..words import Words
from .windows import (
    chosen_equation,
    of_equation,
    of_trajectory,
    states,
    telling_ports,
    telling_trajectories,
    unit_of,
    usable,
)

_ACROSS = {
    "force": ("eps", "x", "P"),
    "flow": ("P", "eps"),
    "valve": ("u", "P"),
    "joint": ("q", "eps"),
    "gas_valve": ("u", "P"),
    "joint_modelled": ("q", "eps"),
    "torque": ("q",),
}
_STILL = {"eps": 2e-3, "q": 1e-2, "P": 2e3, "u": 2e-2}  # a range below which a signal is taken for held


def loop_figure(
    d: Diagnosis, equation: str | None = None, trajectory: str | None = None, limits: tuple[float, float] | None = None
) -> Figure:
    """Draw the residual of a run over the state and over time."""
    equation = chosen_equation(d, equation)
    trajectory = trajectory or telling_trajectories(d, equation, 1)[0]
    part = of_trajectory(d, equation, trajectory)
    words = Words.of(d)
    quantity = words.error(equation, unit_of(d, equation))
    across = _across(d, part, equation)
    with style():
        figure, axes = new_figure(4.3, 3.9, 2, 1, height_ratios=(1.7, 1.0))
        loop, course = axes[:, 0]
        _draw(loop, part, across, words.signal(across).factor, quantity.factor, states(d))
        loop.set_xlabel(words.signal(across).label)
        loop.set_ylabel(quantity.label)
        _draw(course, part, "time", 1.0, quantity.factor, states(d))
        course.set_xlabel("time / s")
        course.set_ylabel(quantity._replace(words="error").label)
        for ax in (loop, course) if limits is not None else ():
            ax.set_ylim(limits)
        handles, labels = loop.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=3)
    return figure


def _across(d: Diagnosis, part: pd.DataFrame, equation: str) -> str:
    """Return the signal over which the error is drawn: of a simulator with ports the one on which it depends most."""
    for name in () if Words.of(d).is_at_ports(equation) else (*_ACROSS.get(equation, ()), "eps", "P", "u"):
        if usable(part, name):
            x = part[name].to_numpy(dtype=float)
            if float(np.nanmax(x) - np.nanmin(x)) > _STILL.get(name, 0.0):
                return name
    return next((name for name in telling_ports(of_equation(d, equation)) if usable(part, name)), "time")


def _draw(ax: Axes, part: pd.DataFrame, across: str, scale: float, factor: float, names: tuple[str, ...]) -> None:
    time = part["time"].to_numpy(dtype=float)
    x = scale * part[across].to_numpy(dtype=float)
    noise = 2 * factor * float(np.sqrt(np.mean(part["noise"].to_numpy(dtype=float) ** 2)))
    ax.axhspan(-noise, noise, color=FAINT, alpha=0.6, linewidth=0, label="noise, ± 2 σ")
    ax.axhline(0.0, color=GREY, linewidth=0.5)
    for name, colour, width in zip(names, (ORANGE, BLUE), (0.9, 1.6), strict=False):  # distinguishable in grey as well
        y = factor * part[name].to_numpy(dtype=float)
        _, *path = drawn(time, x, y)
        ax.plot(*path, color=colour, linewidth=width, label=name if len(names) > 1 else "error")
    ax.set_ylim(_ends(part, names, factor))


def _ends(part: pd.DataFrame, names: tuple[str, ...], factor: float) -> tuple[float, float]:
    """Return the ends of an axis with room for the residuals of a run and their noise."""
    noise = 2 * factor * float(np.sqrt(np.mean(part["noise"].to_numpy(dtype=float) ** 2)))
    low, high = np.nanquantile(factor * part[list(names)].to_numpy(dtype=float), (0.002, 0.998))
    pad = 0.12 * max(high - low, noise, 1e-12)
    return float(min(low, -noise) - pad), float(max(high, noise) + pad)


def shared_scale(d: Diagnosis, equation: str, trajectories: list[str]) -> tuple[float, float]:
    """Return the ends of one axis for the residuals of several runs, in the unit shown."""
    factor = Words.of(d).error(equation, unit_of(d, equation)).factor
    ends = [_ends(of_trajectory(d, equation, name), states(d), factor) for name in trajectories]
    return min(low for low, _ in ends), max(high for _, high in ends)
