"""The table of the check on any simulator."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

METHODS = ("pamid", "parameter fit", "boosted trees")
Record = dict[str, Any]


def load(folder: Path, names: Iterable[str]) -> list[Record]:
    """Return the results that are there."""
    paths = [folder / f"{n}.json" for n in names]
    return [json.loads(p.read_text(encoding="utf-8")) for p in paths if p.is_file()]


def wilson(hits: int, n: int, z: float = 1.96) -> tuple[float, float]:
    """Return the 95 % interval of a share."""
    if n == 0:
        return 0.0, 1.0
    p = hits / n
    centre, half = (p + z * z / (2 * n)), z * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return max(0.0, (centre - half) / (1 + z * z / n)), min(1.0, (centre + half) / (1 + z * z / n))


def _share(flags: list[bool]) -> str:
    if not flags:
        return "–"
    low, high = wilson(sum(flags), len(flags))
    return f"{sum(flags)} of {len(flags)} ({100 * low:.0f} to {100 * high:.0f} %)"


def _median(values: list[float]) -> str:
    return f"{100 * float(np.median(values)):.0f} % (n = {len(values)})" if values else "–"


def _same_port(said: str, key: Record) -> bool:
    """Return whether a port is the true one; a signal of a joint counts as its joint."""
    alike = {"rod": ("s", "v"), "rail": ("x", "v"), "hinge": ("angle", "omega", "hinge_q", "hinge_dq"),
             "chamber1": ("p1", "w1"), "chamber2": ("p2", "w2")}  # fmt: skip
    return said == key["port"] or said in alike.get(key["port"], ())


def _plainly(said: Record) -> bool:
    """Return whether a cause was named without reservations."""
    return bool(said["named"] and not said.get("reserved"))


def figures(records: list[Record], method: str) -> dict[str, str]:
    """Return the figures of one method."""
    mine = [(r["key"], r[method]) for r in records if method in r]
    single = [(k, s) for k, s in mine if k["suite"] == "single" and k["detectable"]]
    decidable = [(k, s) for k, s in single if k["decidable"]]
    none = [(k, s) for k, s in mine if k["suite"] == "none"]
    foreign = [(k, s) for k, s in mine if k["suite"] == "foreign" and k["detectable"]]
    gap: Callable[[Record], bool] = lambda s: bool(s.get("gap", s["named"]))  # noqa: E731
    learner = method == "boosted trees"
    return {
        "right effect first, decidable": "–" if learner else _share([s["effect"] == k["effect"] for k, s in decidable]),
        "right effect first, all": "–" if learner else _share([s["effect"] == k["effect"] for k, s in single]),
        "right port first, decidable": _share([_same_port(s["port"], k) for k, s in decidable]),
        "false alarms": _share([gap(s) for _, s in none]),
        "gap seen, detectable": _share([gap(s) for _, s in single]),
        "foreign causes named": "–" if learner else _share([s["named"] for _, s in foreign]),
        "foreign causes named without reservations": "–" if learner else _share([_plainly(s) for _, s in foreign]),
        "decidable, with reservations": "–" if learner else _share([bool(s.get("reserved")) for _, s in decidable]),
        "closed on unseen runs, median, decidable": _median(
            [max(s["closed"], -1.0) for k, s in decidable if s["closed"] is not None]
        ),
    }  # fmt: skip


def table(records: list[Record]) -> str:
    """Return the table of all methods as text."""
    columns = {m: figures(records, m) for m in METHODS}
    lines = ["| | " + " | ".join(METHODS) + " |", "| --- " * (len(METHODS) + 1) + "|"]
    lines += [f"| {row} | " + " | ".join(columns[m][row] for m in METHODS) + " |" for row in columns["pamid"]]
    return "\n".join(lines)


def wrong(records: list[Record]) -> str:
    """Return what pamid got wrong, one line a case."""
    lines = []
    for r in records:
        k, s = r["key"], r["pamid"]
        right = {
            "none": not s["gap"],
            "foreign": not s["named"],
            "single": (s["effect"], s["port"]) == (k["effect"], k["port"]),
        }[k["suite"]]  # fmt: skip
        if not right and (k["suite"] == "none" or k["detectable"]):
            said = "; ".join(
                "/".join(f"{e}@{w}" for e, w in zip(c["effects"], c["where"], strict=True)) for c in s["causes"]
            )
            lines.append(
                f"{k['suite']:8s} {k['plant']:8s} {k['effect']}@{k['port']} {k['nats']:.3g} nats, "
                f"margin {k['margin']:.3g} "
                f"({k['rival']}){'' if k['decidable'] else ' open'} -> "
                f"{s['verdict']} {s['effect']}@{s['port']} [{said}]"
            )
    return "\n".join(sorted(lines))
