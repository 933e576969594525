"""The residual over the state: mean of the windows in each cell, before and after, on one scale of colour."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...errors import ParameterError
from ...gap.diagnosis.result import Diagnosis
from ...plots.style import INK, new_figure, style
from ..words import Words
from .windows import chosen_equation, of_equation, states, telling_ports, unit_of, usable

AXES = {
    "force": (("eps", "deps"), ("eps", "P"), ("deps", "P"), ("x", "dx"), ("x", "P"), ("dx", "P")),
    "torque": (("q", "dq"), ("q", "load"), ("dq", "load")),
    "flow": (("P", "dP"), ("eps", "dP"), ("eps", "deps")),
    "valve": (("u", "P"), ("P", "dP"), ("u", "dP")),
    "joint": (("q", "dq"), ("q", "P"), ("q", "deps")),
    "gas_valve": (("u", "P"), ("P", "dP"), ("eps", "dP")),
    "joint_modelled": (("q", "dq"), ("q", "P"), ("q", "deps")),
}
"""State over which an equation is mapped, the most telling first."""
_COLUMNS, _ROWS = 22, 16
"""The most cells of a map."""
_IN_A_CELL = 6
"""Windows that a cell holds on the average; a short log has fewer and larger cells."""
_FEWEST = 3  # windows in a cell that is drawn
_BACK = "#E4E4E4"  # where there are no data
_CONDITION = re.compile(r"^\(*\s*(\w+?)[12]?\s*(<=|>=|<|>)\s*(-?[\d.]+(?:[eE][-+]?\d+)?)\s*\)*$")


def axes_of(d: Diagnosis, equation: str) -> list[tuple[str, str]]:
    """Return the pairs of signals over which an equation can be mapped; those of its regions come first."""
    part = of_equation(d, equation)
    known = () if Words.of(d).is_at_ports(equation) else AXES.get(equation, AXES["force"])
    pairs = [p for p in known if usable(part, p[0]) and usable(part, p[1])]
    regions = [set(bounds(r.query)) for r in d.regions if r.equation == equation]
    if not pairs:  # the ports of a user's own simulator
        first, *others = telling_ports(part) or [""]
        pairs = [(first, other) for other in others]
    pairs.sort(key=lambda p: -max((len(names & set(p)) for names in regions[:1]), default=0))
    return pairs[:2]


def map_figure(d: Diagnosis, equation: str | None = None, x: str | None = None, y: str | None = None) -> Figure:
    """Draw the mean residual over two signals, without and with the causes."""
    equation = chosen_equation(d, equation)
    if x is None or y is None:
        pairs = axes_of(d, equation)
        if not pairs:
            raise ParameterError(
                f"No two signals vary in the windows of {equation}.", "runs that move", "Record runs that move more."
            )
        x, y = pairs[0]
    part = of_equation(d, equation)
    if lacking := [name for name in (x, y) if not usable(part, name)]:
        raise ParameterError(f"{lacking[0]} does not vary in the windows.", "a signal that does", "Choose another.")
    words = Words.of(d)
    quantity = words.error(equation, unit_of(d, equation))
    factors = words.signal(x).factor, words.signal(y).factor
    grids, edges = _grids(part, x, y, states(d))
    noise = float(np.sqrt(np.mean(part["noise"].to_numpy(dtype=float) ** 2)))
    limit = quantity.factor * max(_limit(grids), 2 * noise)  # what is within the noise must not look like a gap
    with style():
        figure, axes = new_figure(5.6, 3.0, 1, len(grids), sharex=True, sharey=True)
        for ax, grid, title in zip(axes[0], grids, states(d), strict=True):
            cells = _draw(
                ax,
                quantity.factor * grid,
                [f * e for f, e in zip(factors, edges, strict=True)],
                limit,
                title if len(grids) > 1 else "",
            )
            for region in [r for r in d.regions if r.equation == equation][:1]:
                _outline(ax, bounds(region.query), (x, y), factors)
        axes[0, 0].set_ylabel(words.signal(y).label)
        figure.supxlabel(words.signal(x).label, fontsize=9, color=INK)
        bar = figure.colorbar(cells, ax=axes[0].tolist(), label=f"mean {quantity.label}", pad=0.02, aspect=16)
        bar.outline.set_visible(False)
    return figure


def _grids(
    part: pd.DataFrame, x: str, y: str, names: tuple[str, ...]
) -> tuple[list[np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """Return the mean of each residual in each cell, NaN where there are too few windows."""
    a, b = part[x].to_numpy(dtype=float), part[y].to_numpy(dtype=float)
    values = [part[name].to_numpy(dtype=float) for name in names]
    fine = np.all(np.isfinite([a, b, *values]), axis=0)
    a, b, values = a[fine], b[fine], [v[fine] for v in values]
    finer = min(1.0, float(np.sqrt(len(a) / (_IN_A_CELL * _COLUMNS * _ROWS))))
    edges = _edges(a, round(_COLUMNS * finer) or 1), _edges(b, round(_ROWS * finer) or 1)
    count = np.histogram2d(a, b, edges)[0]
    with np.errstate(invalid="ignore", divide="ignore"):
        means = [np.histogram2d(a, b, edges, weights=v)[0] / count for v in values]
    return [np.where(count >= _FEWEST, m, np.nan).T for m in means], edges


def _edges(x: np.ndarray, n: int) -> np.ndarray:
    """Return the edges of n cells; a few extreme windows must not squeeze all others into one of them."""
    low, high = np.quantile(x, (0.01, 0.99))
    return np.linspace(low, high, n + 1)


def _limit(grids: list[np.ndarray]) -> float:
    found = np.concatenate([np.abs(g[np.isfinite(g)]) for g in grids])
    return float(np.quantile(found, 0.98)) or 1.0 if len(found) else 1.0


def _draw(ax: Axes, grid: np.ndarray, edges: Sequence[np.ndarray], limit: float, title: str) -> Any:
    ax.set_facecolor(_BACK)
    x, y = edges
    cells = ax.pcolormesh(x, y, grid, cmap="PuOr_r", vmin=-limit, vmax=limit, rasterized=True)
    ax.set_title(title)
    if y[0] < 0 < y[-1]:
        ax.axhline(0.0, color=INK, linewidth=0.5, alpha=0.5)
    return cells


def bounds(query: str) -> dict[str, tuple[float, float]]:
    """Return the ranges of signals that a query's plain conditions leave, the muscle left aside."""
    found: dict[str, tuple[float, float]] = {}
    for part in query.split(" and "):
        match = _CONDITION.match(part.strip())
        if match is None:
            continue
        low, high = found.get(match[1], (-np.inf, np.inf))
        limit = float(match[3])
        found[match[1]] = (max(low, limit), high) if match[2][0] == ">" else (low, min(high, limit))
    return found


def _outline(
    ax: Axes, ranges: dict[str, tuple[float, float]], names: tuple[str, str], factors: tuple[float, float]
) -> None:
    """Frame the region on a map that shows what bounds it."""
    from matplotlib.patches import Rectangle

    if not {*names} & set(ranges):
        return
    corners = []
    for name, factor, limits in zip(names, factors, (ax.get_xlim(), ax.get_ylim()), strict=True):
        low, high = (factor * v for v in ranges.get(name, (-np.inf, np.inf)))
        corners.append((max(low, limits[0]), min(high, limits[1])))
    (left, right), (below, above) = corners
    if right > left and above > below:
        ax.add_patch(
            Rectangle((left, below), right - left, above - below, fill=False, edgecolor=INK, linewidth=1.4, zorder=3)
        )
