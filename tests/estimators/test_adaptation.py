"""Adaptation of a hybrid model to another muscle: factors, pipelines, searches, bad input, files."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from pamid.estimators import (
    FullFineTuning,
    LawRegressor,
    LoRA,
    PartialFineTuning,
    QAdapter,
    RateTransformer,
    ScaleAdapter,
    StaticPIHM,
)
from sklearn.base import clone
from sklearn.frozen import FrozenEstimator
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import Pipeline
from support.sources import MUSCLE_A, SIGNALS, table

from pamid.adapters.fine_tuning import FineTuning
from pamid.adapters.low_rank import LowRank
from pamid.errors import (
    AdaptationWarning,
    DuplicateColumnError,
    FitError,
    IncompatibleError,
    UnknownOptionError,
)
from pamid.laws.thermodynamic import ThermodynamicFlow
from pamid.persistence import load, save
from pamid.signals import TrajectoryKFold
from pamid.signals.state import State
from pamid.training import Adam


def state_of(model):
    return [w.copy() for w in model.weights_], model.volume_scale_, dict(model.get_params())


# --- the factor on the volume ---------------------------------------------------------------------------------
@pytest.mark.parametrize("base", ["frozen", "full", "low_rank", LowRank((1,)), FineTuning((0,))])
@pytest.mark.parametrize("source", ["flow", "published", "force"])
def test_q_is_found_and_the_source_stays(source, base, request):
    source = request.getfixturevalue(source)
    before = state_of(source)
    target = "F" if isinstance(source, StaticPIHM) else "mdot"
    few, more = table(1, rows=8, factor=4.2), table(2, factor=4.2)
    # force is divided by the rest length, which both muscles share here
    model = QAdapter(FrozenEstimator(source), rest_diameter=0.02, base=base, max_iter=5, random_state=0)
    model.fit(few, few[target])
    assert model.q0_ == pytest.approx(4.0)
    assert model.q0_uncertainty_ == pytest.approx(4 * np.sqrt(2 * 0.02**2 + 8 * 0.05**2))
    assert model.q_ == pytest.approx(4.2, rel=0.02)
    assert abs(model.q_ - 4.2) < 10 * model.q_uncertainty_ + 1e-3
    assert model.score(more, more[target]) > 0.95
    after = state_of(source)
    for a, b in zip(before[0], after[0], strict=True):
        np.testing.assert_array_equal(a, b)
    assert before[1:] == after[1:]


def test_without_sizes_the_data_decide_and_with_a_number_it_is_the_prior(flow):
    few = table(1, rows=8, factor=4.2)
    free = QAdapter(flow, base="frozen").fit(few, few["mdot"])
    assert free.q_ == pytest.approx(4.2, rel=0.02)
    assert free.q0_uncertainty_ == np.inf
    still = few.assign(mdot=np.random.default_rng(0).normal(size=len(few)))
    with pytest.warns(AdaptationWarning):
        unsure = QAdapter(flow, 4.0, base="frozen").fit(still.iloc[:3], still["mdot"].iloc[:3])
    assert unsure.q_ > 0


def test_algorithm_2_trains_q_with_the_network(published):
    few = table(1, rows=8, factor=4.2)
    model = QAdapter(published, 4.0, trainer="adam", max_iter=30, random_state=0).fit(few, few["mdot"])
    assert model.n_parameters_ == published.n_parameters_ + 1
    assert model.q_ == model.psi_[0][0] != 4.0
    assert abs(model.q_ - 4.0) <= 30 * 0.2e-4 * 1.01  # one full batch an epoch, each step at most 0.2 of the rate
    assert model.loss_curve_[-1] < model.loss_curve_[0]


def test_algorithm_2_wants_a_volume_of_the_network_alone(flow):
    """On an anchored source a factor on the network's output is not Q: refused, not left untrained."""
    few = table(1, rows=8, factor=4.2)
    for trainer in ("adam", Adam(max_iter=2)):
        with pytest.raises(IncompatibleError, match="volume_model='neural'"):
            QAdapter(flow, 4.0, trainer=trainer).fit(few, few["mdot"])


