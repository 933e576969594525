"""What README and docs say is true: their Python runs, their commands run, their tables follow from the code."""

from __future__ import annotations

import ast
import importlib.util
import inspect
import json
import math
import re
import shutil
import subprocess
import tomllib
import warnings
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import pytest
from threadpoolctl import threadpool_limits

from pamid.bench.parameters import BenchParameters
from pamid.cli import main
from pamid.errors import PamidWarning
from pamid.signals import LogMapping
from pamid.systems import read_system

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
if not DOCS.is_dir():
    pytest.skip("needs the repository", allow_module_level=True)

PAGES = [ROOT / "README.md", *sorted(DOCS.glob("*.md"))]
LOOSE_PAGES = [ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "benchmarks").rglob("*.md"))]


NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
"""A number in a text."""
WALKED = "## A robot, an FMU"
"""The section of a page that `test_first_hour` walks from here on."""


class Block(NamedTuple):
    language: str
    text: str
    line: int


def blocks(page: Path) -> list[Block]:
    """The fenced blocks of a page."""
    found, start, language, held = [], 0, "", []
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        if line.startswith("```") and not start:
            start, language, held = number, line[3:].strip(), []
        elif line.startswith("```"):
            found.append(Block(language, "\n".join(held) + "\n", start))
            start = 0
        elif start:
            held.append(line)
    assert not start, f"{page.name}: the block of line {start} does not end"
    return found


def of(page: Path, language: str) -> list[Block]:
    return [b for b in blocks(page) if b.language == language]


def name(page: Path) -> str:
    return page.name


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A place for what a page writes, with the files of the docs that it may name."""
    shutil.copytree(DOCS / "mappings", tmp_path / "docs" / "mappings")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    import scipy.linalg  # threads can only be limited in libraries that are loaded
    import torch

    assert scipy.linalg and torch
    with threadpool_limits(1):  # the examples are small, and threads that wait for each other are slow
        yield tmp_path


COMMANDS = ("pamid", "make", "python", "git")


def as_the_shell_reads(command: str) -> list[str]:
    """The words of a command line after the quoting, globbing and syntax of a real shell; nothing is run."""
    first = command.split()[:1]
    assert not first or first[0] in COMMANDS or command.startswith("#"), f"{command} is not known"
    stand_ins = "".join(f"{name}() {{ printf '%s\\0' {name} \"$@\"; }}\n" for name in COMMANDS)
    done = subprocess.run(["bash", "-euc", stand_ins + command], capture_output=True, text=True, timeout=30)
    assert done.returncode == 0, f"a shell refuses: {command}\n{done.stderr}"
    return done.stdout.split("\0")[:-1]


def test_a_command_that_no_shell_takes_is_noticed() -> None:
    assert as_the_shell_reads("pamid fit --set 'hidden=(16,)' # quoted") == ["pamid", "fit", "--set", "hidden=(16,)"]
    with pytest.raises(AssertionError, match="a shell refuses"):
        as_the_shell_reads("pamid fit --set hidden=(16,)")


def is_output_of(block: Block, above: Block) -> bool:
    """Whether a block shows what the Python directly above it prints."""
    close = block.line == above.line + above.text.count("\n") + 3
    return close and (above.language, block.language) == ("python", "text")


def shows(said: str, printed: str) -> bool:
    """Whether what a page shows of an output is part of it: word by word, and numbers to within a tenth."""
    said, printed = (" ".join(each.split()) for each in (said, printed))
    found = re.search(f"({NUMBER.pattern})".join(map(re.escape, NUMBER.split(said))), printed)
    pairs = zip(NUMBER.findall(said), found.groups(), strict=True) if found else ()
    return found is not None and all(math.isclose(float(a), float(b), rel_tol=0.1) for a, b in pairs)


def test_an_output_that_has_changed_is_noticed() -> None:
    printed = "One cause: leakage\nIt closes 98.5 % (from 3e-06\n to 2.9e-08 kg/s).\n"
    assert shows("It closes 97 % (from 3.1e-06 to 2.9e-08 kg/s).", printed)
    assert not shows("It closes 80 % (from 3e-06 to 2.9e-08 kg/s).", printed)
    assert not shows("Adding it closes 98.5 %", printed)
    assert sum(is_output_of(b, a) for a, b in pairwise(blocks(DOCS / "reading.md"))) == 4


@pytest.mark.parametrize(
    "page", [p for p in PAGES if any(b.language in ("python", "console") for b in blocks(p))], ids=name
)
def test_examples_run(page: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Python and command lines run in the order of the page, one namespace a page, and warn only of what it names."""
    text = page.read_text(encoding="utf-8")
    space: dict[str, object] = {"__name__": "__main__"}
    end = text[: text.find(WALKED)].count("\n") if WALKED in text else text.count("\n")
    printed, above = "", Block("", "", 0)
    for block in blocks(page):
        if block.line > end:
            break
        where = f"{page.name}, block of line {block.line}"
        if block.language == "python":
            with warnings.catch_warnings(record=True) as issued:
                warnings.simplefilter("always")
                exec(compile("\n" * block.line + block.text, str(page), "exec"), space)
            own = [w for w in issued if issubclass(w.category, PamidWarning)]
            unnamed = [f"{w.category.__name__}: {w.message}" for w in own if w.category.__name__ not in text]
            assert not unnamed, f"{where} warns, and the page does not say so:\n" + "\n".join(unnamed)
            printed = capsys.readouterr().out
        elif is_output_of(block, above):
            assert shows(block.text, printed), f"{where} is not what the Python above it prints:\n{printed}"
        elif block.language == "console":
            for command in re.sub(r"\\\n", " ", block.text).splitlines():
                words = as_the_shell_reads(command.removeprefix("$ "))
                if words[:1] == ["pamid"]:
                    code = main(words[1:])
                    assert code == 0, f"{where}: {command}\n{capsys.readouterr().err}"
        elif block.language == "json":
            json.loads(block.text)
        above = block


