"""A corrected simulator that leaves most of the gap when it is run again takes the certainty of a name."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from pamid.gap import Cause, Closure, Diagnosis
from pamid.gap.evaluation import residuals_of
from pamid.gap.rerun import closes, tried
from pamid.gap.residuals.shooting import ShootingEvidence
from pamid.simulators import EquationSimulator, Port
from pamid.simulators.port_log import port_log


def found(equation="joint", low=0.9, allowed=""):
    closure = Closure(equation, 2.0, 1.1, 1.0, 0.95, (low, 1.0), allowed=allowed)
    cause = Cause(("friction",), equation, 0.95, 0.95, (low, 1.0), {})
    blank = {"p_value": 0.0, "equations": [], "regions": [], "bands": [], "trajectories": [], "candidates": []}
    rest = {"next_run": None, "notes": [], "nominal": None, "windows": None}
    return Diagnosis(verdict="cause", causes=[cause], closure=[closure], corrected=object(), **blank, **rest)


@pytest.mark.parametrize(
    ("rmse", "given", "grade"),
    [
        (1.1, {}, "sure"),
        (2.0, {}, "reserve"),
        (1.75, {}, "reserve"),
        (2.0, {"low": 0.3}, "sure"),  # not said to close more
        (2.0, {"allowed": "timing of u"}, "sure"),  # the report says what else it takes
    ],
)
def test_a_name_is_sure_only_if_the_simulator_follows(monkeypatch, rmse, given, grade):
    left = {"joint": SimpleNamespace(rmse=rmse, unit="")}
    monkeypatch.setattr("pamid.gap.evaluation.evaluate", lambda log, sim: left)
    d = tried(found(**given), None)
    assert [c.grade for c in d.causes] == [grade] and d.with_reserve == (grade == "reserve")


def test_what_a_corrected_simulator_closes_is_asked_once(monkeypatch):
    asked = []
    left = {"joint": SimpleNamespace(rmse=1.1, unit="")}
    monkeypatch.setattr("pamid.gap.evaluation.evaluate", lambda log, sim: asked.append(sim) or left)
    d = tried(found(), None)
    assert closes(d, None, d.corrected) == {"joint": d.closure[0].again} == {"joint": pytest.approx(0.93)}
    assert asked == [d.corrected]
    closes(d, None, object())  # one that was written in another form
    assert len(asked) == 2


def test_a_corrected_simulator_is_judged_over_the_stretches_of_the_diagnosis():
    swing = EquationSimulator({"dx/dt": "v", "dv/dt": "u - x"}, [Port("u", "input", "N"), Port("x", "state", "m"),
                                                                 Port("v", "state", "m/s")], {})  # fmt: skip
    t = np.arange(0, 8, 0.02)
    log = pd.DataFrame({"trajectory": "run", "time": t, "u": 0.0 * t, "x": 1.1 * np.cos(t)})
    given = ShootingEvidence(port_log(log, swing), swing, longest=100)
    again = residuals_of(log, swing.with_({}, [("sensor_gain", "x", {"deviation": 0.1})]), like=given)
    assert again.stretches == given.stretches and len(given.stretches) > 1
    assert again.simulator.effects and not given.simulator.effects
