"""Parameters refitted within their tolerances, as `pamid evaluate --refit` does it: what is left then is a gap."""

from __future__ import annotations

import pytest
from support.bench_logs import NOMINAL

from pamid.equations import evaluate_log
from pamid.gap import refit_within_tolerance


def test_refit_undoes_a_parameter_within_tolerance(log):
    off = NOMINAL.replace(rest_diameter=0.02 * 1.004, sonic_conductance=6e-9 * 0.985, inertia=0.02 * 1.015)
    before = evaluate_log(log, off)
    assert before["force"].rmse > 10 * before["force"].noise_floor
    fit = refit_within_tolerance(log, off)
    after = evaluate_log(log, fit.params)
    for name, e in after.items():
        assert e.rmse < 1.2 * e.noise_floor, name
    assert fit.params.get("rest_diameter") == pytest.approx(0.02, rel=1.5e-3)
    assert fit.params.get("sonic_conductance") == pytest.approx(6e-9, rel=1e-3)
    assert not fit.at_bound


def test_refit_stops_at_the_tolerance(log):
    fit = refit_within_tolerance(log, NOMINAL.replace(sonic_conductance=7e-9))
    assert fit.at_bound == ("sonic_conductance",)
    assert fit.params.get("sonic_conductance") == pytest.approx(7e-9 * 0.98, rel=1e-3)


def test_refit_without_tolerances_changes_nothing(log):
    bare = NOMINAL.replace(tolerance={})
    assert refit_within_tolerance(log, bare).params is bare
