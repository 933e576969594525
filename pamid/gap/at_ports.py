"""The diagnosis of any simulator with ports: which effect, at which port, and the corrected simulator."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..signals.frames import logs_as_pandas
from ..simulators.base import Simulator
from ..simulators.catalogue import chosen
from .diagnosis.result import Diagnosis
from .engine import explain
from .inference.so_far import where_so_far
from .inference.student_t import scale
from .readings import settled
from .residuals.direct import DirectEvidence
from .residuals.part import remember_as, to_search
from .simulated import evidence_of, learn, outward

if TYPE_CHECKING:
    import pandas as pd

    from .several.conditions import Conditions


def diagnose_simulator(
    log: pd.DataFrame | Mapping[str, pd.DataFrame],
    simulator: Simulator,
    effects: str | Sequence[str] = "all",
    *,
    conditions: Mapping[str, Conditions] | None = None,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Diagnose where a simulator and a log disagree, which effect at which port is the cause, and how far the gap
    closes.

    Parameters with a tolerance are refitted within it together with every candidate. Of several logs the causes and the
    parameters are shared, unless the logs show that a cause came or went between two days.

    Parameters
    ----------
    log : DataFrame or mapping of str to DataFrame
        ``trajectory``, ``time`` (s) and the columns that the simulator's ports name; several logs by name, in the order
        in which they were recorded.
    simulator : Simulator
        The simulator.
    effects : "all" or sequence of str, default="all"
        Effects that may be causes: names as `pamid.simulators.port_effects` gives them, at every port, or such as
        ``"viscous_friction@motor"``.
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
        The answer; its causes say where they act, and ``corrected`` is the simulator with them. Of several logs
        ``logs`` holds the causes' parameters log by log, ``changes`` which of them changed between logs.

    Raises
    ------
    MissingColumnError, ShortTrajectoryError
        The log cannot be used.
    UnknownOptionError
        The name of an effect is unknown.
    IncompatibleError
        Two logs hold no signal in common, or a run twice.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.gap import diagnose_simulator
    >>> from pamid.simulators import FunctionSimulator, Port
    >>> rng, runs = np.random.default_rng(0), []
    >>> for k in range(4):  # a mass of 2 kg on a rail, pushed to and fro, with 3 N s/m of friction
    ...     t, x, v = np.arange(0, 8, 0.01), [0.0], [0.0]
    ...     F = 5 * np.sin((1 + k) * t) + 3 * np.sin(0.7 * t)
    ...     for f in F[:-1]:
    ...         v.append(v[-1] + 0.01 * (f - 3 * v[-1]) / 2)
    ...         x.append(x[-1] + 0.005 * (v[-1] + v[-2]))
    ...     noisy = {"x": x + 1e-5 * rng.standard_normal(800), "v": v + 1e-3 * rng.standard_normal(800)}
    ...     runs.append(pd.DataFrame({"trajectory": str(k), "time": t, "F": F, **noisy}))
    >>> ports = [Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]
    >>> rail = FunctionSimulator(lambda t, x, u, p: [x.v, u.F / p.m], ports, {"m": (2.0, 0.05, "kg")})
    >>> found = diagnose_simulator(pd.concat(runs), rail, ["viscous_friction", "quadratic_drag", "actuator_gain"])
    >>> found.causes[0].effects, found.causes[0].where, round(found.causes[0].parameters["coefficient"].value, 1)
    (('viscous_friction',), ('x',), 3.0)
    """
    from threadpoolctl import threadpool_limits

    say = progress or (lambda _: None)
    say("read the log")
    log = logs_as_pandas(log)
    if simulator.states_equation:
        from .equation import diagnose_stated

        return diagnose_stated(log, simulator, effects, conditions, seed, say)
    if isinstance(log, Mapping):
        from .several.ports import diagnose_port_logs

        return diagnose_port_logs(log, simulator, effects, conditions, seed, say)
    evidence = evidence_of(log, simulator, refit=True)
    asked = chosen(evidence.placements, effects)
    # Thousands of small products: threads would only wait for one another.
    with threadpool_limits(1):
        searched = to_search(evidence) if isinstance(evidence, DirectEvidence) else evidence
        asked = settled(evidence, evidence.log, simulator, asked, say)
        if searched is not evidence:
            settled(searched, searched.log, simulator, asked, say)
        say("estimate what could be explained")
        say(where_so_far(searched.equations, np.array([scale(searched.z0[p], 0.0) for p in searched.parts])))
        known, interrupted = learn(searched, asked, say)
        library = [name for name in asked if known.get(name)]
        notes = [f"The residuals are {evidence.how}.", *evidence.notes]
        if isinstance(searched, DirectEvidence) and isinstance(evidence, DirectEvidence) and searched is not evidence:
            remember_as(evidence, searched)
            notes.append(f"Causes were searched in {searched.log.n:,} rows, and fitted to {evidence.log.n:,}.")
        found = explain(evidence, library, np.random.RandomState(seed), notes, say, searched, known, interrupted)
    return outward(found, evidence)
