"""Diagnose several logs of one bench together: causes are shared unless the logs say that one came or went."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from ...bench.parameters import BenchParameters
from ...effects import Effect
from ...effects.registry import chosen_effects
from ...equations.log import BenchLog
from ...errors import IncompatibleError, PamidError
from ...signals.readings import run_marks
from ..design.experiment import next_experiment
from ..diagnosis.answer import answer, untested
from ..diagnosis.decide import Verdict, decide
from ..diagnosis.result import Diagnosis
from ..engine import rows_searched
from ..inference.competition import Competition
from ..inference.so_far import twice, unless_stopped
from ..residuals.bench import Evidence
from ..residuals.checks import check, moves, notes_on, without_stuck
from ..settings import MAX_ROWS, SEARCH_ROWS
from .alike import check_alike
from .compare import merged
from .conditions import Conditions, conditions_of
from .result import LogFinding
from .stacked import Log, StackedEvidence
from .variants import Variants


def diagnose_bench_logs(
    logs: Mapping[str, pd.DataFrame],
    params: BenchParameters,
    effects: str | Sequence[str],
    conditions: Mapping[str, Conditions] | None,
    seed: int,
    say: Callable[[str], None],
) -> Diagnosis:
    """Diagnose several logs of one bench together."""
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

    def as_logs(some: Sequence[Evidence]) -> list[Log]:
        return [Log(n, e, c.day) for n, e, c in zip(names, some, held, strict=True)]

    fewer = list[Log]()
    if (rows := sum(len(t) for t in whole)) > SEARCH_ROWS:
        part = [t.whole(max(1, SEARCH_ROWS * len(t) // rows)) for t in whole]
        fewer = as_logs([Evidence(t, c.under(params)) for t, c in zip(part, held, strict=True)])
        notes.append(rows_searched(sum(map(len, part)), rows))
    rng = np.random.RandomState(seed)
    found, verdict, stack = together(as_logs(each), library, each[0].effects, notes, rng, say, fewer)
    if verdict is None:
        return found
    last = len(each) - 1
    with threadpool_limits(1):
        experiment, _ = unless_stopped(
            lambda: next_experiment(each[last], verdict, lambda spec: stack.spec_in(last, spec)), lambda: (None, ())
        )
    sizes = [(len(t), len(t.trajectories)) for t in tables]
    return replace(found, next_run=experiment, logs=sized(found.logs, sizes, held))


def together(
    logs: Sequence[Log],
    library: Sequence[str],
    effects: Mapping[str, type[Effect]],
    notes: list[str],
    random_state: np.random.RandomState,
    say: Callable[[str], None],
    searched: Sequence[Log] = (),
    close: Sequence[str] = (),
    interrupted: bool = False,
) -> tuple[Diagnosis, Verdict | None, StackedEvidence]:
    """Return the joint diagnosis of logs, each log's parameters, the decision if any, and the stacked evidence."""
    names, _, days = zip(*logs, strict=True)
    variants = Variants(library, effects, names, days)
    stack = StackedEvidence(logs, variants)
    if not stack.equations:
        return untested(stack, library, notes), None, stack
    with threadpool_limits(1):
        part = StackedEvidence(searched, variants) if searched else stack
        competition = Competition(part, variants.library, say, apart=variants.apart, close=close)
        competition.interrupted = interrupted
        outcome = competition.refit(competition.screen(1)) if interrupted else competition.run()
        verdict = twice(lambda _: decide(competition, outcome, random_state))
        found = twice(lambda short: answer(stack, competition, verdict, notes, random_state, say, short))
        say("compare the logs")
        return merged(found, stack, competition, verdict, variants), verdict, stack


def sized(logs: Sequence[LogFinding], sizes: Sequence[tuple[int, int]], held: Sequence[Conditions]) -> list[LogFinding]:
    """Return the findings for each log, with its rows, runs and conditions."""
    return [
        replace(f, rows=rows, trajectories=runs, conditions=dict(c.numbers))
        for f, (rows, runs), c in zip(logs, sizes, held, strict=True)
    ]


@contextmanager
def naming(log: str) -> Iterator[None]:
    """Prefix errors with the name of a log."""
    try:
        yield
    except PamidError as error:
        error.args = (f"{log}: {error.args[0]}", *error.args[1:]) if error.args else (log,)
        raise


def _tables(
    logs: Mapping[str, pd.DataFrame], params: BenchParameters, held: Sequence[Conditions]
) -> tuple[list[BenchLog], list[str]]:
    """Return the logs without the readings of stuck sensors, and notes; an error names its log."""
    refuse_twice(logs)
    tables: list[BenchLog] = []
    notes: list[str] = []
    for (name, log), conditions in zip(logs.items(), held, strict=True):
        with naming(name):
            # A joint at rest shows offsets, leaks and loads, beside logs of motion.
            bench_log, last = BenchLog.of(log), name == list(logs)[-1]
            told = check(bench_log, conditions.under(params), moving=last and not any(map(moves, tables)))
            table, stuck = without_stuck(bench_log)
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
