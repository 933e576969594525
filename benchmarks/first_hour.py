"""A user's own simulator and raw log, by printed commands alone: twelve simulators, and the names of a hundred drivers.

``pamid init LOG --sim MODEL --yes`` is run, then each command that it prints, and each that those print, without an
edit. The names are tried with ``init`` alone. A signal is right if its column and its unit are; wrong ones are counted
as marked (``ASSUMED`` in the files) or unmarked.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
if __package__ in (None, ""):
    sys.path[0] = str(Path(__file__).resolve().parents[1])

from benchmarks._first_hour.cases import Case, cases
from benchmarks._first_hour.held_out import (
    FOURTH,
    FOURTH_PLANTS,
    PLANTS,
    SECOND,
    SECOND_PLANTS,
    THIRD,
    THIRD_PLANTS,
)
from benchmarks._first_hour.mapped import Mapped, judged, mapped, mapped_plant
from benchmarks._first_hour.names import Style
from benchmarks._first_hour.styles import OTHERS, STYLES
from benchmarks._first_hour.walk import signals, walk


def counted(title: str, found: Mapping[str, Mapped], every: bool) -> None:
    """Print how many signals are right, and what is not."""
    for name, m in found.items():
        wrong = (
            [("marked", t) for t in m.marked] + [("UNMARKED", t) for t in m.unmarked] + [("open", t) for t in m.missed]
        )
        for word, text in wrong if every else wrong[:1]:
            print(f"  {name}: {word}, {text}")
    right, marked, unmarked, missed = (
        sum(len(part) if isinstance(part, list) else part for part in column)
        for column in zip(*found.values(), strict=True)
    )
    whole = right + marked + unmarked + missed
    print(f"{title}: {right} of {whole} signals right ({right / whole:.1%}), {missed} without a column, "
          f"{marked} wrong and marked, {unmarked} wrong and unmarked", flush=True)  # fmt: skip


def tried(styles: Mapping[str, Style]) -> dict[str, Mapped]:
    """Return what ``init`` makes of each style of names."""
    return {name: mapped(style) for name, style in styles.items()}


def walked(case: Case, limit: float) -> tuple[bool, Mapped]:
    """Walk one case, print a line and return whether it ran, and its signals."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        case.write(folder)
        found = judged(signals(case, folder), case.truth)
        done = walk(case, folder, limit)
    errors = ", ".join(
        f"{k} {b:.3g} -> {done.after[k]:.3g}"
        for k, b in done.before.items()
        if k in done.after and done.after[k] < 0.9 * b
    )
    print(f"{case.name}: {'ran' if done.ran else 'FAILED'}, {len(done.commands)} commands, {done.cpu:.0f} s; "
          f"{done.verdict or done.failed}; {errors}", flush=True)  # fmt: skip
    if done.failed:
        print(f"  {done.failed}", flush=True)
    return done.ran, found


def main(argv: list[str] | None = None) -> int:
    """Run the walks; return 0 when all commands ran and nothing is wrong unmarked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", metavar="TEXT", help="only cases whose name holds this")
    parser.add_argument(
        "--names", nargs="?", const="", metavar="TEXT", help="the names alone, of sets whose title holds this"
    )
    parser.add_argument("--limit", type=float, default=900.0, metavar="S", help="seconds for one command")
    parser.add_argument("--every", action="store_true", help="print every signal that is not right")
    args = parser.parse_args(argv)
    unmarked, ran = 0, True
    if not args.only:
        none: dict[str, dict[str, tuple[str, float]]] = {}
        for title, styles, plants in (
            ("names of drivers", STYLES, none), ("names tried once, first", OTHERS, none),
            ("second", SECOND, SECOND_PLANTS), ("third", THIRD, THIRD_PLANTS), ("fourth", FOURTH, FOURTH_PLANTS),
        ):  # fmt: skip
            if args.names is None or args.names in title:
                found = tried(styles) | {name: mapped_plant(PLANTS[name], c) for name, c in plants.items()}
                unmarked += sum(len(m.unmarked) for m in found.values())
                counted(title, found, args.every)
    if args.names is None:
        chosen = [c for c in cases() if not args.only or args.only in c.name]
        results = {c.name: walked(c, args.limit) for c in chosen}
        counted("simulators", {name: m for name, (_, m) in results.items()}, args.every)
        unmarked += sum(len(m.unmarked) for _, m in results.values())
        print(f"simulators: {sum(r for r, _ in results.values())} of {len(results)} ran")
        ran = all(r for r, _ in results.values())
    return int(unmarked > 0 or not ran)


if __name__ == "__main__":
    raise SystemExit(main())
