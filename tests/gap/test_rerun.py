"""A corrected simulator that leaves most of the gap when it is run again takes the certainty of a name."""

from types import SimpleNamespace

import pytest

from pamid.gap import Cause, Closure, Diagnosis
from pamid.gap.rerun import tried


def found(equation="joint", low=0.9, allowed=""):
    closure = Closure(equation, 2.0, 1.1, 1.0, 0.95, (low, 1.0), allowed=allowed)
    cause = Cause(("friction",), equation, 0.95, 0.95, (low, 1.0), {})
    blank = {"p_value": 0.0, "equations": [], "regions": [], "bands": [], "trajectories": [], "candidates": []}
    rest = {"next_experiment": None, "notes": [], "nominal": None, "windows": None}
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
    monkeypatch.setattr("pamid.gap.evaluate", lambda log, sim: {"joint": SimpleNamespace(rmse=rmse, unit="")})
    d = tried(found(**given), None)
    assert [c.grade for c in d.causes] == [grade] and d.with_reserve == (grade == "reserve")