def test_adaptation_learns_what_is_not_a_factor(flow):
    def bent(data):
        return data["mdot"] * (1 + 0.3 * np.sin(20 * data["eps"]))

    few, more = table(1, rows=15, factor=4.0), table(2, factor=4.0)
    scores = {
        name: QAdapter(flow, 4.0, base=base, weight_decay=1e-6, blend=False, random_state=0)
        .fit(few, bent(few))
        .score(more, bent(more))
        for name, base in (("frozen", "frozen"), ("full", "full"), ("low", LowRank((2, 2))))
    }
    assert scores["full"] > scores["frozen"] + 0.2 * (1 - scores["frozen"])
    assert scores["low"] > scores["frozen"]


def test_prior_follows_what_held_out_trajectories_leave(flow):
    """Noise strengthens the pull, samples weaken it; a similar muscle stays below its noise, a bent one is followed."""
    few, more = table(1, rows=12, factor=4.0, noise=0.02), table(2, factor=4.0)

    def fitted(data, target, **options):
        return QAdapter(flow, 4.0, blend=False, random_state=0, **options).fit(data, target)

    alike = fitted(few, few["mdot"])
    for other, stronger in ((table(1, rows=12, factor=4.0, noise=0.1), True), (table(1, rows=48, factor=4.0), False)):
        assert (fitted(other, other["mdot"]).weight_decay_ > alike.weight_decay_) == stronger

    def error(model, target):
        return np.sqrt(np.mean((model.predict(more) - target) ** 2))

    assert error(alike, more["mdot"]) < 0.02 * more["mdot"].std()
    bend, bent = (1 + 0.3 * np.sin(20 * d["eps"]) for d in (few, more))
    free, held = (fitted(few, few["mdot"] * bend, **options) for options in ({}, {"base": "frozen"}))
    assert error(free, more["mdot"] * bent) < 0.8 * error(held, more["mdot"] * bent)
    unknown = QAdapter(flow, 4.0).fit(few[SIGNALS], few["mdot"])
    assert unknown.weight_decay_ == 1e-4


@pytest.mark.parametrize(
    "adapter",
    [FullFineTuning, PartialFineTuning, lambda s, **k: LoRA(s, ranks=(2, 2), **k)],
    ids=["full", "partial", "lora"],
)
@pytest.mark.parametrize("trainer", ["adam", "levenberg_marquardt"])
def test_other_adapters_lower_the_error_from_the_source_on(published, adapter, trainer):
    few = table(1, rows=10, factor=1.3)
    options = {"max_iter": 40 if trainer == "adam" else 8, "trainer": trainer, "random_state": 0}
    decay = {"weight_decay": 1e-6} if trainer != "adam" else {}
    model = adapter(published, **options, **decay).fit(few, few["mdot"])
    start = np.mean((published.predict(few[SIGNALS]) - few["mdot"]) ** 2)
    assert np.mean((model.predict(few) - few["mdot"]) ** 2) < start
    assert model.status_ in ("finished", "converged")


# --- scales -----------------------------------------------------------------------------------------------------
def test_scales_are_told_apart_by_force_and_flow(both):
    data = table(1, factor=2.0 * 1.5**2, dead=6e-6, length=0.4)
    Y = data[["F", "mdot"]].to_numpy()
    model = ScaleAdapter(both).fit(data, Y)
    assert model.length_factor_ == pytest.approx(2.0, rel=0.05)
    assert model.diameter_factor_ == pytest.approx(1.5, rel=0.05)
    assert model.dead_volume_ == pytest.approx(6e-6, rel=0.3)
    assert model.refused_ == {}
    assert model.model_.rest_length == pytest.approx(0.4, rel=0.05)
    assert model.score(data, Y) > 0.98
    gappy = Y.copy()
    gappy[::3, 0] = np.nan
    assert ScaleAdapter(both).fit(data, gappy).diameter_factor_ == pytest.approx(1.5, rel=0.05)


