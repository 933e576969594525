"""In which run a gap lies, and from when to when."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from pamid.gap.diagnosis.findings import TrajectoryShare
from pamid.report import answers
from pamid.report.when import when


def of_runs(d, left: dict[str, np.ndarray], shares: list[float]):
    """Return a diagnosis whose errors in units of the noise are given run by run."""
    equation = d.equations[0].equation
    parts = [
        pd.DataFrame({"trajectory": run, "time": np.arange(len(z)), "equation": equation, "before": z, "after": z})
        for run, z in left.items()
    ]
    runs = [TrajectoryShare(run, share) for run, share in zip(left, shares, strict=True)]
    windows = pd.concat(parts).assign(noise=1.0, measured=0.0)
    return replace(d, windows=windows, trajectories=sorted(runs, key=lambda r: -r.share), causes=[])


FLAT = np.full(100, 5.0)
LATE = np.where(np.arange(100) < 60, 1.0, 5.0)


@pytest.mark.parametrize(
    ("left", "shares", "said"),
    [
        ({"a": 1.0 + 0.0 * FLAT, "b": LATE}, [0.02, 0.98], "98 % lies in the run b, most of it from 60 to "),
        ({"a": 1.0 + 0.0 * FLAT, "b": FLAT}, [0.02, 0.98], "98 % lies in the run b."),
        ({"a": LATE}, [1.0], "Most of the gap lies from 60 to "),
        ({"a": FLAT}, [1.0], ""),
        ({"a": FLAT, "b": FLAT}, [0.5, 0.5], ""),
    ],
)
def test_a_gap_of_one_run_or_time_is_told_with_it(diagnoses, left, shares, said) -> None:
    found = of_runs(diagnoses["unknown"], left, shares)
    assert said in when(found) and bool(said) == bool(when(found))
    assert when(found) in answers(found).where
