"""The notebooks of the docs run from the first cell to the last, each in a folder of its own."""

from __future__ import annotations

import ast
import json
import re
import runpy
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "notebooks"
if not FOLDER.is_dir():
    pytest.skip("needs the repository", allow_module_level=True)
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
EXAMPLES = sorted((FOLDER.parent / "gallery").glob("plot_*.py"))


def cells(notebook: Path, kind: str) -> list[str]:
    read = json.loads(notebook.read_text(encoding="utf-8"))
    return ["".join(cell["source"]) for cell in read["cells"] if cell["cell_type"] == kind]


def run(code: str, names: dict[str, Any]) -> Any:
    """Run a cell as a notebook does; return the value of its last expression."""
    *body, last = ast.parse(code).body
    shown = isinstance(last, ast.Expr)
    exec(compile(ast.Module(body if shown else [*body, last], []), "cell", "exec"), names)
    return eval(compile(ast.Expression(last.value), "cell", "eval"), names) if shown else None


def test_there_is_one_for_each_user():
    assert {n.stem for n in NOTEBOOKS} == {"muscle_on_a_rig", "simulator", "model_to_compare", "controller_to_feed"}


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda n: n.stem)
def test_a_notebook_runs(notebook, tmp_path, monkeypatch, capsys):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot as plt
    from matplotlib.figure import Figure

    monkeypatch.chdir(tmp_path)
    assert cells(notebook, "markdown")[0].startswith("# You have a ")
    raw = json.loads(notebook.read_text(encoding="utf-8"))
    assert not any(cell.get("outputs") for cell in raw["cells"]), "outputs grow old"
    names: dict[str, Any] = {"__name__": "__main__"}
    values = [run(code, names) for code in cells(notebook, "code")]
    assert plt.get_fignums() or any(isinstance(value, Figure) for value in values), "a picture"
    plt.close("all")
    assert any(value is not None for value in values)
    said = capsys.readouterr().out
    assert "nan" not in said
    if notebook.stem == "simulator":
        assert names["diagnosis"].causes[0].effects == ("coulomb_friction",)
    elif notebook.stem == "controller_to_feed" and "selftest" in said:
        assert "passed" in said


# --- notebooks that open elsewhere --------------------------------------------------------------------------
def gallery_notebook(example: Path) -> dict[str, Any]:
    """The notebook that the site offers for an example, with the settings of the site."""
    sphinx_gallery = pytest.importorskip("sphinx_gallery.notebook", reason="needs the extra docs")
    from sphinx_gallery.gen_gallery import DEFAULT_GALLERY_CONF
    from sphinx_gallery.py_source_parser import split_code_and_text_blocks

    settings = runpy.run_path(str(FOLDER.parent / "conf.py"))["sphinx_gallery_conf"]
    _, blocks = split_code_and_text_blocks(str(example))
    made: dict[str, Any] = sphinx_gallery.jupyter_notebook(blocks, DEFAULT_GALLERY_CONF | settings, str(example.parent))
    return made


def check_opens_elsewhere(notebook: dict[str, Any]) -> None:
    """Valid, says in its first cell how pamid is installed, and names no path of a checkout."""
    nbformat = pytest.importorskip("nbformat")
    assert notebook["nbformat"] == 4
    nbformat.validate(nbformat.reads(json.dumps(notebook), as_version=4))
    first = "".join(notebook["cells"][0]["source"])
    assert re.search(r"%pip install [\w\"\[\]-]*pamid", first), first
    text = json.dumps(notebook)
    for place in (str(FOLDER.parents[1]), str(Path.home()), "docs/", "tests/", "benchmarks/", "__file__"):
        assert place not in text, place


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda n: n.stem)
def test_a_notebook_opens_elsewhere(notebook: Path) -> None:
    check_opens_elsewhere(json.loads(notebook.read_text(encoding="utf-8")))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda n: n.stem)
def test_an_example_of_the_gallery_opens_elsewhere(example: Path) -> None:
    notebook = gallery_notebook(example)
    check_opens_elsewhere(notebook)
    code = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert "import pamid" in code[0] and len(code) > 1
    for cell in code:
        compile(cell, example.name, "exec")


def test_a_notebook_that_does_not_open_elsewhere_is_found() -> None:
    good = {"nbformat": 4, "nbformat_minor": 5, "metadata": {}, "cells": []}
    cell = {"cell_type": "markdown", "id": "a", "metadata": {}, "source": ["`%pip install pamid`"]}
    check_opens_elsewhere(good | {"cells": [cell]})
    for bad in (
        {"cells": [cell | {"source": ["no word of it"]}]},
        {"cells": [cell, cell | {"id": "b", "source": [f"open('{FOLDER.parents[1] / 'log.csv'}')"]}]},
        {"cells": [cell], "nbformat": 3},
    ):
        with pytest.raises(AssertionError):
            check_opens_elsewhere(good | bad)
