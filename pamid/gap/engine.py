"""Diagnose the gap between a simulator and a log of its bench."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from ..bench.parameters import BenchParameters
from ..effects.registry import chosen_effects
from ..equations.log import BenchLog
from .diagnosis.answer import answer, untested
from .diagnosis.decide import Verdict, decide
from .diagnosis.result import Diagnosis
from .inference.competition import Competition
from .inference.hypotheses import Outcome, Screen
from .inference.run_off import Run, by_running
from .inference.runs_differ import RunsDifferError, runs_differ
from .inference.sensitivity import Template
from .inference.so_far import alone_so_far, stopped, twice, unless_stopped
from .inference.stepped import with_steps
from .residuals.bench import Evidence
from .residuals.checks import check, notes_on, without_stuck
from .residuals.protocol import ResidualSource, Spec
from .settings import MAX_ROWS, MOST_CAUSES, SEARCH_ROWS


def diagnose_bench(
    log: pd.DataFrame, params: BenchParameters, effects: str | Sequence[str], seed: int, say: Callable[[str], None]
) -> Diagnosis:
    """Diagnose one log of a bench."""
    library = chosen_effects(effects, "bench")
    used = BenchLog.of(log).whole(MAX_ROWS)
    notes = check(used, params)
    if len(used) < len(log):
        notes.append(rows_used(len(used), len(log)))
    used, stuck = without_stuck(used)
    notes += stuck
    evidence = Evidence(used, params)
    part = used.whole(SEARCH_ROWS)
    searched = Evidence(part, params) if len(part) < len(used) else evidence
    if searched is not evidence:
        notes.append(rows_searched(len(part), len(used)))
    return explain(evidence, library, np.random.RandomState(seed), notes + notes_on(evidence), say, searched)


def screened(competition: Competition, interrupted: bool, say: Callable[[str], None]) -> Screen:
    """Return the library to first order; of an interrupted search its effects one by one."""
    competition.interrupted = interrupted
    try:
        say("compare sets of effects to first order")
        found = competition.screen(1 if interrupted else MOST_CAUSES)
    except KeyboardInterrupt as stop:
        stopped(stop)
        competition.interrupted = True
        found = competition.screen(1)
    say(alone_so_far(found.singles))
    return found


def rows_used(used: int, rows: int) -> str:
    """Return a sentence on how much of a log was used."""
    return f"{used:,} of {rows:,} rows were used: whole runs, evenly spread over the log."


def rows_searched(part: int, rows: int) -> str:
    """Return a sentence on how much of a log causes were searched in."""
    return f"Causes were searched for in {part:,} rows and fitted to {rows:,}."


def explain(
    evidence: ResidualSource,
    library: Sequence[str],
    random_state: np.random.RandomState,
    notes: list[str],
    say: Callable[[str], None] = lambda _: None,
    searched: ResidualSource | None = None,
    known: Mapping[str, Sequence[Template]] | None = None,
    interrupted: bool = False,
    run: Run | None = None,
    change: Callable[[int], float] | None = None,
    heed: Callable[[Outcome, Verdict], None] = lambda *_: None,
    begin: Spec | None = None,
) -> Diagnosis:
    """Decide on evidence and assemble the diagnosis.

    Causes are searched on `searched` if given; `run` rules out sets of effects by simulation. With the log odds of a
    `change` at one of so many borders, parts that disagree about an effect raise `RunsDifferError`. `heed` is told the
    outcome and the verdict, and may raise where this evidence cannot judge them. The search may `begin` with a set
    that explains much.
    """
    if not evidence.equations:
        return untested(evidence, library, notes)
    with threadpool_limits(1):  # thousands of small products: threads would only wait for one another
        competition = Competition(searched or evidence, library, say, known)
        competition.begin = begin or {}
        screen = screened(competition, interrupted, say)

        def stop() -> None:
            competition.interrupted = True

        def so_far() -> Outcome:
            stop()
            return outcome

        if change is not None:
            border = unless_stopped(lambda: runs_differ(competition, screen, change), stop)
            if border is not None:
                raise RunsDifferError(border)
        outcome = competition.refit(screen)

        again = None
        if not competition.interrupted:  # who interrupts a search waits for no other
            again = unless_stopped(
                lambda: with_steps(competition, outcome, lambda c: c.refit(screened(c, False, say))),
                stop,
            )
        if again is not None:
            competition, outcome = again
            evidence = competition.evidence if searched in (None, evidence) else evidence.stepped() or evidence
        if run is not None and not competition.interrupted:
            outcome = unless_stopped(lambda: by_running(competition, outcome, run), so_far)
        # Whoever waits no longer in these last steps still wants what was found: they are done once more, in short.
        verdict = twice(lambda _: decide(competition, outcome, random_state))
        if not competition.interrupted:
            unless_stopped(lambda: heed(outcome, verdict), lambda: None)
        return twice(
            lambda short: answer(
                evidence, competition, verdict, notes, random_state, say, short or competition.interrupted
            )
        )
