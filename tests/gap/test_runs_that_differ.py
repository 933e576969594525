"""Runs given as one log that disagree about the size of an effect are diagnosed as logs of their own."""

import numpy as np
import pandas as pd
import pytest

import pamid
from pamid.gap.several.logs import APART
from pamid.simulators import FunctionSimulator, Port

LIBRARY = ["viscous_friction", "coulomb_friction", "quadratic_drag", "actuator_gain", "parameter_deviation"]
RAIL = FunctionSimulator(
    lambda t, x, u, p: [x.v, u.F / p.m],
    [Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")],
    {"m": (2.0, 0.05, "kg")},
)


def log_of(*frictions, sizes=(5.0, 5.0)):
    """Runs on a rail, each with its own friction, a function of the velocity."""
    rng, runs = np.random.default_rng(3), []
    for k, (friction, size) in enumerate(zip(frictions, sizes, strict=True)):
        t, x, v = np.arange(0, 8, 0.01), [0.0], [0.0]
        F = size * (np.sin((1 + k) * t) + 0.6 * np.sin(0.7 * t))
        for f in F[:-1]:
            v.append(v[-1] + 0.01 * (f - friction(v[-1])) / 2)
            x.append(x[-1] + 0.005 * (v[-1] + v[-2]))
        noise = {"x": x + 1e-5 * rng.standard_normal(800), "v": v + 1e-3 * rng.standard_normal(800)}
        runs.append(pd.DataFrame({"trajectory": f"run {k + 1}", "time": t, "F": F, **noise}))
    return pd.concat(runs, ignore_index=True)


def viscous(coefficient):
    return lambda v: coefficient * v


def dry(v):
    return 1.0 * np.tanh(v / 0.01)


def test_a_size_that_differs_between_runs_is_a_change():
    found = pamid.diagnose(log_of(viscous(2.0), viscous(4.0)), RAIL, LIBRARY)
    assert [c.effects for c in found.causes] == [("viscous_friction",)]
    assert [(c.effect, c.how, c.log) for c in found.changes] == [("viscous_friction", "grows", "run 2")]
    assert APART in found.notes
    assert list(found.history.logs) == ["run 1", "run 2"]


@pytest.mark.parametrize("friction", [viscous(3.0), dry], ids=["viscous", "dry"])
def test_runs_of_unlike_amplitude_with_one_cause_stay_one_log(friction):
    found = pamid.diagnose(log_of(friction, friction, sizes=(2.5, 8.0)), RAIL, LIBRARY)
    assert not found.changes
    assert APART not in found.notes


def test_a_diagnosis_of_runs_that_differ_can_be_continued():
    found = pamid.diagnose(log_of(viscous(2.0), viscous(4.0)), RAIL, LIBRARY)
    more = log_of(viscous(4.0), sizes=(4.0,))
    later = pamid.diagnose({"run 3": more}, RAIL, since=found.history)
    assert [c.effects for c in later.causes] == [("viscous_friction",)]
    assert [c.log for c in later.changes] == ["run 2"]


def changing(*at, before=2.0, after=4.0):
    """A run for each time at which the viscous friction of the rail changes."""
    rng, runs = np.random.default_rng(5), []
    for k, when in enumerate(at):
        t, x, v = np.arange(0, 12, 0.01), [0.0], [0.0]
        F = 5.0 * (np.sin((1 + k) * t) + 0.6 * np.sin(0.7 * t))
        for now, f in zip(t, F[:-1], strict=False):
            v.append(v[-1] + 0.01 * (f - (after if now >= when else before) * v[-1]) / 2)
            x.append(x[-1] + 0.005 * (v[-1] + v[-2]))
        noise = {"x": x + 1e-5 * rng.standard_normal(1200), "v": v + 1e-3 * rng.standard_normal(1200)}
        runs.append(pd.DataFrame({"trajectory": f"run {k + 1}", "time": t, "F": F, **noise}))
    return pd.concat(runs, ignore_index=True)


@pytest.mark.parametrize(("at", "where"), [([5.0], ""), ([20.0, 5.0, 0.0], " of run 2"), ([5.0, 5.0], " of each run")])
def test_a_size_that_changes_within_a_run_is_a_change(at, where):
    found = pamid.diagnose(changing(*at), RAIL, LIBRARY)
    assert [c.effects for c in found.causes] == [("viscous_friction",)]
    [change] = found.changes
    assert (change.effect, change.how) == ("viscous_friction", "grows")
    assert (change.before, change.after) == pytest.approx((2.0, 4.0), rel=0.05)
    word, when, unit, *rest = change.log.split(" ")
    assert (word, unit, " ".join(["", *rest])) == ("from", "s", where)
    assert float(when) == pytest.approx(5.0, abs=0.3)
    assert list(found.history.logs) == [f"{side} {when} s{where}" for side in ("until", "from")]


@pytest.mark.parametrize("friction", [viscous(3.0), dry], ids=["viscous", "dry"])
def test_a_steady_cause_in_one_run_is_no_change(friction):
    found = pamid.diagnose(log_of(friction, sizes=(6.0,)), RAIL, LIBRARY)
    assert not found.changes
    assert not found.logs
