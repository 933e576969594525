"""What rows the as-run study takes, and that its table is that of the paper."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
if not (BENCHMARKS / "adaptation_as_run.py").is_file():
    pytest.skip("needs the repository", allow_module_level=True)
sys.path.append(str(BENCHMARKS))  # the study's files name each other

import adaptation_as_run as study  # noqa: E402


@pytest.mark.parametrize(("muscle", "stride", "first"), [("B", 10, 31_464), ("B", 1000, 315), ("C", 10, 30_952)])
def test_rows_are_thinned_and_drawn(muscle, stride, first):
    """Of every tenth or thousandth row four fifths train, as many as the authors'; no row is in both parts."""
    table = pd.DataFrame({"row": np.arange(study.ROWS[muscle])})
    train, test = study.split(table, stride, 66)
    assert len(train) == first
    both = np.concatenate([train["row"], test["row"]])
    np.testing.assert_array_equal(np.sort(both), np.arange(0, len(table), stride))
    # At random, not the first four fifths: the test rows lie between training rows, in no order.
    assert test["row"].mean() == pytest.approx(len(table) / 2, rel=0.2)
    assert np.any(np.diff(train["row"]) < 0)


def test_a_seed_draws_its_own_rows():
    table = pd.DataFrame({"row": np.arange(5_000)})
    first, again, other = (study.split(table, 10, seed)[0]["row"].to_numpy() for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert set(first) != set(other)


def test_seeds_are_merged_by_medians(capsys):
    """Three seeds of each method: the median, its range, the paper's value, and the rank correlation of medians."""

    def seed(factor: float) -> dict:
        found = {}
        for i, method in enumerate(study.COLUMN):
            errors = {"samples": study.PAPER["B"]["target"][i]} | {k: v[i] for k, v in study.PAPER["B"].items()}
            errors["step"] = -errors["step"]
            row = {"errors": {k: factor * v for k, v in errors.items()}, "parameters": study.PAPER_PARAMETERS[i]}
            seconds = factor * (1e5 if method == "scratch" else study.PAPER_SECONDS["B"][i])
            found[study.kept_name(method, "B")] = row | {"seconds": seconds}
        return found

    study.compare([seed(1.0), seed(2.0), seed(4.0)])
    lines = capsys.readouterr().out.splitlines()
    assert "| scratch | 2.34 1.17–4.68 (1.17) |" in lines[3]
    assert lines[3].endswith("| 200000 100000–400000 (195804) | 17281 (17281) |")
    assert lines[-1] == "| rank correlation | 1.00 | 1.00 | 1.00 | -1.00 | 1.00 | 1.00 |"
    assert not any(line.startswith("| C ") for line in lines)
