"""What each number that the diagnosis decides by is worth: halved and doubled, on the development cases.

For every number of `pamid.gap.settings` the same cases are diagnosed again, and the share of right answers is printed
beside that of the numbers as they are. Run with ``python benchmarks/settings.py``; ``--number NAME`` takes one of
them, ``--cases N`` more cases. A number whose change does nothing could go; one that gains by a change is wrong.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from unittest import mock

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.withheld import metrics, runner, suites
from benchmarks.withheld.generator import Case, generate
from pamid.gap import settings

SEED = 9001
SHARES = {"none": 0.2, "single": 0.5, "pairs": 0.1, "off-library": 0.2}
_NUMBER = re.compile(r"^([A-Z_]+(?:, [A-Z_]+)*) = ([-\d._]+(?:, [-\d._]+)*)$", re.MULTILINE)


def numbers() -> dict[str, float]:
    """Return the numbers that stand in the settings as such, by name."""
    text = Path(settings.__file__).read_text(encoding="utf-8")
    found = {}
    for names, values in _NUMBER.findall(text):
        found |= {n: float(v.replace("_", "")) for n, v in zip(names.split(", "), values.split(", "), strict=True)}
    return found


@contextmanager
def changed(name: str, factor: float) -> Iterator[None]:
    """Change a number, and what follows from it, wherever the diagnosis has read it."""
    text = Path(settings.__file__).read_text(encoding="utf-8")
    whole = float(numbers()[name]).is_integer() and "." not in str(getattr(settings, name))
    value = getattr(settings, name) * factor
    space: dict[str, object] = {"__name__": "changed"}
    exec(
        compile(
            text.replace("# --- what follows", f"{name} = {round(value) if whole else value!r}\n# --- what follows"),
            "settings",
            "exec",
        ),
        space,
    )
    with ExitStack() as stack:
        for module in [m for k, m in list(sys.modules.items()) if k.startswith("pamid.gap")]:
            for key, new in space.items():
                if (
                    key.isupper()
                    and vars(module).get(key) == getattr(settings, key, None) != new
                    and key in vars(module)
                ):
                    stack.enter_context(mock.patch.object(module, key, new))
        yield


def right(cases: Sequence[Case]) -> float:
    """Return the share of cases that are answered right."""
    hits = []
    for case in cases:
        found = runner.examine(case, runner.ours, rivals=False)
        [(truth, answer)] = runner.records([found], "ours")
        hits.append(metrics.correct(truth, answer) if answer.confidence else False)
    return sum(hits) / len(hits)


def main() -> None:
    """Print a line for each number."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--number", action="append", choices=sorted(numbers()), help="only this one; may be repeated")
    parser.add_argument("--cases", type=int, default=40, help="about so many cases")
    args = parser.parse_args()
    counts = {suite: max(1, round(share * args.cases)) for suite, share in SHARES.items()}
    cases = [c for batch in suites.batches(counts, SEED) for c in generate(batch.specs, batch.layout)]
    print(f"{len(cases)} cases, {right(cases):.1%} right as they are\n")
    print(f"{'number':16s} {'value':>9s} {'halved':>8s} {'doubled':>8s}")
    for name in args.number or numbers():
        shares = []
        for factor in (0.5, 2.0):
            with changed(name, factor):
                shares.append(right(cases))
        print(f"{name:16s} {numbers()[name]:9g} {shares[0]:8.1%} {shares[1]:8.1%}", flush=True)


if __name__ == "__main__":
    main()
