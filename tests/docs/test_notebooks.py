"""The notebooks of the docs run from the first cell to the last, each in a folder of its own."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "notebooks"
if not FOLDER.is_dir():
    pytest.skip("needs the repository", allow_module_level=True)
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))


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
