"""What pages say pamid cannot do, does only, or does up to a limit: each sentence is written from the code."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
if not (ROOT / "docs").is_dir():
    pytest.skip("needs the repository", allow_module_level=True)
WORDS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
PARTS = {2: "half", 3: "third", 4: "quarter"}


def page(name: str) -> str:
    """The text of a page, its lines joined."""
    return " ".join((ROOT / name).read_text(encoding="utf-8").split())


def diagnosis() -> Iterator[tuple[str, str]]:
    """What is said of limits of the diagnosis."""
    from pamid.equations import all_equations
    from pamid.equations.windows import WINDOW
    from pamid.gap.diagnosis.agreement import STRETCHES
    from pamid.gap.settings import INCLUDED, MOST_CAUSES, OF_ITS_OWN
    from pamid.gap.several.alike import FACTOR
    from pamid.gap.several.per_log import STRETCH
    from pamid.gap.several.variants import MOST_DAYS
    from pamid.survey.separation import ALIKE, SEEN

    statistics = "docs/theory-diagnosis.md"
    yield statistics, f"(of {1000 * WINDOW:g} ms on the bench)"
    yield "docs/theory-laws.md", f"over windows of {1000 * WINDOW:g} ms"
    yield "docs/command-line.md", f"over windows ({1000 * WINDOW:g} ms on the bench)"
    yield statistics, f"sets grow to {WORDS[MOST_CAUSES]} effects"
    yield statistics, f"must be at least {100 * OF_ITS_OWN:g} % as large as the other effects in its set together"
    yield statistics, f"jackknife over {WORDS[STRETCHES]} stretches of equal information"
    yield statistics, f"errors clustered by stretches of {STRETCH:g} s"
    yield statistics, f"at most one cause in {'twenty' if INCLUDED == 0.95 else '?'} above it is wrong"
    yield "docs/diagnosis.md", f"With more than {WORDS[MOST_DAYS]} days this is tested for named causes only."
    ratio = "the ratio of measured to modelled values differs between logs"
    yield "docs/diagnosis.md", f"{ratio} by more than a factor of {FACTOR:g}."
    yield (
        "docs/command-line.md",
        f"explains the other to within {100 * ALIKE:g} % or "
        f"{WORDS[round(SEEN)]} standard deviations of the noise, whichever is larger",
    )
    alone = [f"`{name}`" for name, equation in all_equations().items() if not equation.combines]
    joined = [f"`{name}`" for name, equation in all_equations().items() if equation.combines]
    yield "docs/command-line.md", f"`equations` holds {', '.join(alone[:-1])} and {alone[-1]}"
    yield "docs/command-line.md", f"{' and '.join(joined)} each combine two of them"


def streams() -> Iterator[tuple[str, str]]:
    """What is said of limits of streams and of `partial_fit`."""
    from pamid.estimators import GapDiagnoser
    from pamid.estimators._streaming import MEMORY_ROWS, MEMORY_ROWS_IN_ORDER

    from pamid.online import ChangeMonitor
    from pamid.online.change import BLOCKS, evidence
    from pamid.online.lines import LONGEST_LINE
    from pamid.online.recursive import GATE

    streaming = "docs/streaming.md"
    yield streaming, f"| a fit to all rows, if at most {MEMORY_ROWS:,} are distinct; otherwise to a random sample"
    yield streaming, f"| a fit to all runs, if they have at most {MEMORY_ROWS_IN_ORDER:,} rows; otherwise"
    yield streaming, f"the diagnosis of all logs so far, up to {GapDiagnoser._memory_rows:,} rows"
    yield streaming, f"a sample {WORDS[round(GATE)]} standard deviations off is skipped"
    defaults = {name: p.default for name, p in inspect.signature(ChangeMonitor.__init__).parameters.items()}
    yield streaming, f"one in {'a hundred' if defaults['false_alarms'] == 0.01 else '?'} streams of ten minutes"
    assert defaults["per"] == 600.0
    yield streaming, f"grow by less than {'a quarter' if defaults['growth'] == 1.25 else '?'} are not a change"
    assert f"adds at most {evidence(1 / (BLOCKS + 1)):.1f} to" in str(ChangeMonitor.__doc__)
    yield streaming, f"each {'a sixtieth' if BLOCKS == 60 else '?'} of the healthy data"
    yield "docs/security.md", f"`watch` keeps at most {LONGEST_LINE / 2**20:g} MiB of a line"


def files() -> Iterator[tuple[str, str]]:
    """What is said of limits of files, and of what code may do."""
    from pamid import _model_archive, _model_checks, _model_fit, _model_types
    from pamid.equations import evaluate
    from pamid.opinion import fits
    from pamid.signals import readings
    from pamid.simulators import fmu_model, mujoco_loading

    security = "docs/security.md"
    yield (
        security,
        f"| memory for loading | {_model_archive.MAX_BYTES / 2**20:g} MiB; "
        f"the file may unpack to a {PARTS[_model_archive.COPIES]} of that |",
    )
    yield security, f"| JSON schema | {_model_archive.MAX_JSON_BYTES[_model_archive.SCHEMA] / 2**20:g} MiB |"
    yield security, f"| entries | {_model_archive.MAX_ENTRIES:,} |"
    yield security, f"| depth of objects | {_model_types.MAX_DEPTH} |"
    yield security, f"| features, terms | {_model_fit.MOST_FEATURES:,} |"
    yield security, f"| `n_jobs` in a file | {_model_checks.MOST_JOBS} |"
    limits = f"{mujoco_loading.SECONDS} s, {mujoco_loading.MEMORY / 2**30:g} GiB"
    yield security, f"is loaded in a separate process first ({limits})"
    yield security, f"own process: {fmu_model.SECONDS:g} s per simulated run, {fmu_model.BYTES / 2**30:g} GiB"
    refused = re.findall(r'"(\.\w+)"', inspect.getsource(fits))
    assert {".pt", ".pkl"} <= set(refused)
    yield "docs/simulators.md", "code (`.pt`, `.pkl`) are refused"
    yield "docs/logs.md", f"anything beyond {readings.BEYOND:.0e}".replace("e+", "e")
    yield "docs/logs.md", f"jump {readings._OF_JUMPS:g} times as far as others do"
    yield "docs/logs.md", f"or glitches exceed {100 * readings._MOST_GLITCHES:g} % of rows"
    yield "docs/logs.md", f"up to {WORDS[evaluate._WORST]} windows that cause most of an equation's error"
    sys.path.append(str(ROOT / "tests" / "signals"))
    from raw_logs import RAW_LOGS

    yield "docs/logs.md", f"[{len(RAW_LOGS)} logs](../tests/signals/raw_logs.md)"


def models() -> Iterator[tuple[str, str]]:
    """What is said of models: which are exported, how many parameters the published network has."""
    from pamid.estimators import ThermodynamicPIHM, all_estimators

    hidden = inspect.signature(ThermodynamicPIHM).parameters["hidden_layer_sizes"].default
    sizes = [4, *hidden, 1]
    each = [(a + 1) * b for a, b in pairwise(sizes)]
    total = f"{' + '.join(f'{n:,}' for n in each)} = {sum(each):,} parameters"
    yield "docs/theory-hybrid.md", f"is {'–'.join(map(str, sizes))} with softplus, {total}"
    (said,) = re.findall(r"\*\*Formulas\.\*\*(.*?)\. `NAME_signals`", page("docs/export.md"))
    assert set(re.findall(r"`(\w+)`", said)) == {name for name, cls in all_estimators() if hasattr(cls, "formulas")}


def counts() -> Iterator[tuple[str, str]]:
    """Parts of counts that pages give add up, on the page and where another repeats them."""
    from pamid.systems.comparison import _models

    known = len(_models(("speed", "nominal"), 0.0, 0))
    yield "pamid/cli/commands/compare.py", f"For a cylinder or a joint, {WORDS[known]} models are compared:"
    text = page("docs/withheld.md")
    ((total, parts),) = re.findall(r"([\d,]+) cases, unseen before, [^:]*: (.*?\(\*confusable\*\))", text)
    words = ("without a gap", "with one effect", "with two", "with a cause that the library lacks", "with one of two")
    kinds = ("none", "single", "pairs", "off-library", "confusable")
    each = {kind: int(re.findall(rf"(\d+) {word}\b", parts)[0]) for kind, word in zip(kinds, words, strict=True)}
    assert sum(each.values()) == int(total.replace(",", ""))
    yield "docs/withheld.md", f"| false alarms with no gap | ≤ 1 % | {each['none']} |"
    yield "docs/withheld.md", f"| an off-library effect given a library name | ≤ 5 % | {each['off-library']} |"
    yield "docs/withheld.md", f"| two effects: both | ≥ 90 % | {each['pairs']} |"
    yield "README.md", f"On {total} logs of simulated pneumatic benches"
    yield "README.md", f"| false alarms on {each['none']} logs without a gap |"


@pytest.mark.parametrize("claims", [diagnosis, streams, files, models, counts], ids=lambda f: f.__name__)
def test_pages_say_what_the_code_does(claims) -> None:
    said = list(claims())
    assert said
    wrong = [f"{name} does not say: {text}" for name, text in said if text not in page(name)]
    assert not wrong, "\n".join(wrong)


def test_security_says_what_each_kind_of_simulator_may_do() -> None:
    from pamid.simulators import FunctionSimulator
    from pamid.simulators.page import simulator_kinds
    from pamid.systems.registry import all_systems

    words = {"control": "python-control", "fmu": "FMU", "mujoco": "MuJoCo"}
    words |= dict.fromkeys(FunctionSimulator.kinds, "function")
    runs = {"bench": False, **dict.fromkeys(all_systems(), False)}
    runs |= {words.get(kind, kind): cls.executes for kind, cls in simulator_kinds().items()}
    text = (ROOT / "docs" / "security.md").read_text(encoding="utf-8")
    table = text.partition("\n## What each kind of simulator may do\n")[2].partition("\n## ")[0]
    rows = [[cell.strip() for cell in line.split("|")[1:3]] for line in table.splitlines() if line.startswith("| ")]
    said = {kind: told for kinds, told in rows for kind in kinds.split(", ") if kind not in ("kind", "---")}
    assert said.keys() == runs.keys()
    # Without trust, what is data is fully usable, and what is code does not run.
    assert {kind: not told.startswith("fully usable") for kind, told in said.items()} == runs


def test_no_pickle_is_read_or_written() -> None:
    assert "Pickles are never read or written." in page("docs/security.md")
    loads = re.compile(
        r"^\s*(?:import|from) (?:pickle|cloudpickle|dill|marshal|shelve)\b|joblib\.(?:load|dump)\b", re.M
    )
    rooms = [file for room in ("pamid", "estimators") for file in (ROOT / room).rglob("*.py")]
    assert len(rooms) > 300
    assert [file.name for file in rooms if loads.search(file.read_text(encoding="utf-8"))] == []


def test_a_claim_that_no_longer_holds_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pamid.gap.several.variants.MOST_DAYS", 7)
    assert ("docs/diagnosis.md", "With more than seven days this is tested for named causes only.") in list(diagnosis())
    with pytest.raises(AssertionError, match="seven days"):
        test_pages_say_what_the_code_does(diagnosis)
