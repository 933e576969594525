"""The windows of one equation, in the shape that pictures need."""

import numpy as np
import pandas as pd

from ...equations import all_equations
from ...errors import UnknownOptionError
from ...gap.diagnosis.result import Diagnosis

_MOST = 400_000  # windows of a map; more change no cell's mean visibly


def equations(d: Diagnosis) -> list[str]:
    """Return the equations that have windows, the one with most of the gap first."""
    present = list(dict.fromkeys(d.windows["equation"].tolist())) if len(d.windows) else []
    order = {e.equation: -e.share for e in d.equations}
    return sorted(present, key=lambda name: order.get(name, 0.0))


def chosen_equation(d: Diagnosis, equation: str | None) -> str:
    """Return an equation that has windows: the one asked for, or the one with most of the gap."""
    known = equations(d)
    if equation is None and known:
        return known[0]
    if equation not in known:
        raise UnknownOptionError(
            f"The diagnosis holds no windows of {equation!r}.",
            f"one of {', '.join(known)}" if known else "windows of an equation",
            "Correct the name." if known else "Diagnose a log with longer runs.",
        )
    return equation


def main_equation(d: Diagnosis) -> str:
    """Return the equation with windows in which the first cause acts, or the one with most of the gap."""
    known = equations(d)
    return d.added[0].equation if d.added and d.added[0].equation in known else known[0]


def unit_of(d: Diagnosis, equation: str) -> str:
    """Return the SI unit of an equation's residual."""
    units = {e.equation: e.unit for e in d.equations} | {c.equation: c.unit for c in d.closure if c.unit}
    stated = units.get(equation, "")
    known = all_equations()
    return stated or (known[equation].unit if equation in known else "")


def of_equation(d: Diagnosis, equation: str) -> pd.DataFrame:
    """Return the windows of an equation, a random part where there are very many."""
    part = d.windows[d.windows["equation"] == equation]
    return part if len(part) <= _MOST else part.sample(_MOST, random_state=0)


def states(d: Diagnosis) -> tuple[str, ...]:
    """Return which residuals differ: there is an after only where something was added."""
    return ("before", "after") if d.added else ("before",)


def usable(part: pd.DataFrame, column: str) -> bool:
    """Whether a column is there and varies."""
    if column not in part.columns:
        return False
    x = part[column].to_numpy(dtype=float)
    x = x[np.isfinite(x)]
    return len(x) > 10 and float(np.ptp(x)) > 1e-12


_NOT_STATE = ("trajectory", "time", "equation", "side", "measured", "before", "after", "noise")


def telling_ports(part: pd.DataFrame) -> list[str]:
    """Return the signals of a simulator's ports, the one on which the error depends most first."""
    from pandas.api.types import is_numeric_dtype

    ports = [str(c) for c in part.columns if c not in _NOT_STATE and is_numeric_dtype(part[c])]
    moved = [name for name in ports if usable(part, name)]
    return sorted(moved, key=lambda name: -_explained(part, name))


def _explained(part: pd.DataFrame, name: str) -> float:
    """Return the share of an error's variance that lies between tenths of a signal's range of ranks."""
    x, error = (pd.Series(part[column].to_numpy(dtype=float)) for column in (name, "before"))
    tenths = (x.rank(method="first", pct=True) * 10).round()
    spread = float(error.var(ddof=0))
    return float(error.groupby(tenths).transform("mean").var(ddof=0)) / spread if spread > 0.0 else 0.0


def telling_trajectories(d: Diagnosis, equation: str, most: int = 3) -> list[str]:
    """Return the runs that tell most of an equation's gap, of different kinds where there are several."""
    part = d.windows[d.windows["equation"] == equation]
    excess = (part["before"] ** 2 - part["noise"] ** 2).groupby(part["trajectory"], sort=False).sum()
    order = [str(name) for name in excess.sort_values(ascending=False, kind="stable").index]
    chosen: list[str] = []
    for new_kind in (True, False):
        for name in order:
            kinds = {c.partition("-")[0] for c in chosen}
            if len(chosen) < most and name not in chosen and (name.partition("-")[0] not in kinds or not new_kind):
                chosen.append(name)
    return chosen


def of_trajectory(d: Diagnosis, equation: str, trajectory: str) -> pd.DataFrame:
    """Return the windows of one run in order of time, of the side with the larger residual."""
    part = d.windows[(d.windows["equation"] == equation) & (d.windows["trajectory"].astype(str) == trajectory)]
    if not len(part):
        raise UnknownOptionError(
            f"The windows of {equation} hold no run {trajectory!r}.",
            f"one of {', '.join(telling_trajectories(d, equation, 8))}",
            "Correct the name.",
        )
    side = (part["before"] ** 2).groupby(part["side"].astype(str)).mean().idxmax()
    return part[part["side"].astype(str) == side].sort_values("time", kind="stable")
