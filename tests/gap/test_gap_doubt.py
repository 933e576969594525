"""Where a diagnosis must doubt what it found, or believe what few windows say."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from pamid.bench import BenchParameters, simulate, sine, step
from pamid.gap import diagnose, diagnose_simulator, engine
from pamid.gap.inference.significance import outliers
from pamid.simulators import FunctionSimulator, Port

NOMINAL = BenchParameters.for_muscle("B").replace(
    tolerance={"rest_diameter": 0.005, "sonic_conductance": 0.02, "viscous_damping": 0.1, "inertia": 0.02}
)
RUNS = [sine(2, 15, 2500), sine(6, 10, 2500), step(0, 20, 2500)]


def log_with(*effects: tuple[str, dict[str, float]]) -> pd.DataFrame:
    return simulate(NOMINAL.replace(effects=list(effects)), RUNS, seed=0)


def test_few_windows_far_out_are_a_gap_even_without_an_effect_for_them() -> None:
    """A valve that saturates does so in the few windows after a step."""
    log = log_with(("valve_saturation", {"limit": 0.35}))
    d = diagnose(log, NOMINAL, ["viscous_friction", "leakage", "force_gain"])
    assert d.verdict == "unknown"
    assert d.equations[0].equation == "valve"


def test_a_long_log_is_searched_in_part_and_fitted_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    log = log_with(("viscous_friction", {"coefficient": 40.0}))
    library = ["viscous_friction", "leakage", "force_gain"]
    whole = diagnose(log, NOMINAL, library)
    monkeypatch.setattr(engine, "SEARCH_ROWS", 5000)
    part = diagnose(log, NOMINAL, library)
    assert [c.effects for c in part.causes] == [c.effects for c in whole.causes] == [("viscous_friction",)]
    assert any("searched for in 5,000 rows" in note for note in part.notes)
    for a, b in zip(part.causes, whole.causes, strict=True):
        assert a.parameters["coefficient"].value == pytest.approx(b.parameters["coefficient"].value, rel=1e-3)


def test_a_gap_beyond_a_tolerance_is_closed_by_its_cause_alone() -> None:
    """Held out, a parameter at the end of its tolerance stays there and does not close the gap by itself."""
    d = diagnose(log_with(("joint_damping", {"difference": 0.02})), NOMINAL)
    assert d.causes[0].effects[0] == "joint_damping"
    joint = next(c for c in d.closure if c.equation == "joint")
    assert joint.rmse_before > 5.0 * joint.noise_floor
    assert joint.closed_share > 0.9


@pytest.mark.parametrize("every", [2, 10])
def test_coarse_sampling_is_no_gap(every: int) -> None:
    """A command that jumps between two samples leaves windows of flow and torque far out."""
    log = simulate(NOMINAL, [sine(2, 10, 4000), sine(5, 12, 4000), step(0, 15, 4000)], seed=0)
    assert diagnose(log.iloc[::every], NOMINAL).verdict == "none"


@pytest.mark.parametrize(("event", "verdict"), [(0.5, "unknown"), (0.0, "none")], ids=["two seconds", "one reading"])
def test_what_lasts_is_a_gap_and_a_bad_reading_is_none(event: float, verdict: str) -> None:
    """A robust scale sees neither: both are a small share of the log."""
    rng, t = np.random.default_rng(3), 0.01 * np.arange(8000)
    u = np.sin(2.0 * t)
    y = 2.0 * u + event * np.exp(-np.square(t - 60.0)) + 1e-2 * rng.standard_normal(len(t))
    y[6012] += 3.0
    log = pd.DataFrame({"trajectory": "7", "time": t, "u": u, "y": y})
    gain = FunctionSimulator(lambda u, p: 2.0 * u.u, [Port("u", "input", "V"), Port("y", "output", "N")])
    found = diagnose_simulator(log, gain, ["sensor_lag"], seed=0)
    assert found.verdict == verdict
    said = (
        f"From {found.events[0].begins:.4g} to {found.events[0].ends:.4g} s of run 7, the error of y" if event else ""
    )
    assert said in str(found) and bool(found.events) == bool(event)
    assert not event or (58.0 < found.events[0].begins < 59.0 and 61.0 < found.events[0].ends < 62.0)


@pytest.mark.parametrize(
    ("overlap", "length", "every", "told"),
    [(1, 2, 40, True), (1, 1, 10, False), (3, 3, 40, False), (3, 4, 500, True), (1, 2, 500, False), (1, 1, 3, False)],
)
def test_rows_of_far_windows_are_a_gap_where_no_bad_reading_makes_them(
    overlap: int, length: int, every: int, told: bool
) -> None:
    """One reading is in one window of a prediction, and in up to three of an equation."""
    at = np.arange(1000)
    rng = np.random.default_rng(0)
    far = at % every < length if length > 1 else rng.random(1000) < 1.0 / every
    zero = np.zeros(1000, dtype=int)
    evidence = SimpleNamespace(
        exact=False, parts=[slice(0, 1000)], run=zero, side=zero, time=at * 0.1, overlap=overlap, sharp=[], raw=np.array
    )
    assert (outliers(evidence, np.where(far, 20.0, 0.5)) < 0.01) == told
