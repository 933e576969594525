"""The hybrid models recover a volume that is known, and hold where they have no data."""

from __future__ import annotations

import pickle
import warnings

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import JointPIHM, StaticPIHM, ThermodynamicPIHM
from sklearn.base import clone

from pamid import load, save
from pamid.errors import (
    ExcitationWarning,
    MissingTrajectoryError,
    ParameterError,
    TooFewTrajectoriesError,
    UnitWarning,
    UnknownOptionError,
)
from pamid.laws.quasi_static import QuasiStaticForce
from pamid.laws.thermodynamic import ThermodynamicFlow
from pamid.signals.state import State
from pamid.volume import volume_class
from pamid.volume.contact import ContactVolume

QUICK = {"hidden_layer_sizes": (12,), "max_iter": 30, "random_state": 0}
MUSCLE = {"rest_length": 0.2, "rest_diameter": 0.02}
TRUTH = volume_class("chou_hannaford")(0.2, 0.02, np.radians(25.0))


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    """Six runs of a braided muscle whose volume is known."""
    parts = []
    for k in range(6):
        t = np.linspace(0, 3, 120)
        w, v = 1.0 + k, 2.0 + 0.7 * k
        eps, deps = 0.12 + 0.06 * np.sin(w * t + k), 0.06 * w * np.cos(w * t + k)
        P, dP = 3e5 + 8e4 * np.sin(v * t), 8e4 * v * np.cos(v * t)
        parts.append(pd.DataFrame({"trajectory": f"sine-{k}", "eps": eps, "deps": deps, "P": P, "dP": dP}))
    out = pd.concat(parts, ignore_index=True)
    state = State(*(out[c].to_numpy() for c in State._fields))
    jet = TRUTH.jet(state)
    out["F"] = QuasiStaticForce(0.2).predict(*jet, state)
    out["mdot"] = ThermodynamicFlow().predict(*jet, state)
    return out


def signals(table: pd.DataFrame) -> pd.DataFrame:
    return table[list(State._fields)]


def truth(table: pd.DataFrame):
    return TRUTH.jet(State(*(table[c].to_numpy() for c in State._fields)))


@pytest.mark.parametrize(("volume_model", "max_iter", "error"), [("anchored", 30, 0.01), ("neural", 120, 0.05)])
def test_force_tells_the_slope_of_the_volume(table, volume_model, max_iter, error):
    settings = QUICK | {"max_iter": max_iter}
    model = StaticPIHM(**MUSCLE, volume_model=volume_model, **settings).fit(signals(table), table["F"])
    found = model.volume(signals(table)).V_eps
    assert np.sqrt(np.mean((found / truth(table).V_eps - 1) ** 2)) < error


def test_flow_tells_the_volume_up_to_what_no_flow_shows(table):
    """A volume that falls like P^(-1/γ) takes no gas: flow tells V + γ P ∂V/∂P and ∂V/∂ε, not the level by itself."""
    model = ThermodynamicPIHM(**MUSCLE, **QUICK).fit(signals(table), table["mdot"])
    jet, wanted = model.volume(signals(table)), truth(table)
    shown = jet.V + 1.4 * table["P"].to_numpy() * jet.V_P
    assert np.sqrt(np.mean((shown / wanted.V - 1) ** 2)) < 0.05
    assert model.score(signals(table), table["mdot"]) > 0.9999


def test_one_volume_serves_both_laws_with_gaps_in_one_of_them(table):
    Y = table[["F", "mdot"]].to_numpy()
    Y[::2, 0] = np.nan
    model = JointPIHM(**MUSCLE, **QUICK).fit(signals(table), Y)
    assert model.predict(signals(table)).shape == Y.shape
    assert model.score(signals(table), Y) > 0.998
    with pytest.raises(ValueError, match="2, as in the fit"):
        model.partial_fit(signals(table), table["F"])


def test_the_correction_fades_outside_the_data(table):
    bent = table["F"] * (1 + 0.1 * np.sin(40 * table["eps"]))
    model = StaticPIHM(**MUSCLE, **QUICK).fit(signals(table), bent)
    far = State(*(np.array([v]) for v in (0.45, 0.0, 8e5, 0.0)))
    near = State(*(np.array([v]) for v in (0.12, 0.0, 3e5, 0.0)))
    correction = {
        name: abs(float(model.volume_.correction.jet(state).V_eps[0])) for name, state in (("far", far), ("near", near))
    }
    assert correction["near"] > 0
    assert correction["far"] < 1e-3 * float(model.anchor_.jet(near).V_eps[0])