@pytest.mark.parametrize("page", [p for p in PAGES if of(p, "python")], ids=name)
def test_examples_give_the_same_numbers_each_time(page: Path) -> None:
    """What draws random numbers has a seed."""
    from pamid.estimators import all_estimators

    drawn = {n for n, cls in all_estimators() if "random_state" in inspect.signature(cls).parameters}
    assert {"ThermodynamicPIHM", "QAdapter"} <= drawn
    for block in of(page, "python"):
        for call in (node for node in ast.walk(ast.parse(block.text)) if isinstance(node, ast.Call)):
            if isinstance(call.func, ast.Name) and call.func.id in drawn:
                given = {word.arg for word in call.keywords}
                where = f"{page.name}, line {block.line + call.lineno}"
                assert given & {"random_state", None}, f"{where}: {call.func.id} without random_state"


@pytest.mark.parametrize("page", [p for p in PAGES if of(p, "toml")], ids=name)
def test_toml_is_a_simulator_or_a_mapping(page: Path, tmp_path: Path) -> None:
    for block in of(page, "toml"):
        content = tomllib.loads(block.text)
        if "project" in content:  # of a package, tried by test_plugins.py
            continue
        if "between" in content:  # a part of a simulator file, tried by the tests of effects between two ports
            continue
        if "muscle" in content:
            file = tmp_path / "sim.toml"
            file.write_text(block.text, encoding="utf-8")
            BenchParameters.from_toml(file)
        elif "kind" in content:
            file = tmp_path / "sim.toml"
            file.write_text(block.text, encoding="utf-8")
            read_system(file)
        else:
            LogMapping.load(content)


@pytest.mark.parametrize("mapping", sorted((DOCS / "mappings").glob("*.toml")), ids=name)
def test_mappings_are_valid_and_shown(mapping: Path) -> None:
    assert LogMapping.load(mapping).signals
    assert mapping.name in (DOCS / "logs.md").read_text(encoding="utf-8")


