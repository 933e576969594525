"""The pages on the papers and on figures: what they name exists, nothing of the papers is left out."""

from __future__ import annotations

import importlib
import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from pamid.estimators import all_estimators

from pamid.signals import State
from pamid.volume.bou_saba import BouSabaVolume
from pamid.volume.tondu_lopez import TonduLopezVolume

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "benchmarks" / "papers.md").read_text(encoding="utf-8")
ESTIMATORS = {name for name, _ in all_estimators()}


def rows(title: str) -> list[list[str]]:
    """Cells of the first table under a title."""
    table = PAGE.split(f"## {title}\n", 1)[1].split("\n| --- ", 1)[1]
    lines = table.split("\n")[1:]
    found = []
    for line in lines:
        if not line.startswith("|"):
            break
        found.append([cell.strip() for cell in line.strip("|").split("|")])
    return found


TITLES = ("Fast adaptation of physics-informed hybrid models", "The neural inverse model")
NAMED = "Other models that the papers name"


@pytest.mark.parametrize("title", [*TITLES, NAMED])
def test_every_class_and_command_of_the_papers_exists(title):
    found = rows(title)
    assert len(found) >= 6
    for what, here, command, status in found:
        assert status, what
        for code in re.findall(r"`([^`]+)`", here):
            name = code.split("(")[0]
            if name.startswith("pamid."):
                module, _, attribute = name.rpartition(".")
                if importlib.util.find_spec(module) and hasattr(importlib.import_module(module), attribute):
                    continue
                assert importlib.util.find_spec(name), name
            elif re.fullmatch(r"[A-Z]\w+", name):
                assert name in ESTIMATORS, name
        if command:
            script = re.fullmatch(r"`(\w+\.py)`", command)
            assert script is not None, command
            assert (ROOT / "benchmarks" / script[1]).exists(), script[1]


def test_every_model_that_the_papers_name_has_its_row_or_its_source():
    """Classical models stand under the sources of models.md, with what is implemented of each."""
    named, _, _ = PAGE.split(f"## {NAMED}\n", 1)[1].partition("| model |")
    sources = (ROOT / "docs" / "models.md").read_text(encoding="utf-8").split("## Sources\n")[1].split("\n## ")[0]
    for name in ("Chou", "Tondu", "Bou Saba", "Hildebrandt", "Itto", "Hošovský", "Richer", "Reynolds"):
        assert name in named and name in sources
    for name in ("Wickramatunge", "Martens"):
        assert name in named and name in sources
    page = " ".join(cell for row in rows(NAMED) for cell in row[:1])
    for name in ("Olaby", "Taghizadeh", "Raissi", "Lutter", "Gaskin", "recurrent", "NNARX"):
        assert name in page


@pytest.mark.parametrize(
    ("title", "numbered"),
    [
        (TITLES[0], {"Equation": 7, "Algorithm": 2, "Table": 2, "Figure": 7}),
        (TITLES[1], {"Equation": 2, "Figure": 11}),
    ],
)
def test_nothing_numbered_is_left_out(title, numbered):
    for kind, last in numbered.items():
        seen: set[int] = set()
        for what, *_ in rows(title):
            for one in re.findall(rf"{kind}s? (\d+(?: (?:to|and) \d+)?)", what):
                ends = [int(n) for n in re.findall(r"\d+", one)]
                seen |= set(range(ends[0], ends[-1] + 1))
        assert seen == set(range(1, last + 1)), kind


def test_bou_saba_is_not_tondu_lopez():
    """At exponent 2 and factor 1 both are Chou and Hannaford; elsewhere they part, and one depends on the pressure."""
    geometry, eps = (0.2, 0.02, 0.4363), np.linspace(0.0, 0.25, 200)

    def slope(volume, P=3e5):
        return volume.jet(State(eps, 0 * eps, P + 0 * eps, 0 * eps)).V_eps

    np.testing.assert_allclose(slope(BouSabaVolume(*geometry, 2.0)), slope(TonduLopezVolume(*geometry)), rtol=1e-12)
    steep = slope(BouSabaVolume(*geometry, 3.0))
    nearest = min(
        np.abs(slope(TonduLopezVolume(*geometry, end_cap=k)) - steep).max() for k in np.linspace(1.2, 1.6, 201)
    )
    assert 0.01 < nearest / np.ptp(steep) < 0.02
    assert np.allclose(slope(BouSabaVolume(*geometry, 3.0), 1.5e5), steep)
    rising = TonduLopezVolume(*geometry, end_cap_rise=0.5)
    assert np.abs(slope(rising, 1.5e5) - slope(rising)).max() > 0.05 * np.ptp(slope(rising))


# --- the page of figures ----------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def figures() -> ModuleType:
    spec = importlib.util.spec_from_file_location("record_figures", ROOT / "benchmarks" / "_record.py")
    assert spec is not None and spec.loader is not None
    module = sys.modules["record_figures"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_figure_names_its_command_revision_and_data(figures):
    text = figures.PAGE.read_text(encoding="utf-8")
    blocks = figures.blocks(text)
    assert len(blocks) == text.count("```text") == len({b.name for b in blocks})
    for block in blocks:
        assert block.output.strip()
        assert ("DIR" in block.command) == bool(block.data), block.name
        if block.command.startswith("python "):
            assert (ROOT / block.command.split()[1]).exists(), block.command


def test_a_block_is_measured_alone(figures):
    text = figures.PAGE.read_text(encoding="utf-8")
    first, *others = figures.blocks(text)
    again = figures.Block(first.name, first.command, "1234567", "2030-01-02", first.data, "new figures\n")
    after = figures.replaced(text, again)
    assert figures.blocks(after) == [again, *others]
    assert figures.replaced(after, first) == text
