"""What `pamid watch` makes of uneven, damaged and blind streams: it finds the leak, or says why it cannot.

Each stream is one step of a list, so that every run makes the same ones.
"""

from __future__ import annotations

import contextlib
import io
import json
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from pamid.bench import BenchParameters
from pamid.cli import main as pamid
from pamid.effects import Signals, make_effect
from pamid.laws.quasi_static import QuasiStaticForce
from pamid.laws.thermodynamic import ThermodynamicFlow
from pamid.signals.state import State
from pamid.volume import volume_class

BENCH = BenchParameters.for_muscle("B")
VOLUME = volume_class("chou_hannaford")(0.2, 0.02, BENCH.muscle.braid_angle)
LEARN, SINCE, END = 5.0, 7.0, 11.0
Rows = list[Any]
"""Samples as dictionaries, or lines as they are."""


def muscle(t: np.ndarray, leak: bool = True, seed: int = 0) -> Rows:
    """Samples of a muscle at work, with a leak since a moment."""
    rng = np.random.default_rng(seed)
    eps = 0.12 + 0.04 * np.sin(5.0 * t) + 0.02 * np.sin(8.3 * t + 1)
    deps = 0.2 * np.cos(5.0 * t) + 0.166 * np.cos(8.3 * t + 1)
    P, dP = 3e5 + 8e4 * np.sin(3.1 * t), 2.48e5 * np.cos(3.1 * t)
    state = State(eps, deps, P, dP)
    jet = VOLUME.jet(state)
    F, mdot = (law.predict(*jet, state) for law in (QuasiStaticForce(0.2), ThermodynamicFlow()))
    if leak:
        s = Signals(position=eps, velocity=deps, pressure=P, pressure_rate=dP)
        flow = make_effect("leakage", conductance=1e-10).flow(s, np.zeros((0,)), BENCH.plant())
        mdot = mdot + np.where(t >= SINCE, flow.a + flow.b * dP, 0.0)
    F, mdot = F + rng.normal(0, 0.1, len(t)), mdot + rng.normal(0, 3e-6, len(t))
    columns = {"time": t, "eps": eps, "P": P, "F": F, "mdot": mdot}
    return [dict(zip(columns, map(float, row), strict=True)) for row in zip(*columns.values(), strict=True)]


def even(rate: float = 1000.0) -> np.ndarray:
    """Return times in even steps."""
    return np.arange(int(END * rate)) / rate


def uneven(jitter: float, rate: float = 1000.0) -> np.ndarray:
    """Return times that are off by a share of a step."""
    t = even(rate)
    return t + np.random.default_rng(1).uniform(-jitter, jitter, len(t)) / rate


def lossy(share: float, rate: float = 1000.0) -> np.ndarray:
    """Return times of which a share is lost."""
    t = even(rate)
    return t[np.random.default_rng(2).uniform(size=len(t)) >= share]


def with_value(name: str, value: Any, *places: float) -> Rows:
    """Return samples of which some have another value."""
    rows = muscle(even())
    for at in places:
        rows[int(at * 1000)][name] = value
    return rows


def with_line(line: bytes, *places: float) -> Rows:
    """Return samples of which some are another line."""
    rows = muscle(even())
    for at in sorted(places, reverse=True):
        rows[int(at * 1000)] = line
    return rows


def scaled(name: str, factor: float, shift: float = 0.0, since: float = 0.0) -> Rows:
    """Return samples with a signal in another unit."""
    rows = muscle(even())
    for row in rows:
        if row["time"] >= since:
            row[name] = row[name] * factor + shift
    return rows


def without(*names: str, since: float = 0.0) -> Rows:
    """Return samples without some signals."""
    return [{k: v for k, v in row.items() if k not in names or row["time"] < since} for row in muscle(even())]


def swapped() -> Rows:
    """Return samples of which some neighbours are exchanged."""
    rows = muscle(even())
    for k in range(50, len(rows) - 1, 97):
        rows[k], rows[k + 1] = rows[k + 1], rows[k]
    return rows


def held(name: str, since: float) -> Rows:
    """Return samples of a signal that stands still."""
    rows = muscle(even())
    for row in rows[int(since * 1000) :]:
        row[name] = rows[int(since * 1000)][name]
    return rows


def shifted(by: float, since: float) -> Rows:
    """Return samples whose clock leaps."""
    rows = muscle(even())
    for row in rows[int(since * 1000) :]:
        row["time"] += by
    return rows