def test_flow_tells_a_dead_volume_and_force_does_not(flow, force):
    data = table(1, factor=4.0, dead=1.5e-5)
    model = ScaleAdapter(flow).fit(data, data["mdot"])
    assert model.diameter_factor_ == pytest.approx(2.0, rel=0.03)
    assert model.dead_volume_ == pytest.approx(1.5e-5, rel=0.2)
    assert ScaleAdapter(force).fit(data, data["F"]).diameter_factor_ == pytest.approx(2.0, rel=0.03)
    fixed = ScaleAdapter(flow, ("dead_volume",), rest_diameter=0.02).fit(data, data["mdot"])
    assert fixed.diameter_factor_ == 2.0
    assert fixed.dead_volume_ == pytest.approx(1.5e-5, rel=0.3)


def test_scales_that_cannot_be_told_are_refused(flow, force):
    data = table(1, factor=4.0)
    with pytest.raises(IncompatibleError, match="D²L"):
        ScaleAdapter(flow, ("length", "diameter")).fit(data, data["mdot"])
    with pytest.raises(IncompatibleError, match="lever"):
        ScaleAdapter(force, ("length",)).fit(data, data["F"])
    with pytest.raises(UnknownOptionError, match="dead_volume"):
        ScaleAdapter(flow, ("width",)).fit(data, data["mdot"])
    # held at one contraction, at which a dead volume is like a larger muscle
    state = State(np.full(len(data), 0.1), np.zeros(len(data)), data["P"].to_numpy(), data["dP"].to_numpy())
    held = data.assign(eps=state.eps, deps=state.deps)
    V = MUSCLE_A.jet(state).V
    held["mdot"] = held["dP"] * 4 * V.mean() / (1.4 * 287 * 293)
    with pytest.raises(FitError, match="do not determine"):
        ScaleAdapter(dataclasses_free(flow), ("diameter", "dead_volume")).fit(held, held["mdot"])
    automatic = ScaleAdapter(dataclasses_free(flow)).fit(held, held["mdot"])
    assert "dead_volume" in automatic.refused_
    assert automatic.dead_volume_ == 0.0


def dataclasses_free(model):
    """Return the model with a volume that does not depend on the pressure."""
    other = clone(model)
    other.__dict__.update({k: v for k, v in vars(model).items() if k.endswith("_")})
    other.anchor_ = dataclasses.replace(model.anchor_, contact_pressure=0.0, thread_compliance=0.0, contact_width=1.0)
    other.weights_ = [0.0 * w for w in model.weights_]
    return other


# --- pipelines, searches, files -------------------------------------------------------------------------------
def timed(data):
    return data.assign(time=data.groupby("trajectory").cumcount() * 0.1)[["trajectory", "time", "eps", "P"]]


def pipeline(source):
    return Pipeline(
        [
            ("rates", RateTransformer(columns=("eps", "P"))),
            ("volume", QAdapter(FrozenEstimator(source), rest_diameter=0.02, blend=False, max_iter=3, random_state=0)),
            ("law", LawRegressor("quasi_static", rest_length=0.2)),
        ]
    )


def test_pipeline_reads_as_the_paper_does(force, tmp_path):
    few = table(1, rows=40, factor=4.0)
    X, F = timed(few), few["F"]
    model = pipeline(force).fit(X, F)
    assert model.score(X, F) > 0.95
    volume = model[:-1].transform(X)
    assert list(volume.columns[-3:]) == ["V", "V_eps", "V_P"]
    assert (volume["V"] > 0).all()
    assert list(model[:-1].get_feature_names_out()) == list(volume.columns)
    np.testing.assert_allclose(model.predict(X), model["volume"].predict(model[:1].transform(X)), rtol=1e-9)

    again = clone(model).fit(X, F)
    np.testing.assert_allclose(again.predict(X), model.predict(X), rtol=1e-9)
    back = load(save(model, tmp_path / "adapted.pamid"))
    np.testing.assert_array_equal(back.predict(X), model.predict(X))
    refit = clone(back).fit(X, F)  # the source is in the file
    np.testing.assert_allclose(refit.predict(X), model.predict(X), rtol=1e-9)


def test_search_over_adapters_and_ranks(force):
    few = table(1, rows=20, factor=4.0)
    grid = {"volume__base": ["frozen", LowRank((1,)), LowRank((2, 2)), "full"]}
    search = GridSearchCV(pipeline(force), grid, cv=TrajectoryKFold(3), error_score="raise")
    search.fit(timed(few), few["F"])
    assert search.best_score_ > 0.9


