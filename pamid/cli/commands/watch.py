"""``pamid watch``: follow a stream of samples and name effects that appear."""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from ...errors import IncompatibleError, ParameterError, StreamError
from ...json_data import json_ready
from ...requirements import last_step
from .._simulators import add_trust_option
from .._watched_ports import events_at_ports, note_left_out, refuse_a_table
from ..common import add_command

if TYPE_CHECKING:
    from ...online.stream import Samples

_TARGETS = ("F", "mdot")
_BLOCK = 20
_MANY = 100
"""Lines in a row that are no samples, after which the watch is blind."""
_SAME = 10.0
"""Seconds within which the same finding in the same equation is the one that goes on, s."""
_PATIENCE = 2.0
"""Seconds without a sample, after which it is."""

_DESCRIPTION = """\
Monitor a rig during operation. Samples are JSON lines from a growing file or a pipe, one object per sample:

  muscle               time (s), eps (-), P (Pa, absolute) and F (N), mdot (kg/s) or both
  bench                time, q, P1, P2, F1, F2, mdot1, mdot2; one muscle is monitored (--muscle)
  any other simulator  time and the columns of its ports; once the error grows, the samples that follow are diagnosed
                       as a second log

The first seconds (--learn) must be healthy: the monitor learns from them how the evidence varies by chance. After that
it names effects that appear (a leak, friction, hysteresis) at the false alarm rate that you allow. Late and lost
samples, uneven times, gaps, missing values, glitches, malformed lines and a restarted stream are counted and tolerated.
If samples or signals are missing, stuck or in a wrong unit, it reports within seconds that it is blind, and why.

The output is one line per event, with --json one object per line.
"""
_EXAMPLES = """\
  pamid watch samples.jsonl --sim sim.toml --learn 30
  logger | pamid watch - --sim sim.toml --false-alarms 0.1 --json
  pamid watch samples.jsonl --follow --sim sim.toml --model joint.pamid
  pamid watch samples.jsonl --sim arm.xml --learn 120
  pamid watch samples.jsonl --sim setup/sim.toml --columns setup/columns.toml --learn 120
"""


def add_parser(subparsers: Any) -> None:
    """Add the command."""
    parser = add_command(
        subparsers, "watch", "follow a stream of samples and name effects that appear", _DESCRIPTION, _EXAMPLES
    )
    parser.add_argument("stream", metavar="STREAM", help="file of JSON lines, or - for a pipe")
    parser.add_argument(
        "--sim", metavar="SIM", required=True,
        help="simulator file of a bench, a muscle or a simulator with ports, or a MuJoCo model or FMU",
    )  # fmt: skip
    parser.add_argument(
        "--columns", metavar="MAPPING.toml",
        help="columns and units of the samples for a simulator with ports, as 'pamid init' writes them for a log",
    )  # fmt: skip
    add_trust_option(parser)
    parser.add_argument("--model", metavar="MODEL", help="fitted hybrid model that describes the healthy muscle")
    parser.add_argument(
        "--muscle", type=int, choices=(1, 2), default=1, help="muscle of a bench's samples (default: 1)"
    )
    parser.add_argument(
        "--learn", type=float, default=30.0, metavar="S", help="healthy seconds at the start (default: 30)"
    )
    parser.add_argument(
        "--effects", metavar="A,B,...", help="effects that may appear (default: leak, friction, hysteresis)"
    )
    parser.add_argument(
        "--false-alarms", type=float, default=1.0, metavar="N", help="false alarms allowed per hour (default: 1)"
    )
    parser.add_argument(
        "--interval", type=float, metavar="S", help="sampling interval (default: found from the stream)"
    )
    parser.add_argument("--follow", action="store_true", help="wait for new lines at the end of the file")
    parser.add_argument("--patience", type=float, metavar="S", help="stop after this many seconds without new lines")


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from ...any_simulator import read_simulator
    from ...online.lines import lines, pipe_lines

    if not all(math.isfinite(x) and x > 0 for x in (args.learn, args.interval or 1.0, args.false_alarms)):
        raise ParameterError("--learn, --interval or --false-alarms is not positive.", "numbers above 0", "Correct it.")
    if args.stream == "-":
        source = pipe_lines(sys.stdin.buffer)
    else:
        source = lines(args.stream, follow=args.follow, patience=args.patience)
    simulator = read_simulator(args.sim, trust=args.trust)
    of_muscles = simulator.as_bench() is not None
    if args.columns and of_muscles:
        raise ParameterError(
            "--columns is given for a muscle or a bench.", "samples in SI under pamid's names", "Leave it out."
        )
    for event in (_events if of_muscles else events_at_ports)(args, source, simulator):
        if args.json:
            print(json.dumps(json_ready(event), allow_nan=False), flush=True)
        else:
            print(_said(event), flush=True)
    return 0


