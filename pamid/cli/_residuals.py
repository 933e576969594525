"""What a simulator or a saved model leaves of a log, beside the signals that it reads."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any, NamedTuple

from ..errors import ShortTrajectoryError, UnknownOptionError
from .common import any_simulator_of, load_log

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from ..bench.parameters import BenchParameters
    from ..simulators import Simulator


class Left(NamedTuple):
    """What is left of one equation."""

    table: pd.DataFrame
    unit: str
    within_noise: bool = False
    """Whether its root mean square is no larger than the noise explains."""


def residual_tables(args: argparse.Namespace) -> dict[str, Left]:
    """Return the residuals of a simulator or a model, by equation."""
    from ..bench.parameters import BenchParameters

    if args.model is not None:
        return _of_model(args)
    simulator = any_simulator_of(args)
    if simulator is None:
        raise UnknownOptionError(
            "Neither --sim nor --model is given, and no simulator file is in the log's folder.",
            "a simulator or a model",
            "Add --sim SIM.toml or --model MODEL.",
        )
    log = load_log(args, simulator=simulator)
    return _of_bench(log, simulator) if isinstance(simulator, BenchParameters) else _of_ports(log, simulator)


def _of_model(args: argparse.Namespace) -> dict[str, Left]:
    from ._tables import opened, predict_table, signal_table

    _, model, equation, page = opened(args)
    signals = signal_table(load_log(args, nan="drop"), page, equation)
    error = signals[equation.column].to_numpy(dtype=float) - predict_table(model, signals)
    read = [n for n in getattr(model, "feature_names_in_", ("eps", "P")) if n in signals and n != "trajectory"]
    inputs = [n for n in read if n not in ("run", "time")]
    left = signals[["trajectory", "time", *inputs]].assign(residual=error)
    return {equation.name: Left(left[left["residual"].notna()], equation.unit)}


def _of_bench(log: pd.DataFrame, params: BenchParameters) -> dict[str, Left]:
    """Return windows of 20 ms; those of both muscles are runs of their own, each with its pressure and command."""
    import numpy as np
    import pandas as pd

    from ..equations import all_equations, residuals

    runs = {str(name): run for name, run in log.groupby("trajectory", sort=False)}
    parts: dict[str, list[pd.DataFrame]] = {}
    noise: dict[str, list[np.ndarray]] = {}
    for trajectory, name, found in residuals(log, params):
        run = runs[trajectory]
        t = run["time"].to_numpy(dtype=float)
        for side in range(found.value.shape[1]):
            sides = (side + 1,) if found.value.shape[1] == 2 else (1, 2)
            columns = ["q", *(f"{c}{k}" for k in sides for c in ("P", "u"))]
            signals = {}
            for column in columns:
                if column in run and run[column].notna().sum() > 1:
                    known = run[column].notna().to_numpy()
                    own = column.rstrip("12") if len(sides) == 1 else column
                    signals[own] = np.interp(found.time, t[known], run[column].to_numpy(dtype=float)[known])
            table = pd.DataFrame({"time": found.time, "residual": found.value[:, side], **signals})
            gaps = np.cumsum(np.diff(found.time, prepend=found.time[:1]) > 1.5 * np.median(np.diff(found.time)))
            noise.setdefault(name, []).append(np.broadcast_to(found.noise, found.value.shape)[:, side])
            parts.setdefault(name, []).append(table.assign(trajectory=[f"{trajectory}#{side}.{g}" for g in gaps]))
    if not parts:
        raise ShortTrajectoryError(
            "No equation of the simulator can be compared with the log.",
            "longer runs, or more columns",
            "Run 'pamid evaluate', which says why.",
        )
    tables = {name: pd.concat(some) for name, some in parts.items()}
    within = {name: _within(t["residual"].to_numpy(), np.concatenate(noise[name])) for name, t in tables.items()}
    return {name: Left(table, all_equations()[name].unit, within[name]) for name, table in tables.items()}


def _within(residual: np.ndarray, noise: np.ndarray) -> bool:
    """Return whether residuals are no larger than their noise explains, as a diagnosis judges it."""
    import numpy as np

    from ..gap.settings import EXCESS

    known = np.isfinite(residual) & np.isfinite(noise)
    left, least = (float(np.mean(np.square(x[known]))) if known.any() else 0.0 for x in (residual, noise))
    return 0.0 < left <= (1.0 + EXCESS) ** 2 * least


def _of_ports(log: pd.DataFrame, simulator: Simulator) -> dict[str, Left]:
    import numpy as np
    import pandas as pd

    from ..gap.evaluation import residuals_of, timed

    evidence = residuals_of(log, simulator)
    spoken = simulator.spoken(log, {k: evidence.column(k) for k in evidence.state})
    signals, left = evidence.signals(), timed(evidence)
    found: dict[str, Left] = {}
    for equation, part in zip(evidence.equations, evidence.parts, strict=True):
        names = np.asarray(evidence.trajectories, dtype=object)[evidence.run[part]]
        state: dict[str, Any] = {spoken[k]: v[part] for k, v in evidence.state.items() if k in spoken}
        if not simulator.states_equation:
            read = [*evidence.roles(equation).values(), *simulator.inputs]
            state = {k: signals[k][evidence.centre[part]] for k in dict.fromkeys(read) if k in signals}
        state = {k: v for k, v in state.items() if np.all(np.isfinite(v)) and np.ptp(v) > 0}
        table = pd.DataFrame({"trajectory": names, "time": evidence.time[part], "residual": left[part]})
        within = _within(left[part], evidence.noise[part])
        found[equation] = Left(table.assign(**state), evidence.units[equation], within)
    return found
