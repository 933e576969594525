"""Diagnose several logs of one bench together: causes are shared unless the logs say that one came or went."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...effects.registry import chosen_effects
from ...equations.log import BenchLog
from ...errors import IncompatibleError
from ...signals.readings import run_marks
from ..diagnosis.answer import answer, untested
from ..diagnosis.decide import Verdict, decide
from ..diagnosis.next_experiment import next_experiment
from ..diagnosis.result import Diagnosis
from ..inference.competition import Competition
from ..residuals.bench import Evidence
from ..residuals.checks import check, moves, notes_on, without_stuck
from ..settings import MAX_ROWS, SEARCH_ROWS
from .alike import check_alike
from .compare import merged
from .conditions import Conditions, conditions_of
from .result import LogFinding
from .stacked import Log, StackedEvidence
from .variants import Variants

if TYPE_CHECKING:
    import pandas as pd

    from ...bench.parameters import BenchParameters


def diagnose_bench_logs(
    logs: Mapping[str, pd.DataFrame],
    params: BenchParameters,
    effects: str | Sequence[str],
    conditions: Mapping[str, Conditions] | None,
    seed: int,
    say: Callable[[str], None],
) -> Diagnosis:
    """Diagnose several logs of one bench together."""
    from threadpoolctl import threadpool_limits

    library = chosen_effects(effects, "bench")
    names = list(logs)
    held = conditions_of(names, conditions)
    tables, notes = _tables(logs, params, held)
    total = sum(len(t) for t in tables)
    whole = [t.whole(max(1, MAX_ROWS * len(t) // total)) if total > MAX_ROWS else t for t in tables]
    each = [Evidence(t, c.under(params)) for t, c in zip(whole, held, strict=True)]
    check_alike(dict(zip(names, each, strict=True)))
    for name, one in zip(names, each, strict=True):
        notes += [f"{name}: {text}" for text in notes_on(one)[1:]]
    notes = list(dict.fromkeys([*notes_on(each[0])[:1], *notes]))
    days = [c.day for c in held]
    variants = Variants(library, each[0].effects, names, days)
    stack = _stack(names, each, days, variants)
    searched = stack
    if (rows := sum(len(t) for t in whole)) > SEARCH_ROWS:
        part = [t.whole(max(1, SEARCH_ROWS * len(t) // rows)) for t in whole]
        fewer = [Evidence(t, c.under(params)) for t, c in zip(part, held, strict=True)]
        searched = _stack(names, fewer, days, variants)
        notes.append(f"Causes were searched in {sum(map(len, part)):,} rows, and fitted to {rows:,}.")
    random_state = np.random.RandomState(seed)
    if not stack.equations:
        return untested(stack, library, notes)
    with threadpool_limits(1):
        found, verdict = explained(stack, searched, variants, notes, random_state, say)
        last = len(each) - 1
        experiment, _ = next_experiment(each[last], verdict, each[last].params, lambda spec: stack.spec_in(last, spec))
        found = replace(found, next_experiment=experiment)
    sizes = {n: (len(t), len(t.trajectories)) for n, t in zip(names, tables, strict=True)}
    return replace(found, logs=sized(found.logs, sizes, held))


def explained(
    stack: StackedEvidence,
    searched: StackedEvidence,
    variants: Variants,
    notes: list[str],
    random_state: np.random.RandomState,
    say: Callable[[str], None],
) -> tuple[Diagnosis, Verdict]:
    """Return the joint diagnosis of several logs, with each log's parameters, and the decision."""
    competition = Competition(searched, variants.library, say)
    outcome = competition.run()
    verdict = decide(competition, outcome, random_state)
    say("measure the closure")
    found = answer(stack, competition, verdict, notes, random_state, say)
    say("compare the logs")
    return merged(found, stack, competition, verdict, variants), verdict


def sized(
    logs: Sequence[LogFinding], sizes: Mapping[str, tuple[int, int]], held: Sequence[Conditions]
) -> list[LogFinding]:
    """Return the findings for each log, with its rows, runs and conditions."""
    return [
        replace(f, rows=sizes[f.log][0], trajectories=sizes[f.log][1], conditions=dict(c.numbers))
        for f, c in zip(logs, held, strict=True)
    ]


def _stack(names: Sequence[str], each: Sequence[Evidence], days: Sequence[str], variants: Variants) -> StackedEvidence:
    stacked = [Log(n, e, d) for n, e, d in zip(names, each, days, strict=True)]
    return StackedEvidence(stacked, variants)


def _tables(
    logs: Mapping[str, pd.DataFrame], params: BenchParameters, held: Sequence[Conditions]
) -> tuple[list[BenchLog], list[str]]:
    """Return the logs without the readings of stuck sensors, and notes; an error names its log."""
    from ...errors import PamidError

    refuse_twice(logs)
    tables: list[BenchLog] = []
    notes: list[str] = []
    for (name, log), conditions in zip(logs.items(), held, strict=True):
        try:
            # A joint at rest shows offsets, leaks and loads, beside logs of motion.
            bench_log, last = BenchLog.of(log), name == list(logs)[-1]
            told = check(bench_log, conditions.under(params), moving=last and not any(map(moves, tables)))
            table, stuck = without_stuck(bench_log)
        except PamidError as error:
            error.args = (f"{name}: {error.args[0]}", *error.args[1:]) if error.args else (name,)
            raise
        tables.append(table)
        notes += [f"{name}: {text}" for text in [*told, *stuck]]
    return tables, notes


def refuse_twice(logs: Mapping[str, pd.DataFrame]) -> None:
    """Raise where a run is part of two logs: counted twice, it would make an answer too confident."""
    seen: dict[str, str] = {}
    for name, log in logs.items():
        marks = run_marks(log)
        for run, mark in marks.items():
            if mark in seen:
                raise IncompatibleError(
                    f"{run} of {name} repeats {seen[mark]} sample by sample.",
                    "different recordings",
                    "Name each log once: a run counted twice makes the confidence too high.",
                )
        seen |= {mark: f"{run} of {name}" for run, mark in marks.items()}