def _events(args: argparse.Namespace, source: Iterator[bytes | None], simulator: Any) -> Iterator[dict[str, Any]]:
    from ...online.stream import Samples

    params = simulator.as_bench()
    samples = Samples(
        ("eps", "P", *_TARGETS), interval=args.interval, convert=lambda row: _one_muscle(row, args.muscle, params)
    )
    told, watcher, silence = 0, _Watcher(args, params, samples, params is simulator), _Silence()
    for line in source:
        if line is not None:
            for begins, table in samples.take(line):
                yield from watcher.take(begins, table)
            told = note_left_out(args, samples, told)
        yield from watcher.blind(silence.why(line, samples))
    for begins, table in samples.end():
        yield from watcher.take(begins, table)
    yield from watcher.finish()
    yield {
        "event": "end",
        "samples": watcher.count,
        "watched": watcher.watched * (samples.interval or 0.0),
        "findings": watcher.found,
        "problems": {k: v for k, v in samples.problems.items() if v},
    }
    if not watcher.watched:
        refuse_a_table(samples)
        raise StreamError(
            f"Nothing was watched: {watcher.why or silence.last(samples)}",
            f"more than {args.learn:g} s of samples with time, eps, P and F or mdot in SI",
            "Correct the stream, or learn for less time with --learn.",
        )


def _one_muscle(row: dict[str, Any], muscle: int, params: Any) -> dict[str, Any]:
    """Turn a sample of the bench into one of a muscle; one of a muscle stays as it is."""
    if "q" not in row:
        return row
    gain = (1 if muscle == 1 else -1) * params.joint.pulley_radius / params.muscle.rest_length
    eps = None if row["q"] is None else params.muscle.initial_contraction + gain * row["q"]
    return {"time": row["time"], "eps": eps, **{name: row.get(f"{name}{muscle}") for name in ("P", *_TARGETS)}}


class _Silence:
    """Report that no sample comes: nothing at all, or only invalid lines."""

    def __init__(self) -> None:
        self.since = time.monotonic()
        self.bad = 0
        self.malformed = 0

    def why(self, line: bytes | None, samples: Samples) -> str:
        """Return why no sample came with this line, if that has lasted."""
        malformed = samples.problems["malformed"] - self.malformed
        self.malformed = samples.problems["malformed"]
        if line is not None and line.strip():
            self.bad = self.bad + 1 if malformed else 0
            if not malformed:
                self.since = time.monotonic()
        if self.bad >= _MANY:
            return f"{self.bad} lines in a row are not samples; the last is {samples.last_problem}"
        waited = time.monotonic() - self.since
        return f"no sample has come for {waited:.0f} s." if waited > _PATIENCE else ""

    def last(self, samples: Samples) -> str:
        """Return why a stream that has ended could not be watched."""
        if samples.problems["malformed"] and samples.interval is None:
            return f"no line is a sample; the last is {samples.last_problem}."
        return "the stream ended during learning." if samples.interval else "hardly any samples came."