def test_the_anchor_keeps_the_axioms():
    volume = ContactVolume(0.2, 2.5e-3, 0.2, 1.0, 4e5, 0.05, 2e4, 6e-5, 2e-8)
    eps, P = np.linspace(0.01, 0.19, 40), np.linspace(1.5e5, 7e5, 40)
    zero = np.zeros(40)
    at = lambda e, p: volume.jet(State(e, zero, p, zero))  # noqa: E731
    jet, h = at(eps, P), 1e-6
    assert (jet.V > 0).all()
    assert np.allclose(
        (at(eps + h, P).V - at(eps - h, P).V) / (2 * h), jet.V_eps, rtol=1e-3, atol=1e-3 * jet.V_eps.max()
    )
    assert np.allclose((at(eps, P + 1.0).V - at(eps, P - 1.0).V) / 2.0, jet.V_P, rtol=1e-3, atol=1e-16)
    force = QuasiStaticForce(0.2)
    rest = State(eps, zero, np.full(40, 101_325.0), zero)
    assert np.allclose(force.predict(*volume.jet(rest), rest), 0.0)
    limit = volume.slope(0.1, np.array([-1e-9, 0.0, 1e-9]))
    assert np.ptp(limit) < 1e-9 * abs(limit).max() + 1e-15


def test_early_stopping_needs_trajectories_and_takes_either(table):
    X = signals(table)
    with pytest.raises(MissingTrajectoryError, match="trajectory"):
        StaticPIHM(**MUSCLE, validation_fraction=0.3, **QUICK).fit(X, table["F"])
    by_groups = StaticPIHM(**MUSCLE, validation_fraction=0.3, **QUICK).fit(X, table["F"], groups=table["trajectory"])
    by_column = StaticPIHM(**MUSCLE, validation_fraction=0.3, **QUICK)
    by_column.fit(table[["trajectory", *X.columns]], table["F"])
    assert len(by_groups.validation_curve_) == by_groups.n_iter_
    assert np.allclose(by_groups.predict(X), by_column.predict(table[["trajectory", *X.columns]]))
    with pytest.raises(TooFewTrajectoriesError):
        StaticPIHM(validation_fraction=0.3, **QUICK).fit(X, table["F"], groups=np.repeat([0, 1], len(X) // 2))


def test_a_seed_gives_the_same_numbers_and_no_other_state_moves(table):
    before = np.random.get_state()[1].copy()  # noqa: NPY002
    one, two = (StaticPIHM(**MUSCLE, **QUICK).fit(signals(table), table["F"]).predict(signals(table)) for _ in "ab")
    assert (one == two).all()
    assert (np.random.get_state()[1] == before).all()  # noqa: NPY002


def test_models_are_cloned_pickled_and_saved(table, tmp_path):
    model = ThermodynamicPIHM(**MUSCLE, **QUICK).fit(signals(table), table["mdot"])
    wanted = model.predict(signals(table))
    for again in (pickle.loads(pickle.dumps(model)), load(save(model, tmp_path / "flow.pamid"))):
        assert (again.predict(signals(table)) == wanted).all()
    assert not hasattr(clone(model), "weights_")


def test_prediction_in_pieces_is_that_of_the_whole(table, monkeypatch):
    model = StaticPIHM(**MUSCLE, **QUICK).fit(signals(table), table["F"])
    whole = model.predict(signals(table))
    monkeypatch.setattr("pamid.estimators._hybrid_use.CHUNK", 97)
    assert np.allclose(model.predict(signals(table)), whole, rtol=1e-12)


def test_partial_fit_follows_a_muscle_that_drifts(table):
    X, drifted = signals(table), 0.95 * table["F"]
    model = StaticPIHM(**MUSCLE, **QUICK).fit(X, table["F"])
    before = model.score(X, drifted)
    for _ in range(5):
        model.partial_fit(X, drifted)
    assert model.score(X, drifted) > max(before, 0.99)


@pytest.mark.parametrize("trainer", ["adam", "levenberg_marquardt"])
def test_single_precision(table, trainer):
    settings = QUICK | {"max_iter": 5}
    model = StaticPIHM(**MUSCLE, trainer=trainer, dtype="float32", **settings).fit(signals(table), table["F"])
    assert model.predict(signals(table)).dtype == np.float64


@pytest.mark.parametrize(
    ("settings", "error", "words"),
    [
        ({"rest_length": 200.0}, ParameterError, "looks like mm"),
        ({"rest_diameter": -1.0}, ParameterError, "positive length"),
        ({"volume_model": "cubic"}, UnknownOptionError, "anchored, neural"),
        ({"trainer": "sgd"}, UnknownOptionError, "levenberg_marquardt"),
        ({"dtype": "float16"}, UnknownOptionError, "float32"),
        ({"validation_fraction": 1.5}, ParameterError, "share"),
        ({"max_iter": 0}, ParameterError, "at least 1"),
    ],
)
def test_parameters_out_of_their_domain(table, settings, error, words):
    with pytest.raises(error, match=words):
        StaticPIHM(**(QUICK | settings)).fit(signals(table), table["F"])


def test_warnings_come_before_the_fit(table):
    settings = QUICK | {"max_iter": 1}
    with pytest.warns(UnitWarning):
        StaticPIHM(**MUSCLE, **settings).fit(signals(table).assign(P=table["P"] / 1e5), table["F"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnitWarning)
        with pytest.warns(ExcitationWarning, match="constant"):
            StaticPIHM(**MUSCLE, **settings).fit(signals(table), np.full(len(table), 100.0))
