"""The check on any simulator: its cases are what they say."""

import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
if not (ROOT / "benchmarks" / "any_simulator").is_dir():
    pytest.skip("needs the repository", allow_module_level=True)
sys.path.append(str(ROOT))

from benchmarks.any_simulator import generator  # noqa: E402


def test_no_run_leaves_the_room_of_its_system():
    # The sensor's lag lets this cylinder's controller swing: once its piston went through the cylinder's end.
    spec = next(s for s in generator.specs(6028113) if s.name == "single-cylinder-029")
    case = generator.make(spec)
    assert np.isfinite(case.key["nats"])
    assert case.key["detectable"]
    assert np.abs(case.log["s"]).max() < 0.12
    assert np.abs(case.future["s"]).max() < 0.12