class _Watcher:
    """Learn, then watch, and say so while nothing can be seen."""

    def __init__(self, args: argparse.Namespace, params: Any, samples: Samples, bench: bool) -> None:
        self.args = args
        self.params = params
        self.bench = bench
        self.samples = samples
        self.healthy: list[dict[str, Any]] = []
        self.monitor: Any = None
        self.sight: Any = None
        self.why = ""
        self.silent = False
        self.time = float("nan")
        self.count = 0
        self.watched = 0
        self.found = 0
        self.last: dict[tuple[str, str], float] = {}
        self.confirmed: dict[str, dict[str, Any]] = {}

    def blind(self, why: str) -> Iterator[dict[str, Any]]:
        """Take whether no samples come."""
        if why and not self.why:
            self.silent = True
            yield from self._sees(why)
        elif not why and self.silent:
            self.silent = False
            yield from self._sees("")

    def take(self, begins: bool, table: dict[str, Any]) -> Iterator[dict[str, Any]]:
        """Take a block of samples."""
        from ...online.sight import Sight

        n = len(table["time"])
        self.count += n
        self.time = float(table["time"][-1])
        if self.sight is None:
            self.sight = Sight(_TARGETS, self.samples.interval or 1.0, self.params.gas.atmospheric_pressure)
        why = self.sight.look(table, self.monitor.stuck if self.monitor else None)
        yield from self._sees(why)
        if self.sight.why:  # what is no signal is neither learnt from nor watched
            self.healthy = []
            return
        if self.monitor is None:
            self.healthy.append(table)
            if self._learnt_enough():
                yield self._learn()
            return
        if begins:
            self.monitor.restart()
            yield {"event": "run", "time": float(table["time"][0])}
        before = set(self.monitor.stuck)
        findings = self.monitor.update(table)
        self.watched += 0 if why else n
        for channel, since in self.monitor.stuck.items():
            if channel not in before:
                yield {"event": "stuck", "channel": channel, "time": since}
        for finding in findings:
            which = finding.equation, finding.effect
            goes_on = finding.time - self.last.get(which, -math.inf) < _SAME
            self.last[which] = finding.time
            if goes_on:
                continue
            self.found += 1
            yield {"event": "finding", **vars(finding), **self._confirming(finding)}

    def _confirming(self, finding: Any) -> dict[str, Any]:
        """Return the run that would confirm a finding, designed when its effect is named first."""
        from ...effects import all_effects
        from ...gap.design.confirm import confirming

        name = finding.effect
        if self.bench and name not in self.confirmed and name in all_effects():
            linear = next((p.name for p in all_effects()[name].parameters if p.linear), "")
            run = confirming(name, self.params, {linear: finding.value}, seed=self.args.seed)
            self.confirmed[name] = {} if run is None else {"confirm": run.words, "run": run.as_dict()}
        return self.confirmed.get(name, {})

    def finish(self) -> Iterator[dict[str, Any]]:
        """Take the end of the stream."""
        from ...online.monitor import BLOCKS

        if self.monitor is None and sum(len(t["time"]) for t in self.healthy) >= BLOCKS * _BLOCK:
            yield self._learn()

    def _sees(self, why: str) -> Iterator[dict[str, Any]]:
        if bool(why) != bool(self.why):
            yield {"event": "blind" if why else "sees", "time": self.time, **({"why": why} if why else {})}
            if not why and self.monitor is not None:
                self.monitor.restart()
        self.why = why

    def _learnt_enough(self) -> bool:
        from ...online.monitor import BLOCKS

        n = sum(len(t["time"]) for t in self.healthy)
        return n * (self.samples.interval or 0.0) >= self.args.learn and n >= BLOCKS * _BLOCK

    def _learn(self) -> dict[str, Any]:
        import numpy as np

        from ...laws.quasi_static import QuasiStaticForce
        from ...laws.thermodynamic import ThermodynamicFlow
        from ...online import GapMonitor
        from ...online.monitor import HYPOTHESES

        m, g = self.params.muscle, self.params.gas
        whole = {name: np.concatenate([t[name] for t in self.healthy]) for name in self.healthy[0]}
        laws = [
            QuasiStaticForce(m.rest_length, g.atmospheric_pressure),
            ThermodynamicFlow(g.heat_capacity_ratio, g.gas_constant, g.temperature),
        ]
        measured = [law for law in laws if np.isfinite(whole[law.target]).mean() > 0.5]
        if not measured:
            raise IncompatibleError("The samples have neither F nor mdot.", "at least one of them", "Log it as well.")
        wanted = [e.strip() for e in self.args.effects.split(",")] if self.args.effects else list(HYPOTHESES)
        bend = np.abs(np.diff(whole["eps"], 2))
        noise = float(np.nanquantile(bend, 0.9) / 1.645 / 6.0**0.5)  # nine in ten samples of white noise stay below it
        self.monitor = GapMonitor(
            self._volume(),
            measured,
            self.params.plant(),
            wanted,
            dt=float(self.samples.interval or 0.0),
            block=_BLOCK,
            false_alarms_per_hour=self.args.false_alarms,
            play=3.0 * noise,
        ).calibrate(whole)
        self.healthy = []
        return {
            "event": "learnt",
            "time": float(whole["time"][-1]),
            "samples": len(whole["time"]),
            "noise": {w.law.equation: w.noise for w in self.monitor.watches},
            "scale": {w.law.equation: w.factor for w in self.monitor.watches},
        }

    def _volume(self) -> Any:
        if self.args.model:
            from ...persistence import load

            last = load(self.args.model)
            last = last_step(last)
            volume = getattr(last, "volume_", None)
            if volume is None:
                raise IncompatibleError(
                    f"{type(last).__name__} has no gas volume.", "a fitted hybrid model", "Fit StaticPIHM or JointPIHM."
                )
            return volume
        from ...volume import volume_class

        m = self.params.muscle
        return volume_class("chou_hannaford").from_geometry(m.rest_length, m.rest_diameter, m.braid_angle)


