"""``pamid watch`` with a simulator that has ports: learn, watch, and name what has changed."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import StreamError, UnknownParameterError
from ._progress import progress
from .common import note

if TYPE_CHECKING:
    from ..online.stream import Samples


def events_at_ports(
    args: argparse.Namespace, source: Iterator[bytes | None], simulator: Any
) -> Iterator[dict[str, Any]]:
    """Yield the findings in a stream of samples, as they come."""
    import pandas as pd

    from ..online.stream import Samples
    from ..report.several import changed
    from ..watching import SimulatorWatch

    if args.model or args.muscle != 1:
        raise UnknownParameterError(
            "--model or --muscle is given with a simulator with ports.",
            "neither",
            "Leave it out: they are for muscles.",
        )
    convert = _in_port_units(args, simulator) if args.columns else None
    first, source = _first_sample(source)
    first = convert(first) if convert else first
    columns = [p.source for p in simulator.ports if p.kind != "joint" and p.source in first]
    samples = Samples(columns, interval=args.interval, block=20, convert=convert)
    effects = [e.strip() for e in args.effects.split(",")] if args.effects else "all"
    watch = SimulatorWatch(
        simulator, effects, false_alarms=min(args.false_alarms * 600.0 / 3600.0, 0.5), random_state=args.seed
    )
    healthy: list[pd.DataFrame] = []
    run, count, found, watched, told, learnt = 0, 0, 0, 0, 0, False
    for begins, block in _blocks(source, samples):
        told = note_left_out(args, samples, told)
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
        refuse_a_table(samples)
        wanted = ", ".join(columns) or "columns of the ports"
        raise StreamError(
            f"Nothing was watched: the stream holds {count * (samples.interval or 0.0):.3g} s of samples"
            f"{'' if count or not problems else f'; its last line, {samples.last_problem}'}.",
            f"more than {args.learn:g} s of samples, in lines of JSON, with time and {wanted}",
            "Correct the stream, or learn for less time with --learn.",
        )


def refuse_a_table(samples: Samples) -> None:
    """Raise where no line of a stream was a JSON object, as in a table."""
    if (n := samples.problems["malformed"]) and not samples.objects:
        raise StreamError(
            f"None of the {n:,} lines is a JSON object; the first is {samples.first_problem}.",
            'JSON lines, one object per sample, such as {"time": 0.01, ...}',
            "Let the logger write such lines. A table is not a stream: convert it (pandas: to_json(orient='records', "
            "lines=True)), or use 'pamid diagnose'.",
        )


def note_left_out(args: argparse.Namespace, samples: Samples, told: int) -> int:
    """Note the first lines that are no samples, of which some are told already; return how many there are."""
    if told < (found := samples.problems["malformed"]) <= 3:
        note(args, f"warning: line left out, {samples.last_problem}")
    return found


def _in_port_units(args: argparse.Namespace, simulator: Any) -> Callable[[dict[str, Any]], dict[str, Any]]:
    """Return a function that converts a sample from a log's names to the ports and their units."""
    import numpy as np

    from ..signals._tidy import as_wanted
    from ..signals.log import mapping_for

    mapping, _ = mapping_for(simulator, args.columns)
    path = Path(args.stream)

    def convert(row: dict[str, Any]) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for signal, how in mapping.signals.items():
            column = str(how.column or signal)
            if column in row:
                raw = np.asarray(np.nan if row[column] is None else float(row[column]))
                found[signal] = float(as_wanted(raw, signal, how, {}, mapping, path))
        return found

    return convert


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
