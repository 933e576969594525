"""Diagnose one log or several, with a simulator of any kind."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from ...bench.parameters import BenchParameters
from ...signals.frames import logs_as_pandas
from ...simulators.base import Simulator
from ..at_ports import diagnose_at_ports
from ..diagnosis.result import Diagnosis
from ..engine import diagnose_bench
from ..inference.runs_differ import Border, RunsDifferError
from ..rerun import tried
from .conditions import Conditions
from .engine import diagnose_bench_logs
from .ports import diagnose_port_logs
from .variants import MOST_DAYS, odds_of_change

APART = "The runs of this log differ in the size of an effect: each is taken as a log of its own."
"""Note where runs that were given as one log are diagnosed as several."""
WITHIN = "The size of an effect changes within this log: its two parts are taken as logs of their own."
"""Note where a log is cut in two."""


def runs_of(log: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return the runs of a log as logs, by name."""
    if "trajectory" not in log:
        return {"log": log}
    return {str(name): rows.reset_index(drop=True) for name, rows in log.groupby("trajectory", sort=False)}


def parted(runs: Mapping[str, pd.DataFrame], border: Border) -> dict[str, pd.DataFrame]:
    """Return few runs as logs of their own; cut within a run, or of many, what lies before a border and after it."""
    if border.time is None and len(runs) <= MOST_DAYS:
        return dict(runs)
    tables, k, time = list(runs.values()), list(runs).index(border.run) if border.run in runs else 0, border.time or 0.0
    begins = [float(np.nanmin(table["time"])) for table in tables]
    halves = [[t[t["time"] < b + time], t[t["time"] >= b + time]] for t, b in zip(tables, begins, strict=True)]
    where = f"{begins[k] + time:.4g} s"
    sides = [*tables[:k], halves[k][0]], [halves[k][1], *tables[k + 1 :]]
    until = where if len(runs) == 1 else border.run if border.time is None else f"{where} of {border.run}"
    if not border.run and len(runs) > 1:
        sides, until = ([a for a, _ in halves], [b for _, b in halves]), f"{where} of each run"
    return {
        f"{word} {until}": pd.concat([t for t in side if len(t)], ignore_index=True)
        for word, side in zip(("until", "from"), sides, strict=True)
    }


