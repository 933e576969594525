"""What the log holds of a run, row by row: commands and readings as they were recorded."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ...gap.diagnosis.result import Diagnosis
from ...plots.curves import drawn
from ...plots.style import INK, new_figure, style
from ..quantities import SIGNALS
from ..words import Words
from .windows import chosen_equation, of_equation, telling_ports

_MOST = 6
"""Panels of a picture that stands beside another."""


def readings_figure(d: Diagnosis, trajectory: str, equation: str | None = None) -> Figure | None:
    """Draw a run's readings that an equation's error depends on most; None if the diagnosis kept no log."""
    run = _rows(d, trajectory)
    columns = [] if run is None else _columns(d, run, chosen_equation(d, equation))
    if run is None or not columns:
        return None
    time, words = run["time"].to_numpy(dtype=float), Words.of(d)
    with style():
        figure, axes = new_figure(5.2, 0.7 + 0.8 * len(columns), len(columns), 1, sharex=True)
        for ax, (name, column) in zip(axes[:, 0], columns, strict=True):
            quantity = words.signal(name)
            values = quantity.factor * run[column].to_numpy(dtype=float)
            ax.plot(*drawn(time - time[0], values), color=INK, linewidth=0.8)
            ax.set_title(quantity.label)
        axes[-1, 0].set_xlabel("time / s")
    return figure


def target_rows(d: Diagnosis, equation: str, trajectory: str, side: str) -> tuple[np.ndarray, np.ndarray] | None:
    """Return times and the measured side of an equation at every row of a run; None where no column holds it."""
    run, words = _rows(d, trajectory), Words.of(d)
    if run is None:
        return None
    if words.is_at_ports(equation):
        columns = [p.column or p.name for p in d.nominal.ports if p.kind == "output" and p.name == equation]
    else:
        columns = [f"F{side}"] if equation == "force" else []
    column = next((c for c in columns if c in run), None)
    return None if column is None else (run["time"].to_numpy(dtype=float), run[column].to_numpy(dtype=float))


def _rows(d: Diagnosis, trajectory: str) -> pd.DataFrame | None:
    """Return the rows of a run, whose name among several logs begins with that of its log."""
    logs = d.history.logs if d.history is not None else {}
    for name, log in logs.items():
        names = log["trajectory"].astype(str) if "trajectory" in log else None
        for called in (trajectory, trajectory.removeprefix(f"{name}: ")):
            if names is not None and (names == called).any():
                return log[names == called].sort_values("time", kind="stable")
    return None


def _columns(d: Diagnosis, run: pd.DataFrame, equation: str) -> list[tuple[str, str]]:
    """Return signals and their columns: those of the simulator's ports, or those that every log of a bench has."""
    ports = d.nominal.own_ports if d.nominal is not None else ()
    named = [(p.name, p.source) for p in ports if p.kind in ("input", "state", "output")]
    if not ports:
        named = [(c, c) for c in map(str, run.columns) if c != "time" and (c in SIGNALS or c.rstrip("12") in SIGNALS)]
    there = [(n, c) for n, c in named if c in run and np.isfinite(run[c].to_numpy(dtype=float)).any()]
    if len(there) > _MOST:
        order = telling_ports(of_equation(d, equation))
        told = sorted(there, key=lambda one: order.index(one[0]) if one[0] in order else len(order))[:_MOST]
        there = [one for one in there if one in told]
    return there
