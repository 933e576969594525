"""The site: examples are scripts with a title and a picture, the reference holds every room, links are checked."""

from __future__ import annotations

import ast
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
if not (DOCS / "conf.py").is_file():
    pytest.skip("needs the repository", allow_module_level=True)

EXAMPLES = sorted((DOCS / "gallery").glob("plot_*.py"))
QUICKEST = ("plot_04_valve", "plot_06_gas")


def module(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"docs_{path.stem}", path)
    assert spec is not None and spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


# --- examples -----------------------------------------------------------------------------------------------
def test_there_are_a_dozen_examples() -> None:
    assert len(EXAMPLES) >= 12
    assert len({path.stem.split("_")[1] for path in EXAMPLES}) == len(EXAMPLES), "two have one number"


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_has_a_title_a_word_and_a_picture(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    title, line, *rest = (ast.get_docstring(tree) or "").splitlines()
    assert set(line) == {"="} and len(line) >= len(title)
    assert len(" ".join(rest).split()) > 25, "says what to see"
    calls = [node.func.attr for node in ast.walk(tree) if isinstance(node, ast.Call) and hasattr(node.func, "attr")]
    assert "show" in calls or "from_diagnosis" in calls
    labels = re.findall(r'set_[xy]label\(\s*f?"([^"]+)"', text)
    unlabelled = [label for label in labels if "/" not in label]
    assert not unlabelled, "an axis without a unit"
    assert labels or "Display" in text


@pytest.mark.parametrize("name", QUICKEST)
def test_an_example_runs(name: str, tmp_path: Path) -> None:
    code = "import matplotlib.pyplot as plt, runpy, sys; runpy.run_path(sys.argv[1]); print(len(plt.get_fignums()))"
    done = subprocess.run(
        [sys.executable, "-W", "error::RuntimeWarning", "-c", code, str(DOCS / "gallery" / f"{name}.py")],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "MPLBACKEND": "Agg"},
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.split()[-1]) == 1


