"""``pamid watch``: follow samples as they come and name what appears."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from typing import Any

from ...errors import IncompatibleError, ParameterError
from ..common import add_command, finite, load_simulator, note

_DESCRIPTION = """\
Follow a muscle while it works: samples come as JSON lines from a growing file or a pipe, one object a line with time
(s), eps (-), P (Pa, absolute) and what is measured of F (N) and mdot (kg/s). A bench's samples with q, P1, P2, F1, F2,
mdot1 and mdot2 are watched muscle by muscle (--muscle).

The first seconds (--learn) must be healthy: the monitor learns from them how large its evidence is by itself. From
then on it names what appears, a leak, friction, hysteresis, at the rate of false alarms that you allow. Late samples,
gaps, missing values, malformed lines and a restarted stream are counted and survived.

Output is one line an event, with --json one object a line.
"""
_EXAMPLES = """\
  pamid watch samples.jsonl --sim sim.toml --learn 30
  logger | pamid watch - --sim sim.toml --false-alarms 0.1 --json
  pamid watch samples.jsonl --follow --sim sim.toml --model joint.pamid
"""


def add_parser(subparsers: Any) -> None:
    """Add the command."""
    parser = add_command(
        subparsers, "watch", "follow a stream of samples and name what appears", _DESCRIPTION, _EXAMPLES
    )
    parser.add_argument("stream", metavar="STREAM", help="file of JSON lines, or - for a pipe")
    parser.add_argument("--sim", metavar="SIM.toml", required=True, help="simulator file of the bench")
    parser.add_argument("--model", metavar="MODEL", help="fitted hybrid model whose volume is the healthy one")
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
        "--false-alarms", type=float, default=1.0, metavar="N", help="false alarms allowed an hour (default: 1)"
    )
    parser.add_argument("--interval", type=float, default=1e-3, metavar="S", help="sampling interval (default: 0.001)")
    parser.add_argument("--follow", action="store_true", help="wait for more at the end of the file")
    parser.add_argument("--patience", type=float, metavar="S", help="stop following after this long without news")


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from ...online.stream import lines, pipe_lines

    if not (args.learn > 0 and args.interval > 0 and args.false_alarms > 0):
        raise ParameterError("--learn, --interval or --false-alarms is not positive.", "numbers above 0", "Correct it.")
    if args.stream == "-":
        source = pipe_lines(sys.stdin.buffer)
    else:
        source = lines(args.stream, follow=args.follow, patience=args.patience)
    for event in _events(args, source):
        if args.json:
            print(json.dumps(finite(event), allow_nan=False), flush=True)
        else:
            print(_said(event), flush=True)
    return 0


def _events(args: argparse.Namespace, source: Iterator[bytes]) -> Iterator[dict[str, Any]]:
    from ...online.stream import Samples

    params = load_simulator(args.sim)
    samples = Samples(("eps", "P", "F", "mdot"), interval=args.interval)
    told, watcher = 0, _Watcher(args, params)
    for line in source:
        for begins, table in samples.take(_one_muscle(line, args.muscle, params)):
            yield from watcher.take(begins, table)
        if samples.problems["malformed"] > told:
            told = samples.problems["malformed"]
            if told <= 3:
                note(args, f"warning: line left out, {samples.last_problem}")
    for begins, table in samples.end():
        yield from watcher.take(begins, table)
    yield from watcher.finish()
    yield {
        "event": "end",
        "samples": watcher.count,
        "findings": watcher.found,
        "problems": {k: v for k, v in samples.problems.items() if v},
    }


def _one_muscle(line: bytes, muscle: int, params: Any) -> bytes:
    """Turn a sample of the bench into one of a muscle; anything else stays as it is."""
    if b'"q"' not in line:
        return line
    try:
        row = json.loads(line)
        gain = (1 if muscle == 1 else -1) * params.joint.pulley_radius / params.muscle.rest_length
        eps = None if row["q"] is None else params.muscle.initial_contraction + gain * row["q"]
        kept = {name: row.get(f"{name}{muscle}") for name in ("P", "F", "mdot")}
        return json.dumps({"time": row["time"], "eps": eps, **kept}).encode()
    except (ValueError, KeyError, TypeError):
        return line  # it is told as malformed where it is parsed


class _Watcher:
    """Learn, then watch."""

    def __init__(self, args: argparse.Namespace, params: Any) -> None:
        self.args = args
        self.params = params
        self.healthy: list[dict[str, Any]] = []
        self.monitor: Any = None
        self.count = 0
        self.found = 0
        self.last: tuple[str, float] = ("", -1e9)

    def take(self, begins: bool, table: dict[str, Any]) -> Iterator[dict[str, Any]]:
        n = len(table["time"])
        self.count += n
        if self.monitor is None:
            self.healthy.append(table)
            if sum(len(t["time"]) for t in self.healthy) * self.args.interval >= self.args.learn:
                yield self._learn()
            return
        if begins:
            self.monitor.restart()
            yield {"event": "run", "time": float(table["time"][0])}
        before = set(self.monitor.stuck)
        findings = self.monitor.update(table)
        for channel, since in self.monitor.stuck.items():
            if channel not in before:
                yield {"event": "stuck", "channel": channel, "time": since}
        for finding in findings:
            name, since = self.last
            if finding.effect == name and finding.time - since < 10.0:
                self.last = (name, finding.time)
                continue  # the same goes on
            self.last = (finding.effect, finding.time)
            self.found += 1
            yield {"event": "finding", **vars(finding)}

    def finish(self) -> Iterator[dict[str, Any]]:
        if self.monitor is None and self.healthy:
            yield self._learn()

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
        noise = float(np.nanstd(np.diff(whole["eps"], 2)) / 6.0**0.5)
        self.monitor = GapMonitor(
            self._volume(),
            measured,
            self.params.plant(),
            wanted,
            dt=self.args.interval,
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
            last = last.steps[-1][1] if hasattr(last, "steps") else last
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
        noise = ", ".join(f"{k} {v:.3g}" for k, v in event["noise"].items())
        return f"{event['time']:9.2f} s  learnt from {event['samples']} samples; noise of {noise} (N, kg/s)"
    if kind == "run":
        return f"{event['time']:9.2f} s  the stream begins anew here; the calibration stays"
    if kind == "stuck":
        return f"{event['time']:9.2f} s  the sensor of {event['channel']} stands still; it is left out until it moves"
    if kind == "finding":
        value = f", about {event['value']:.3g} {event['unit']}" if event["value"] == event["value"] else ""
        return (
            f"{event['time']:9.2f} s  {event['effect']} has appeared in the {event['equation']} equation{value} "
            f"(evidence {event['strength']:.1f} times its threshold)"
        )
    problems = ", ".join(f"{k} {v}" for k, v in event["problems"].items()) or "none"
    return f"end: {event['samples']} samples, findings: {event['findings']}, problems: {problems}"