SEEN: dict[str, Callable[[], Rows]] = {
    **{f"at {rate} Hz": (lambda rate=rate: muscle(even(rate))) for rate in (250, 400, 500, 800, 1000, 2000)},
    **{f"times off by {j} of a step": (lambda j=j: muscle(uneven(j))) for j in (0.01, 0.1, 0.3, 0.45)},
    **{f"{share:.0%} lost": (lambda share=share: muscle(lossy(share))) for share in (0.02, 0.07, 0.2, 0.33)},
    "at 500 Hz with 7 % lost": lambda: muscle(lossy(0.07, 500.0)),
    "at 2 kHz with uneven times": lambda: muscle(uneven(0.3, 2000.0)),
    "every 50th sample gone": lambda: [r for k, r in enumerate(muscle(even())) if k % 50],
    **{
        f"a glitch of {name} at {at} s": (lambda name=name, value=value, at=at: with_value(name, value, at))
        for name, value in (("F", 1e6), ("mdot", -3.0), ("P", 9e7), ("eps", -40.0))
        for at in (2.5, 6.0)
    },
    "forces of 1e300": lambda: with_value("F", 1e300, 1.0, 2.0, 6.0),
    "nulls in F": lambda: with_value("F", None, *np.arange(0.5, 11.0, 0.05)),
    "nulls in P": lambda: with_value("P", None, *np.arange(0.5, 11.0, 0.05)),
    "a number of 400 digits": lambda: with_line(b'{"time": ' + b"9" * 400 + b"}", 1.0, 6.0),
    "a value of 400 digits": lambda: with_line(b'{"time": 1.0, "eps": ' + b"9" * 400 + b"}", 1.0, 6.0),
    "a number of 6,000 digits": lambda: with_line(b'{"time": ' + b"9" * 6000 + b"}", 1.0, 6.0),
    "200,000 brackets": lambda: with_line(b"[" * 200_000, 1.0, 6.0),
    "a bench's sample of brackets": lambda: with_line(b'{"q": ' + b"[" * 200_000, 1.0, 6.0),
    "a bench's sample of words": lambda: with_line(b'{"q": "now", "time": 3}', 1.0, 6.0),
    "null fields": lambda: with_line(b'{"time": null, "eps": null, "P": null}', 1.0, 6.0),
    "bytes": lambda: with_line(b"\xff\xfe\x00", 1.0, 6.0),
    "a line of 3 MB": lambda: with_line(b"x" * 3_000_000, 1.0, 6.0),
    "words for numbers": lambda: with_line(b'{"time": "now", "eps": true}', 1.0, 6.0),
    "infinities": lambda: with_line(b'{"time": Infinity, "P": NaN}', 1.0, 6.0),
    "empty lines": lambda: with_line(b"", 1.0, 2.0, 6.0),
    "another order": swapped,
    "each sample twice": lambda: [r for row in muscle(even()) for r in (row, row)],
    "a hole of a second": lambda: [r for r in muscle(even()) if not 3.0 < r["time"] < 4.0],
    "a clock that starts anew": lambda: shifted(-100.0, 3.0),
    "a clock of the epoch": lambda: shifted(1.7e9, 0.0),
    "one time that is far ahead": lambda: with_value("time", 1e9, 2.0),
    "the rate halves": lambda: [r for r in muscle(even()) if r["time"] < 6.0 or round(r["time"] * 1000) % 2 == 0],
    "no force": lambda: without("F"),
}
BLIND: dict[str, Callable[[], Rows]] = {
    "P in bar": lambda: scaled("P", 1e-5),
    "P in kPa": lambda: scaled("P", 1e-3),
    "P in MPa": lambda: scaled("P", 1e-6),
    "P above ambient": lambda: scaled("P", 1.0, -2.2e5),
    "eps in percent": lambda: scaled("eps", 100.0),
    "times in ms": lambda: scaled("time", 1000.0),
    "P in bar since 6 s": lambda: scaled("P", 1e-5, since=6.0),
    "no P": lambda: without("P"),
    "no eps": lambda: without("eps"),
    "no F and no mdot": lambda: without("F", "mdot"),
    "no P since 6 s": lambda: without("P", since=6.0),
    "P stands still": lambda: held("P", 6.0),
    "no sample at all": lambda: [b"{}"] * 2000,
    "nothing": list,
    "fewer samples than are learnt from": lambda: muscle(even()[:3000]),
}


def watched(rows: Rows, folder: Path) -> tuple[int, list[dict], str]:
    """Watch a stream from the command line; return the exit code, the events and what was said of errors."""
    data = [row if isinstance(row, bytes) else json.dumps(row).encode() for row in rows]
    (folder / "s.jsonl").write_bytes(b"".join(line + b"\n" for line in data))
    BENCH.to_toml(folder / "sim.toml")
    options = ["--sim", str(folder / "sim.toml"), "--learn", str(LEARN), "--json"]
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = pamid(["watch", str(folder / "s.jsonl"), *options])
    return code, [json.loads(line) for line in out.getvalue().splitlines()], err.getvalue()


def outcome(name: str, folder: Path) -> tuple[str, object]:
    """Watch a stream of the corpus; return "found", "told blind", or what is wrong, and what was said."""
    rows = {**SEEN, **BLIND}[name]()
    code, events, said = watched(rows, folder)
    if code not in (0, 2) or "inside pamid" in said:
        return "broken", said
    findings = [e for e in events if e["event"] == "finding"]
    blind = [e for e in events if e["event"] == "blind"]
    if name in BLIND:
        told = (blind and (code == 2 or blind[0]["time"] < 9.0)) or "Nothing was watched" in said
        return "told blind" if told and not findings else "silent", (events, said)
    last = next(r["time"] for r in reversed(rows) if isinstance(r, dict))
    right = code == 0 and [e["effect"] for e in findings] == ["leakage"] and not blind
    in_time = right and last - (END - SINCE) < findings[0]["time"] <= last
    return "found" if in_time else "silent", (events, said)


def main() -> None:
    """Print how many streams came to which end."""
    with tempfile.TemporaryDirectory() as folder:
        found = {name: outcome(name, Path(folder))[0] for name in (*SEEN, *BLIND)}
    counts = Counter(found.values())
    print(f"{len(found)} uneven, damaged or blind streams: " + ", ".join(f"{n} {k}" for k, n in counts.items()))


if __name__ == "__main__":
    main()
