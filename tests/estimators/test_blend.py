"""How much of its source an adaptation keeps: compared with a fresh fit of the same samples."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from pamid.estimators import FullFineTuning, LoRA, PartialFineTuning, QAdapter
from sklearn.frozen import FrozenEstimator
from support.sources import table

from pamid.adapters.source_process import _evidence
from pamid.errors import AdaptationWarning, ParameterError
from pamid.persistence import load, save


def other_muscle(data, seed=0, noise=2.0):
    """Force of a muscle that no factor makes of A: stiff at rest, another curve, another end."""
    p = data["P"] - 101_325
    force = 40 + 6e-4 * p * (1 - 2 * data["eps"] - 30 * data["eps"] ** 2) + 8e-10 * p**2
    return force + noise * np.random.default_rng(seed).normal(size=len(data))


def rmse(model, data, target):
    return np.sqrt(np.mean((model.predict(data) - target) ** 2))


@pytest.mark.parametrize("kind", [QAdapter, LoRA, PartialFineTuning, FullFineTuning])
def test_a_source_that_does_not_help_gives_way_to_a_fresh_fit(force, kind):
    few, more = table(1, rows=10), table(2)
    options = {"rest_diameter": 0.02, "max_iter": 5, "random_state": 0} | ({"ranks": (2,)} if kind is LoRA else {})
    whole = kind(force, blend=False, **options).fit(few, other_muscle(few))
    assert not whole.blend_.any()
    assert whole.source_kept_.tolist() == [1.0]
    with pytest.warns(AdaptationWarning, match="does not help"):
        mixed = kind(force, **options).fit(few, other_muscle(few))
    truth = other_muscle(more, noise=0.0)
    assert rmse(mixed, more, truth) < 0.5 * rmse(whole, more, truth)
    assert mixed.blend_[0] > 0.5
    assert mixed.source_kept_[0] < 0.9
    (errors,) = mixed.held_out_errors_
    assert errors["fresh"] < errors["adapted"]


def test_a_source_that_helps_is_kept_and_makes_a_fresh_fit_better(force):
    few, more = table(1, rows=5, factor=4.2, noise=0.02), table(2, factor=4.2)
    with warnings.catch_warnings():
        warnings.simplefilter("error", AdaptationWarning)
        mixed = QAdapter(force, 4.0, random_state=0).fit(few, few["F"])
    whole = QAdapter(force, 4.0, blend=False, random_state=0).fit(few, few["F"])
    (errors,) = mixed.held_out_errors_
    assert errors["adapted"] < errors["fresh"]
    assert mixed.source_kept_[0] == 1.0
    assert rmse(mixed, more, more["F"]) == rmse(whole, more, more["F"])


def test_a_fresh_fit_has_no_say_beyond_its_samples(force):
    few, more = table(1, rows=10), table(2)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mixed = QAdapter(force, base="frozen", random_state=0).fit(few, other_muscle(few))
        far = more.assign(dP=50.0 * few["dP"].abs().max())
        np.testing.assert_allclose(mixed.predict(far), mixed.model_.predict(far))
        assert not np.allclose(mixed.predict(few), mixed.model_.predict(few))


def test_a_blend_is_saved_scored_and_left_out_of_the_published_algorithm(force, both, tmp_path):
    few = table(1, rows=10)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mixed = QAdapter(FrozenEstimator(force), base="frozen", random_state=0).fit(few, other_muscle(few))
        again = load(save(mixed, tmp_path / "mixed.pamid"))
        published = LoRA(force, trainer="adam", max_iter=2, random_state=0).fit(few, other_muscle(few))
        target = np.column_stack([other_muscle(few), few["mdot"]])
        two = QAdapter(both, base="frozen", random_state=0).fit(few, target)
    np.testing.assert_array_equal(again.predict(few), mixed.predict(few))
    assert mixed.score(few, other_muscle(few)) > mixed.model_.score(few, other_muscle(few))
    assert published.held_out_errors_ == [{}]
    assert two.blend_.shape == two.source_kept_.shape == (2,)
    assert two.source_kept_[0] < two.source_kept_[1]
    with pytest.raises(ParameterError, match="blend"):
        QAdapter(force, blend="often").fit(few, few["F"])


def test_without_runs_stretches_are_held_out_and_gradients_of_the_evidence_are_right():
    from pamid.estimators._blend import _blocks

    assert np.array_equal(np.bincount(_blocks(None, 20)), [4] * 5)
    assert np.array_equal(_blocks(np.array([7, 7, 3, 3, 1, 1, 5]), 7), [3, 3, 1, 1, 0, 0, 2])
    rng = np.random.default_rng(0)
    z, strengths, rates = rng.normal(size=(3, 12, 2))
    value = _evidence(z, strengths, rates, rng.normal(size=12), np.ones(12), np.zeros(8))
    logs = 0.3 * rng.normal(size=8)
    by = [(value(logs + h)[0] - value(logs - h)[0]) / 2e-5 for h in 1e-5 * np.eye(8)]
    np.testing.assert_allclose(value(logs)[1], by, rtol=1e-5, atol=1e-6)