def test_transformer_by_position_and_output(flow):
    few = table(1, factor=4.0)
    model = QAdapter(flow, 4.0, base="frozen", blend=False).fit(few[SIGNALS].to_numpy(), few["mdot"])
    out = model.transform(few[SIGNALS].to_numpy())
    assert out.shape == (len(few), 7)
    np.testing.assert_allclose(out[:, 4], model.volume(few[SIGNALS].to_numpy()).V)
    law = LawRegressor("thermodynamic").fit(out, few["mdot"])
    np.testing.assert_allclose(law.predict(out), model.predict(few[SIGNALS].to_numpy()))
    np.testing.assert_allclose(LawRegressor(ThermodynamicFlow()).fit(out, few["mdot"]).predict(out), law.predict(out))
    as_table = model.set_output(transform="pandas").transform(few[SIGNALS].to_numpy())
    assert list(as_table.columns[-3:]) == ["V", "V_eps", "V_P"]
    taken = few.assign(V_eps=0.0)
    with pytest.raises(DuplicateColumnError, match="V_eps"):
        QAdapter(flow, 4.0, base="frozen").fit(taken, few["mdot"]).transform(taken)


def test_adapted_models_are_sources_again(flow):
    one, two = table(1, factor=4.0), table(2, factor=9.0)
    first = QAdapter(FrozenEstimator(flow), 4.0, base="frozen").fit(one, one["mdot"])
    second = QAdapter(FrozenEstimator(first), 9 / 4, base="frozen").fit(two, two["mdot"])
    assert second.q_ == pytest.approx(9 / 4, rel=0.02)
    piped = Pipeline([("model", flow)])
    assert QAdapter(piped, 4.0, base="frozen").fit(one, one["mdot"]).q_ == pytest.approx(first.q_)


def test_adapters_are_saved_as_parameters(flow, tmp_path):
    few = table(1, factor=4.0)
    model = QAdapter(FrozenEstimator(flow), 4.0, base=LowRank((1, 2)), weight_decay=1e-4, max_iter=2, random_state=0)
    back = load(save(model.fit(few, few["mdot"]), tmp_path / "low.pamid"))
    np.testing.assert_array_equal(back.predict(few), model.predict(few))
    assert back.base == LowRank((1, 2))
    before = back.q_
    assert back.partial_fit(few, few["mdot"]).q_ == pytest.approx(before, rel=1e-3)


def test_warm_start_and_stream(flow):
    one = table(1, factor=4.0).assign(mdot=lambda d: d["mdot"] * (1 + 0.3 * np.sin(20 * d["eps"])))
    options = {"weight_decay": 1e-6, "random_state": 0, "base": "full"}
    short = QAdapter(flow, 4.0, max_iter=2, warm_start=True, **options).fit(one, one["mdot"])
    first = short.loss_curve_[-1]
    assert short.fit(one, one["mdot"]).loss_curve_[-1] < first
    cold = QAdapter(flow, 4.0, max_iter=2, **options).fit(one, one["mdot"])
    assert cold.fit(one, one["mdot"]).loss_curve_[-1] == pytest.approx(first)

    stream = QAdapter(flow, 4.0, **options).fit(one[:20], one["mdot"][:20])
    before = np.mean((stream.predict(one) - one["mdot"]) ** 2)
    for i in range(20, len(one), 40):
        stream.partial_fit(one[i : i + 40], one["mdot"][i : i + 40])
    assert np.mean((stream.predict(one) - one["mdot"]) ** 2) < before

    noisy = table(3, factor=4.0, noise=0.2)
    factor = QAdapter(flow, base="frozen").fit(noisy[:30], noisy["mdot"][:30])
    unsure = factor.q_uncertainty_
    for i in range(30, len(noisy), 30):
        factor.partial_fit(noisy[i : i + 30], noisy["mdot"][i : i + 30])
    assert factor.q_uncertainty_ < unsure
    assert abs(factor.q_ - 4.0) < 0.3
