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
