"""A cause whose size may be none is named with reservations, however well it closes the gap."""

from dataclasses import replace

import numpy as np
import pytest

from pamid.effects import make_effect
from pamid.effects.limits import ForceLimit
from pamid.effects.numbers import ParameterDeviation
from pamid.gap.diagnosis.decide import Verdict
from pamid.gap.diagnosis.findings import ParameterEstimate
from pamid.gap.diagnosis.open_set import Trust
from pamid.gap.diagnosis.sized import sized, vanishes
from pamid.gap.inference.significance import Excess


class _Clusters:
    def __init__(self, effect, pieces=3):
        self.evidence = type("evidence", (), {"effects": {"cause": effect}})
        self.knows_scatter = pieces > 2


def grade(effect, pieces=3, **intervals):
    trust = {"cause": Trust(0.95, {"unsupported": 0.0})}
    estimates = {k: ParameterEstimate(1.0, "-", ci) for k, ci in intervals.items()}
    return sized(trust, _Clusters(effect, pieces), {"cause": estimates})["cause"].grade


@pytest.mark.parametrize(
    ("interval", "expected"), [((1.2, 3.0), "sure"), ((-0.66, 1e6), "reserve"), ((-0.5, -0.2), "sure")]
)
def test_a_factor_that_may_be_one_is_no_finding(interval, expected):
    assert grade(ParameterDeviation, deviation=interval) == expected


def test_a_size_that_reaches_from_one_end_to_the_other_is_none():
    low, high = ForceLimit.parameters[0].lower, ForceLimit.parameters[0].upper
    assert grade(ForceLimit, limit=(low, high)) == "reserve"
    assert grade(ForceLimit, limit=(0.4, 0.5)) == "sure"


def test_what_refines_an_effect_may_be_none():
    """The width of a velocity scale may be open while the friction is certain."""
    stribeck = type(make_effect("stribeck_friction"))
    some = {p.name: (0.5, 1.0) if p.linear else (p.lower, p.upper) for p in stribeck.parameters}
    assert grade(stribeck, **some) == "sure"


def test_no_term_of_several_is_the_whole_effect():
    terms = type(make_effect("directional_friction"))
    linear = [p for p in terms.parameters if p.linear]
    assert all(vanishes(terms, p) == (len(linear) == 1) for p in linear)


def test_two_runs_say_nothing_of_the_scatter():
    assert grade(ParameterDeviation, pieces=2, deviation=(-np.inf, np.inf)) == "sure"


def test_sizes_that_may_be_none_show_no_gap_that_residuals_do_not_show():
    verdict = Verdict("class", 0.001, outcome=None, excess=[Excess(1.0, 0.5)])
    assert verdict.rests_on_size and not replace(verdict, beyond=1e-4).rests_on_size
    assert verdict.without_gap().kind == "none" and verdict.without_gap().p_value == 0.1