# --- what follows from the code -----------------------------------------------------------------------------
@pytest.fixture(scope="module")
def tables() -> ModuleType:
    spec = importlib.util.spec_from_file_location("docs_tables", DOCS / "tables.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_tables_are_up_to_date(tables: ModuleType) -> None:
    texts = {page.name: page.read_text(encoding="utf-8") for page in [*PAGES, *LOOSE_PAGES]}
    shown = {found[2] for text in texts.values() for found in tables.MARKS.finditer(text)}
    stale = [n for n, text in texts.items() if tables.updated(text) != text]
    assert not stale, "run: python docs/tables.py"
    assert set(tables.TABLES) <= shown
    stubs = [file.name for file, text in tables.stubs().items() if file.read_text(encoding="utf-8") != text]
    assert not stubs, "run: python docs/tables.py"
    assert {f"command:{c}" for c in tables.commands_.subparsers()} <= shown, (
        "a command without its options in command-line.md"
    )


def test_a_stale_table_is_noticed(tables: ModuleType) -> None:
    page = "<!-- table: commands -->\n| old |\n<!-- end of table -->\n"
    assert "pamid simulate" in tables.updated(page)
    assert tables.updated(tables.updated(page)) == tables.updated(page)


@pytest.mark.parametrize("page", [p for p in PAGES if of(p, "sh")], ids=name)
def test_commands_that_are_only_shown_are_those_of_pamid(page: Path, tables: ModuleType) -> None:
    """What a page shows without running it is taken by a shell, and its options by the command."""
    for block in of(page, "sh"):
        done = subprocess.run(["bash", "-n"], input=block.text, capture_output=True, text=True, timeout=30)
        assert done.returncode == 0, done.stderr
        for line in block.text.splitlines():
            shown = line.rpartition(" | ")[2]
            if shown.startswith("pamid ") and not shown.startswith("pamid --"):
                _, command, *rest = as_the_shell_reads(shown)
                tables.commands_.subparsers()[command].parse_args(rest)


def test_every_estimator_is_explained() -> None:
    from pamid.estimators import all_estimators

    text = re.sub(
        r"<!-- table.*?<!-- end of table -->", "", (DOCS / "models.md").read_text(encoding="utf-8"), flags=re.S
    )
    missing = [n for n, _ in all_estimators() if f"`{n}`" not in text]
    assert not missing


def test_every_room_is_on_the_map() -> None:
    text = (DOCS / "architecture.md").read_text(encoding="utf-8")
    rooms = [p.parent.name for p in (ROOT / "pamid").glob("*/__init__.py")]
    assert [room for room in rooms if f"`{room}`" not in text] == []


def test_json_output_is_as_described(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each JSON example of the command line page, and each list of keys below a command, is what the command prints."""
    page = DOCS / "command-line.md"
    lines, checked, listed = page.read_text(encoding="utf-8").splitlines(), 0, 0
    for block in blocks(page):
        if block.language == "console":
            for command in re.sub(r"\\\n", " ", block.text).splitlines():
                words = as_the_shell_reads(command.removeprefix("$ "))
                capsys.readouterr()
                assert main(words[1:]) == 0, command
                printed = capsys.readouterr().out
            below = "\n".join(lines[block.line + block.text.count("\n") + 1 :]).strip().partition(".\n")[0]
            if below.startswith("`--json`: "):
                keys = re.findall(r"`(\w+)`", re.sub(r"\([^)]*\)", "", below.partition(". ")[0]))
                assert set(keys) == set(json.loads(printed)), f"keys below the block of line {block.line}"
                listed += 1
        elif block.language == "json":
            assert shape(json.loads(block.text)) == shape(json.loads(printed)), f"block of line {block.line}"
            checked += 1
    assert checked >= 3 and listed >= 2


TABLES_BY_NAME = ("trajectories", "equations", "parameters", "relative_change", "skipped")


def shape(value: object) -> object:
    """Keys and kinds of JSON data; where the keys are names of runs or the like, the first entry stands for all."""
    if isinstance(value, dict):
        return {
            k: [shape(entry) for entry in list(v.values())[:1]]
            if k in TABLES_BY_NAME and isinstance(v, dict)
            else shape(v)
            for k, v in value.items()
        }
    return "number" if isinstance(value, int | float) else type(value).__name__


# --- links and words ----------------------------------------------------------------------------------------
def anchors(page: Path) -> set[str]:
    titles = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", t.lower()).replace(" ", "-") for t in titles}


@pytest.mark.parametrize("page", [*PAGES, *LOOSE_PAGES], ids=name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if re.match(r"https?://", target):
            continue
        file, _, anchor = target.partition("#")
        path = (page.parent / file).resolve() if file else page
        assert path.exists(), target
        assert path.is_relative_to(ROOT), target
        if anchor:
            assert anchor in anchors(path), target


def words(text: str) -> int:
    """Words of a page, whatever stands between the bars of a table; the bars do not count."""
    return sum(any(c.isalnum() for c in word) for word in text.split())


def test_the_docs_stay_short() -> None:
    """A page that grows takes words from another: what is read is what is short."""
    counted = {page.name: words(page.read_text(encoding="utf-8")) for page in DOCS.glob("*.md")}
    assert sum(counted.values()) <= 30_000, sorted(counted.items(), key=lambda item: -item[1])[:8]


@pytest.mark.parametrize(("page", "before"), [("docs/adaptation.md", 1_235), ("benchmarks/papers.md", 1_454)])
def test_two_pages_stay_half_as_long_as_they_were(page: str, before: int) -> None:
    """Words at 30bf64a: what holds of the papers and of adaptation is said in half of them."""
    assert words((ROOT / page).read_text(encoding="utf-8")) <= before / 2


def test_the_readme_shows_little() -> None:
    """Two commands, one picture of a diagnosis, one table, twelve links: the rest is a page of its own."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(re.findall(r"(?<!!)\[[^\]]*\]\([^)]*\)", text)) <= 12
    assert len(re.findall(r"!\[[^\]]*\]\([^)]*\)", text)) == 1
    assert len(re.findall(r"^\| --- ", text, re.M)) == 1
    (commands,) = re.findall(r"```console\n(.*?)```", text, re.S)
    assert len(commands.split("\n")) == 3


def test_every_warning_is_explained(tables: ModuleType) -> None:
    """What the package issues is a class of `pamid.errors` or a FutureWarning, and each class says what to do."""
    import pamid
    from pamid import errors

    own = {n for n, c in vars(errors).items() if isinstance(c, type) and issubclass(c, errors.PamidWarning)}
    assert set(tables.WHAT_TO_DO) == own
    issued = set()
    for room in (Path(pamid.__file__).parent, ROOT / "estimators"):
        for file in room.rglob("*.py"):
            for call in re.finditer(r"warnings\.warn\((.*?)stacklevel", file.read_text(encoding="utf-8"), re.S):
                issued |= set(re.findall(r"\b([A-Z]\w*Warning)\b", call[1]))
    assert {"UnitWarning", "AdaptationWarning"} <= issued <= own | {"FutureWarning"}, issued - own