# --- pages --------------------------------------------------------------------------------------------------
def test_every_page_is_in_a_list_of_contents() -> None:
    listed = {"index"}
    for page in DOCS.glob("*.md"):
        for block in re.findall(r"```\{toctree\}\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
            listed |= {line.strip() for line in block.splitlines() if line.strip() and not line.startswith(":")}
    assert sorted({page.stem for page in DOCS.glob("*.md")} - listed) == []


def test_what_pages_include_is_there() -> None:
    included = 0
    for page in DOCS.glob("*.md"):
        text = page.read_text(encoding="utf-8")
        for file, name in re.findall(r"```\{literalinclude\} (\S+)\n(?::language: \w+\n)?:pyobject: (\w+)", text):
            assert f"class {name}" in (DOCS / file).read_text(encoding="utf-8")
            included += 1
    assert included >= 3


def test_the_reference_has_every_option_of_every_command() -> None:
    commands = module(DOCS / "_ext" / "commands.py")
    sections = dict(re.findall(r"^pamid (\w+)\n-+\n(.*?)(?=^pamid \w+\n-|\Z)", commands.page(), re.M | re.S))
    assert set(sections) == set(commands.subparsers())
    for name, parser in commands.subparsers().items():
        flags = [flag for action in parser._actions for flag in action.option_strings]
        assert [flag for flag in flags if flag not in sections[name]] == [], name


def test_the_reference_has_every_room() -> None:
    rooms = module(DOCS / "_ext" / "rooms.py")
    pages = {room: rooms.page(room, line) for room, line in rooms.rooms().items()}
    packages = {f"pamid.{p.parent.name}" for p in (ROOT / "pamid").glob("*/__init__.py")} - {"pamid.cli"}
    assert packages <= set(pages)
    assert "pamid.estimators.StaticPIHM" in pages["pamid.estimators"]
    assert "pamid.effects.leakage.Leakage" in pages["pamid.effects"]
    assert "pamid.gap.diagnose" in pages["pamid.gap"]
    assert ".. autoexception:: pamid.errors.UnitError" in pages["pamid.errors"]


# --- links --------------------------------------------------------------------------------------------------
def test_links_to_the_repository_become_links_of_the_site() -> None:
    rewritten = module(DOCS / "_ext" / "source_links.py").rewritten
    assert rewritten("[`MLP`](../estimators/mlp.py)") == "{py:obj}`~pamid.estimators.MLP`"
    assert rewritten("[x](../CONTRIBUTING.md#style)") == "[x](contributing.md#style)"
    assert rewritten("[x](gallery/plot_06_gas.py)") == "[x](auto_gallery/plot_06_gas.rst)"
    assert rewritten("[`creep`](../pamid/effects/relaxation.py)") == "{py:obj}`creep <pamid.effects.relaxation.Creep>`"
    assert rewritten("[`Nothing`](../estimators/nothing.py)") == "[`Nothing`](../estimators/nothing.py)"


def test_pages_outside_the_docs_link_as_from_their_own_folder() -> None:
    links = module(DOCS / "_ext" / "source_links.py")
    text = "[a](../docs/logs.md#units) ![b](../docs/images/x.png) [c](papers.md) [d](#here) [e](https://x.org/a.md)"
    moved = links.from_docs(text, "benchmarks/adaptation.md")
    expected = "[a](logs.md#units) ![b](images/x.png) [c](../benchmarks/papers.md) [d](#here) [e](https://x.org/a.md)"
    assert moved == expected
    assert "[c](papers.md)" in links.rewritten(moved)
    assert links.from_docs("[x](docs/simulators.md)", "CHANGELOG.md") == "[x](simulators.md)"


def test_formulas_need_no_script() -> None:
    mathml = module(DOCS / "_ext" / "mathml.py")
    from docutils import nodes

    drawn = mathml._rendered(nodes.math("", r"\big(a_1, \dots\big)"), block=False)
    assert drawn.startswith("<math") and "<script" not in drawn
    assert "<mtable" in mathml._rendered(nodes.math("", r"a &= b \\ c &= d"), block=True)


def test_dead_links_and_what_is_loaded_are_found(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text(
        '<h1 id="top">A</h1><a href="b.html#x">b</a><a href="#top">top</a><a href="https://example.org">out</a>'
        '<img src="gone.png"><script src="https://cdn.example.org/x.js"></script>'
    )
    (tmp_path / "b.html").write_text('<h1 id="y">B</h1>')
    (tmp_path / "s.css").write_text("@import 'local.css'; a { background: url(https://example.org/f.woff2) }")
    faults = module(DOCS / "check_site.py").faults(tmp_path)
    assert [f for f in faults if "b.html#x" in f]
    assert [f for f in faults if "gone.png" in f]
    assert [f for f in faults if "x.js" in f]
    assert [f for f in faults if "f.woff2" in f]
    assert len(faults) == 4


# --- versions -----------------------------------------------------------------------------------------------
def test_versions_stand_beside_each_other(tmp_path: Path) -> None:
    pytest.importorskip("packaging")
    versions = module(DOCS / "versions.py")
    for name in ("0.9.0", "0.10.0", "1.0.0rc1", "pictures"):
        (tmp_path / name / "api").mkdir(parents=True)
        (tmp_path / name / "index.html").write_text(f"first page of {name}")
    (tmp_path / "0.10.0" / "api" / "new page.html").write_text("a page")
    (tmp_path / "0.8.0").mkdir()  # nothing was built there
    before = {file: file.read_bytes() for file in tmp_path.rglob("*.html")}
    assert versions.bind(tmp_path) == ["1.0.0rc1", "0.10.0", "0.9.0"]
    listed = json.loads((tmp_path / "versions.json").read_text())
    assert [(v["version"], v["preferred"]) for v in listed] == [
        ("1.0.0rc1", False), ("0.10.0", True), ("0.9.0", False)
    ]  # fmt: skip
    assert [(tmp_path / v["url"]).is_file() for v in listed] == [True] * 3
    assert json.loads((tmp_path / "versions.js").read_text().partition("= ")[2].rstrip(";\n")) == listed
    assert '["0.10.0"] = ["api/new page.html", "index.html"]' in (tmp_path / "0.10.0" / "pages.js").read_text()
    assert 'href="0.10.0/index.html"' in (tmp_path / "index.html").read_text()
    assert 'href="../../0.10.0/api/new%20page.html"' in (tmp_path / "latest" / "api" / "new page.html").read_text()
    # A newer version comes; those that stand there stay as they are, and what led to the old newest one is gone.
    (tmp_path / "1.0.0").mkdir()
    (tmp_path / "1.0.0" / "index.html").write_text("first page of 1.0.0")
    assert versions.bind(tmp_path) == ["1.0.0", "1.0.0rc1", "0.10.0", "0.9.0"]
    assert {file: file.read_bytes() for file in before} == before
    assert [file.name for file in (tmp_path / "latest").rglob("*.html")] == ["index.html"]
    assert 'href="../1.0.0/index.html"' in (tmp_path / "latest" / "index.html").read_text()


def test_a_folder_without_a_version_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("packaging")
    with pytest.raises(SystemExit, match=r"holds no version: a folder such as 0\.1\.0"):
        module(DOCS / "versions.py").bind(tmp_path)


def test_make_docs_builds_this_version_into_a_folder_of_its_own() -> None:
    make = shutil.which("make")
    if make is None:
        pytest.skip("needs make")
    told = subprocess.run(
        [make, "-n", "docs", "SITE=kept"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    assert re.search(r"sphinx .* docs kept/\$version && .*docs/versions\.py kept && ", told, re.DOTALL)
