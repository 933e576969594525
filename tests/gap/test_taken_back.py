"""Two causes of which one cancels what the other does to a further equation stand for something else."""

from types import SimpleNamespace

import numpy as np
import pytest

from pamid.gap.diagnosis import open_set
from pamid.gap.diagnosis.taken_back import taken_back
from pamid.gap.diagnosis.trusted import BESIDE

TIME = np.linspace(0.0, 1.0, 200)


def set_of_two(there, back, slope=0.0):
    """Return two causes of which the first acts in both equations and the second in the second one."""
    main, none = 50.0 * np.sin(9.0 * TIME), np.zeros(200)
    changes = {"first": np.r_[main, there * (1.0 + slope * TIME)], "second": np.r_[none, back * (1.0 + slope * TIME)]}
    evidence = SimpleNamespace(
        parts=[slice(0, 200), slice(200, 400)], weights=[1.0, 1.0], exact=False, simulates=True,
        slopes=lambda spec, x: np.r_[none, TIME][:, None],
    )  # fmt: skip
    best = SimpleNamespace(fit=SimpleNamespace(spec=dict.fromkeys(changes), x=np.zeros(1), scales=[1.0, 1.0]))
    return SimpleNamespace(evidence=evidence, discrepancy=SimpleNamespace(whole=lambda fit: changes)), best


@pytest.mark.parametrize(
    ("there", "back", "slope", "shares"),
    [
        (5.0, -5.0, 0.0, (1.0, 1.0)),  # a second offset cancels what the first one does elsewhere
        (5.0, -5.0, -0.7, (1.0, 1.0)),  # whatever part of it a tolerance could have done as well
        (5.0, 0.0, 0.0, (0.0, 0.0)),
        (5.0, -1.0, 0.0, (0.36, 0.0)),  # too small to be what it is for
        (5.0, 5.0, 0.0, (0.0, 0.0)),
        (0.01, -0.01, 0.0, (0.0, 0.0)),  # no log would show it
    ],
)
def test_what_others_cancel_in_an_equation_is_measured_beyond_the_noise(there, back, slope, shares):
    found = taken_back(*set_of_two(there, back, slope))
    assert (found["first"], found["second"]) == pytest.approx(shares)


@pytest.mark.parametrize(("back", "grade"), [(-5.0, "reserve"), (0.0, "sure")])
def test_a_cause_that_needs_another_one_to_cancel_what_it_does_elsewhere_is_not_sure(monkeypatch, back, grade):
    signs = {name: {**dict.fromkeys(BESIDE, 0.0), "left_where_it_acts": 0.0} for name in ("first", "second")}
    monkeypatch.setattr(open_set, "signs_of", lambda *a: signs)
    competition, best = set_of_two(5.0, back)
    found = open_set.trust(competition, SimpleNamespace(best=best), {}, {})
    assert found["first"].grade == grade
