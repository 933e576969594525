"""The benchmark of corrected simulators: what a diagnosis hands over loads, runs and closes what its report says."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
if not (ROOT / "benchmarks" / "_corrected").is_dir():
    pytest.skip("needs the repository", allow_module_level=True)
sys.path.append(str(ROOT))

from benchmarks._corrected.cases import CASES  # noqa: E402
from benchmarks.corrected_runs import closes, solve  # noqa: E402

QUICK = ("control pole actuator_gain", "cylinder cylinder seal viscous_friction", "equations rail quadratic_drag")
"""Cases of three kinds that take 5 to 9 s."""
SEED = 20_261_125


@pytest.mark.slow
@pytest.mark.parametrize("name", QUICK)
def test_a_corrected_simulator_closes_on_other_runs_what_was_said(name: str, tmp_path: Path) -> None:
    pytest.importorskip("control")
    number = [case.name for case in CASES].index(name)
    record = solve(number, SEED, tmp_path)
    assert record["loads"] and record["runs"], record
    assert closes(record), record
    assert not record["notes"] and set(CASES[number].effects) <= set(
        " ".join(record["causes"]).replace("@", " ").split()
    )
