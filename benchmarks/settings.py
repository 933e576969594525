"""Sensitivity of the diagnosis to its thresholds: each is halved and doubled, on development cases.

For every number of `pamid.gap.settings` the same cases are diagnosed again, and the share that is answered right is
printed beside that of the numbers as they are, with the cases that the change wins and loses. Run with ``python
benchmarks/settings.py``; ``--number NAME`` takes one of them, ``--cases N`` more cases, and ``--out FILE`` keeps each
answer, so that an interrupted run goes on where it was. A number whose change does nothing could go; one that gains by
a change is wrong. What trust in names rests on was fitted to the numbers as they are, and is not fitted anew.
``--computed`` prints instead what numbers that stand beside a computation do to it, which takes minutes.
"""

from __future__ import annotations

import argparse
import json
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

from benchmarks import _computed
from benchmarks.withheld import judge, metrics, suites
from benchmarks.withheld.generator import Case, generate
from pamid.gap import settings

SEED = 9001
SHARES = {"none": 0.15, "single": 0.35, "pairs": 0.25, "off-library": 0.25}
OF_LONG_LOGS = ("MAX_ROWS", "SEARCH_ROWS")
"""Numbers that these cases are too short for: ``benchmarks/diagnosis_time.py`` shows what they are worth."""
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
    new = {key: (getattr(settings, key), value) for key, value in space.items() if key.isupper()}
    new = {key: (was, now) for key, (was, now) in new.items() if was != now}
    with ExitStack() as stack:
        for module in [m for k, m in list(sys.modules.items()) if k.startswith("pamid.gap")]:
            for key, (was, now) in new.items():
                if key in vars(module) and vars(module)[key] == was:
                    stack.enter_context(mock.patch.object(module, key, now))
        yield


def answered(case: Case) -> bool:
    """Return whether a case is answered right; of two effects both must be named."""
    from pamid.effects.registry import chosen_effects
    from pamid.gap import diagnose

    library = [name for name in chosen_effects("all", "bench") if name not in case.spec.left_out]
    try:
        said = diagnose(case.log, judge.simulator(case.sim_toml), library, seed=case.spec.index).as_dict()
    except Exception as error:  # a number that breaks the diagnosis is worth knowing, too
        print(f"{case.spec.name}: {type(error).__name__}: {error}", file=sys.stderr)
        return False
    true = judge.truth(case.key)
    answer = judge.answer(said, true, {}, None, None, None, 0.0)
    if len(true.effects) > 1:
        return set(true.effects) <= {name for cause in answer.causes for name in cause}
    return metrics.correct(true, answer)


class Answers:
    """Which cases are answered right under which numbers, kept in a file as they come.

    Parameters
    ----------
    cases : sequence of Case
        The cases.
    file : Path or None
        Where answers are kept, a JSON object a line.
    """

    def __init__(self, cases: Sequence[Case], file: Path | None) -> None:
        self.cases, self.file = cases, file
        self.known: dict[tuple[str, float, str], bool] = {}
        if file is not None and file.exists():
            for line in file.read_text(encoding="utf-8").splitlines():
                row = json.loads(line)
                self.known[row["number"], row["factor"], row["case"]] = row["right"]

    def of(self, number: str, factor: float) -> list[bool]:
        """Return whether each case is answered right with a number times a factor."""
        with changed(number, factor) if number else ExitStack():
            return [self._one(number, factor, case) for case in self.cases]

    def _one(self, number: str, factor: float, case: Case) -> bool:
        key = (number, factor, case.spec.name)
        if key not in self.known:
            self.known[key] = answered(case)
            if self.file is not None:
                row = {"number": number, "factor": factor, "case": case.spec.name, "right": self.known[key]}
                with self.file.open("a", encoding="utf-8") as out:
                    out.write(json.dumps(row) + "\n")
        return self.known[key]


def _compared(now: Sequence[bool], usual: Sequence[bool]) -> str:
    won = sum(a and not b for a, b in zip(now, usual, strict=True))
    lost = sum(b and not a for a, b in zip(now, usual, strict=True))
    return f"{sum(now) / len(now):6.1%} (+{won} -{lost})"


def main() -> None:
    """Print a line for each number."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--number", action="append", choices=sorted(numbers()), help="only this one; may be repeated")
    parser.add_argument("--cases", type=int, default=24, help="about so many cases")
    parser.add_argument("--out", type=Path, help="file that keeps the answers")
    parser.add_argument("--computed", action="store_true", help="numbers that stand beside a computation instead")
    args = parser.parse_args()
    if args.computed:
        for line in _computed.table():
            print(line, flush=True)
        return
    counts = {suite: max(1, round(share * args.cases)) for suite, share in SHARES.items()}
    cases = [case for batch in suites.batches(counts, SEED) for case in generate(batch.specs, batch.layout)]
    answers = Answers(cases, args.out)
    usual = answers.of("", 1.0)
    print(f"{len(usual)} cases, {sum(usual) / len(usual):.1%} right as the numbers are\n")
    print(f"{'number':16s} {'value':>9s} {'halved':>16s} {'doubled':>16s}")
    for name in args.number or [n for n in numbers() if n not in OF_LONG_LOGS]:
        halved, doubled = (_compared(answers.of(name, factor), usual) for factor in (0.5, 2.0))
        print(f"{name:16s} {numbers()[name]:9g} {halved:>16s} {doubled:>16s}", flush=True)


if __name__ == "__main__":
    main()