def diagnose(
    log: pd.DataFrame | Sequence[pd.DataFrame] | Mapping[str, pd.DataFrame],
    simulator: BenchParameters | Simulator,
    effects: str | Sequence[str] = "all",
    *,
    conditions: Mapping[str, Conditions] | None = None,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Diagnose where a simulator and a log disagree, which effect is the cause, and how far the gap closes once it is
    added.

    Parameters with a tolerance are refitted within it together with every candidate, so that one that is slightly off
    is not a gap. Of several logs the causes and what lasts, such as lengths and masses, are shared; valves, friction
    and gas of a bench, clocks and offsets of other simulators are each day's own. A cause may also appear or go between
    two days where the evidence supports it.

    `pamid.diagnose` also keeps the logs, so that a later diagnosis continues from this one. ``diagnose_simulator`` and
    ``pamid.gap.several.diagnose_logs`` are this function.

    Parameters
    ----------
    log : DataFrame, list of DataFrame or mapping of str to DataFrame
        ``trajectory``, ``time`` (s) and the simulator's signals; of a bench ``q`` (rad), ``P1``, ``P2`` (Pa, absolute),
        ``F1``, ``F2`` (N), ``mdot1``, ``mdot2`` (kg/s), ``u1``, ``u2``, without some of which the equations that read
        them are left out. Several logs in a list ("log", "log 2", ...) or by name, in the order in which they were
        recorded.
    simulator : BenchParameters or Simulator
        The simulator, with its tolerances.
    effects : "all" or sequence of str, default="all"
        Effects that may be causes; "all" are those that such a system may have. At ports every port is tried, unless
        one is named: ``"viscous_friction@motor"``.
    conditions : mapping of str to `pamid.gap.several.Conditions`, optional
        Conditions of each of several logs: parameters of the simulator that differ, and its day; a log without them is
        a day of its own.
    seed : int, default=0
        Seed of the draws behind p-values and intervals.
    progress : callable, optional
        Called with a short text at each step.

    Returns
    -------
    Diagnosis
        The answer; at ports its causes say where they act. ``corrected`` is the simulator with them. Of several logs
        ``logs`` holds the causes' parameters log by log, ``changes`` which of them changed between logs.

    Raises
    ------
    UnknownOptionError
        The library has no effect of such a name.
    ExcitationError
        The log excites nothing that could distinguish effects.
    MissingColumnError, MissingTrajectoryError, ShortTrajectoryError, TimeOrderError, NonFiniteError
        The log cannot be used as it is; of several logs the message names it.
    IncompatibleError
        Two logs hold no signal in common, or a run twice, or cannot be of one bench.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.gap import diagnose
    >>> nominal, leak = BenchParameters.for_muscle("B"), [("leakage", {"conductance": 2e-10})]
    >>> runs, library = [sine(2, 10, 1500), sine(6, 10, 1500)], ["leakage", "viscous_friction"]
    >>> leaking, tight = simulate(nominal, runs, seed=1, effects=leak), simulate(nominal, runs, seed=0)
    >>> diagnose(leaking, nominal, library).causes[0].effects
    ('leakage',)
    >>> found = diagnose({"monday": tight, "friday": leaking}, nominal, library)
    >>> found.changes[0].effect, found.changes[0].how, found.changes[0].log
    ('leakage', 'appears', 'friday')

    Any simulator with ports, here a mass of 2 kg on a rail, pushed to and fro, with 3 N s/m of friction:

    >>> import numpy as np, pandas as pd
    >>> from pamid.simulators import FunctionSimulator, Port
    >>> rng, runs = np.random.default_rng(0), []
    >>> for k in range(4):
    ...     t, x, v = np.arange(0, 8, 0.01), [0.0], [0.0]
    ...     F = 5 * np.sin((1 + k) * t) + 3 * np.sin(0.7 * t)
    ...     for f in F[:-1]:
    ...         v.append(v[-1] + 0.01 * (f - 3 * v[-1]) / 2)
    ...         x.append(x[-1] + 0.005 * (v[-1] + v[-2]))
    ...     noisy = {"x": x + 1e-5 * rng.standard_normal(800), "v": v + 1e-3 * rng.standard_normal(800)}
    ...     runs.append(pd.DataFrame({"trajectory": str(k), "time": t, "F": F, **noisy}))
    >>> ports = [Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]
    >>> rail = FunctionSimulator(lambda t, x, u, p: [x.v, u.F / p.m], ports, {"m": (2.0, 0.05, "kg")})
    >>> found = diagnose(pd.concat(runs), rail, ["viscous_friction", "quadratic_drag", "actuator_gain"])
    >>> found.causes[0].effects, found.causes[0].where, round(found.causes[0].parameters["coefficient"].value, 1)
    (('viscous_friction',), ('x',), 3.0)
    """
    return diagnosed(log, simulator, effects, conditions, seed, progress or (lambda _: None))[0]


def diagnosed(
    log: pd.DataFrame | Sequence[pd.DataFrame] | Mapping[str, pd.DataFrame],
    simulator: BenchParameters | Simulator,
    effects: str | Sequence[str],
    conditions: Mapping[str, Conditions] | None,
    seed: int,
    say: Callable[[str], None],
) -> tuple[Diagnosis, Mapping[str, pd.DataFrame]]:
    """Return the diagnosis, and the logs that one log turned out to be; none where it is one."""
    say("read the log")
    given = logs_as_pandas(log)
    if isinstance(simulator, Simulator):
        if isinstance(given, Mapping):
            return diagnose_port_logs(given, simulator, effects, conditions, seed, say), {}
        try:
            return diagnose_at_ports(given, simulator, effects, seed, say, odds_of_change), {}
        except RunsDifferError as differ:
            runs, within = runs_of(given), differ.border.time is not None
            parts = parted(runs, differ.border)
        note = APART if not within and len(parts) == len(runs) else WITHIN
        say(note)
        found = diagnose_port_logs(parts, simulator, effects, conditions, seed, say)
        if within and not found.changes:
            return diagnose_at_ports(given, simulator, effects, seed, say), {}
        return replace(found, notes=[*found.notes, note]), parts
    if isinstance(given, Mapping):
        return diagnose_bench_logs(given, simulator, effects, conditions, seed, say), {}
    return tried(diagnose_bench(given, simulator, effects, seed, say), given), {}


diagnose_simulator = diagnose
