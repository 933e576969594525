"""``pamid watch`` with a simulator that has ports: learn, watch, and name what has changed."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from itertools import chain
from typing import TYPE_CHECKING, Any

from ..errors import StreamError, UnknownParameterError
from ._progress import progress
from .common import note

if TYPE_CHECKING:
    from ..simulators import Simulator


def events_at_ports(
    args: argparse.Namespace, source: Iterator[bytes | None], simulator: Simulator
) -> Iterator[dict[str, Any]]:
    """Yield what a stream of samples shows, as it comes."""
    import pandas as pd

    from ..online.stream import Samples
    from ..report.several import changed
    from ..watching import SimulatorWatch

    if args.model or args.muscle != 1:
        raise UnknownParameterError(
            "--model or --muscle is given with a simulator with ports.", "neither", "Leave it out: they are of muscles."
        )
    first, source = _first_sample(source)
    columns = [c for p in simulator.ports if p.kind != "joint" and (c := p.column or p.name) in first]
    samples = Samples(columns, interval=args.interval, block=20)
    effects = [e.strip() for e in args.effects.split(",")] if args.effects else "all"
    watch = SimulatorWatch(
        simulator, effects, false_alarms=min(args.false_alarms * 600.0 / 3600.0, 0.5), random_state=args.seed
    )
    healthy: list[pd.DataFrame] = []
    run, count, found, watched, told, learnt = 0, 0, 0, 0, 0, False
    for begins, block in _blocks(source, samples):
        if samples.problems["malformed"] > told:
            told = samples.problems["malformed"]
            if told <= 3:
                note(args, f"warning: line left out, {samples.last_problem}")
        run, count = run + begins, count + len(block["time"])
        if begins and learnt:
            yield {"event": "run", "time": float(block["time"][0])}
        table = pd.DataFrame(block).assign(trajectory=f"run {run}").dropna(axis="columns", how="all")
        if not learnt:
            healthy.append(table)
            if sum(map(len, healthy)) * (samples.interval or 0.0) < args.learn:
                continue
            with progress(args, "Learning") as step:
                watch.learn(pd.concat(healthy, ignore_index=True), step)
            learnt = True
            assert watch.history is not None
            headline = f"as it is: {', '.join(watch.known) or 'no gap'}"
            yield {"event": "learnt", "time": float(block["time"][-1]), "samples": count, "headline": headline}
            continue
        watched += len(table)
        for change in watch.update(table):
            found += 1
            yield {
                "event": "change", "time": change.time, "equation": change.equation,
                "changes": [changed(c) for c in change.changes],
                "causes": [{"effect": c.effect, "where": c.where, "how": c.how, "before": c.before, "after": c.after,
                            "parameter": c.parameter, "unit": c.unit} for c in change.changes],
            }  # fmt: skip
    problems = {k: v for k, v in samples.problems.items() if v}
    yield {
        "event": "end", "samples": count, "watched": watched * (samples.interval or 0.0), "findings": found,
        "problems": problems,
    }  # fmt: skip
    if not watched:
        raise StreamError(
            f"Nothing was watched: the stream holds {count * (samples.interval or 0.0):.3g} s of samples.",
            f"more than {args.learn:g} s of samples with time and {', '.join(columns) or 'columns of the ports'}",
            "Correct the stream, or learn for less time with --learn.",
        )


def _first_sample(source: Iterator[bytes | None]) -> tuple[dict[str, Any], Iterator[bytes | None]]:
    """Return the first line that holds an object, and the stream with it."""
    seen: list[bytes | None] = []
    for line in source:
        seen.append(line)
        try:
            found = json.loads(line) if line else None
        except (ValueError, RecursionError):
            continue
        if isinstance(found, dict):
            return found, chain(seen, source)
    return {}, iter(seen)


def _blocks(source: Iterator[bytes | None], samples: Any) -> Iterator[Any]:
    for line in source:
        if line is not None:
            yield from samples.take(line)
    yield from samples.end()