def _said(event: dict[str, Any]) -> str:
    kind = event["event"]
    if kind == "learnt":
        noise = ", ".join(f"{k} {v:.3g}" for k, v in event.get("noise", {}).items())
        told = f"noise of {noise} (N, kg/s)" if noise else event["headline"]
        return f"{event['time']:9.2f} s  learnt from {event['samples']} samples; {told}"
    if kind == "blind":
        return f"{_moment(event)}  blind because {event['why']}"
    if kind == "sees":
        return f"{_moment(event)}  sees again"
    if kind == "run":
        return f"{event['time']:9.2f} s  the stream restarts here; the calibration is kept"
    if kind == "stuck":
        return f"{event['time']:9.2f} s  the sensor of {event['channel']} is stuck; it is ignored until it moves again"
    if kind == "change":
        what = "; ".join(event["changes"]) or "no effect in the library explains it"
        return f"{event['time']:9.2f} s  {event['equation']} has changed: {what}"
    if kind == "finding":
        value = f", about {event['value']:.3g} {event['unit']}" if event["value"] == event["value"] else ""
        return (
            f"{event['time']:9.2f} s  {event['effect']} has appeared in the {event['equation']} equation{value} "
            f"(evidence {event['strength']:.1f} times its threshold)"
            + (f"; to confirm it, record {event['confirm']}" if "confirm" in event else "")
        )
    problems = ", ".join(f"{k} {v}" for k, v in event["problems"].items()) or "none"
    watched = f"watched: {event['watched']:.1f} s"
    return f"end: {event['samples']} samples, findings: {event['findings']}, {watched}, problems: {problems}"


def _moment(event: dict[str, Any]) -> str:
    return f"{event['time']:9.2f} s" if math.isfinite(event["time"]) else f"{'-':>9}  "
