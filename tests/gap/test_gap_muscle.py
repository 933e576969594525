"""One muscle under several causes at once, some of which hide the others."""

import warnings

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import GapDiagnoser, GeometricForce

from pamid.effects import Signals, make_effect
from pamid.gap.inference.sensitivity import relinearised, templates
from pamid.gap.residuals.on_equation import OnEquation
from pamid.gap.residuals.single import SignalEvidence, Stated
from pamid.remembered import Remembered
from pamid.systems.muscle import Muscle

MUSCLE = Muscle(rest_length=0.3, rest_diameter=0.01)
PLANT = MUSCLE.plant()
BLADDER = {"rest": 40.0, "growth": 900.0, "curvature": 0.0}
SLACK = {"rounding": 12.0, "rest": 6.0}


def nominal(table):
    return (table["pressure"] - PLANT.atmospheric_pressure) * PLANT.volume_slope(table["position"]) / PLANT.rest_length


@pytest.fixture(scope="module")
def log():
    """A muscle held at four lengths and filled and vented twice at each; it hangs loose below a pressure."""
    rng, t, runs = np.random.default_rng(0), np.arange(0, 12, 0.01), []
    for k, eps in enumerate(np.repeat([0.0, 0.04, 0.08, 0.12], 2)):
        steps = np.minimum(np.floor(2 * t) / 12, 2 - np.floor(2 * t) / 12).clip(0.02)
        P = PLANT.atmospheric_pressure + 4.5e5 * steps * (1 + 0.03 * k % 2) + 60 * rng.standard_normal(len(t))
        table = {"position": np.full(len(t), eps), "pressure": P}
        bare = nominal(table) - BLADDER["rest"] - BLADDER["growth"] * eps
        F = make_effect("slack", **SLACK).measure(bare, None) + 0.3 * rng.standard_normal(len(t))
        runs.append(pd.DataFrame({"trajectory": str(k), "time": t, "eps": eps, "deps": 0.0, "P": P, "dP": 0.0, "F": F}))
    return pd.concat(runs, ignore_index=True)


def table_of(log):
    names = {"time": "time", "position": "eps", "velocity": "deps", "pressure": "P", "pressure_rate": "dP"}
    return {role: log[column].to_numpy() for role, column in names.items()}


@pytest.fixture(scope="module")
def evidence(log):
    starts = np.flatnonzero(np.diff(log["trajectory"].astype(int), prepend=-1))
    equation = OnEquation(table_of(log), nominal, 0.01, starts, "force", PLANT)
    return SignalEvidence(Stated(equation, log["F"].to_numpy()), [str(k) for k in range(len(starts))], contraction=True)


def test_slack_and_the_bladder_are_found_together(log):
    def predict(X):
        return nominal({"position": X["eps"].to_numpy(), "pressure": X["P"].to_numpy()})

    library = [
        "bladder_preload",
        "slack",
        "braid_geometry",
        "pressure_gain",
        "force_bias",
        "pressure_relaxation",
        "tube",
    ]
    found = GapDiagnoser(predict, library, plant=PLANT, random_state=0)
    found.fit(log.drop(columns=["F", "trajectory"]), log["F"], groups=log["trajectory"])
    assert set(found.effects_) == {"bladder_preload", "slack"}
    assert found.effects_["bladder_preload"]["rest"] == pytest.approx(40.0, rel=0.1)
    assert found.effects_["slack"]["rest"] == pytest.approx(6.0, abs=1.0)
    assert found.closure_[0].closed_share > 0.99


def test_templates_beside_slack_act_where_the_muscle_is_taut(evidence):
    [plain] = templates(evidence, "braid_geometry")
    spec = {"bladder_preload": BLADDER, "slack": SLACK}
    [beside] = relinearised(evidence, [plain], spec)
    h = 1e-7
    exact = (evidence.z({**spec, "braid_geometry": {"pulling": h, "pushing": 0.0}}) - evidence.z(spec)) / h
    assert np.allclose(beside.columns[:, 0], exact, rtol=0.02, atol=0.01 * np.abs(exact).max())
    loose = evidence.measured < 7.0
    assert loose.any() and np.abs(beside.columns[loose]).max() < 0.5 * np.abs(plain.columns[loose]).max()
    assert relinearised(evidence, [plain], {})[0] is plain


def test_a_loose_muscle_holds_what_it_rests_at():
    slack = make_effect("slack", rounding=10.0, rest=5.0)
    tension = np.array([-500.0, 5.0, 300.0])
    reading = slack.measure(tension, None)
    assert reading == pytest.approx([5.0, 10.0, 300.0], abs=0.2)
    assert slack.restore(reading, 0.01, np.array([0])) == pytest.approx([5.0, 5.0, 300.0], abs=0.2)


def test_the_geometry_of_a_thicker_braid_is_two_areas():
    thick = Muscle(rest_length=0.3, rest_diameter=0.012).plant()
    eps, P = np.linspace(0, 0.2, 5), np.full(5, 4e5)
    more = (P - PLANT.atmospheric_pressure) * (thick.volume_slope(eps) - PLANT.volume_slope(eps)) / 0.3
    area, angle = np.pi / 4 * (0.012**2 - 0.01**2), np.radians(25.0)
    effect = make_effect("braid_geometry", pulling=3 * area / np.tan(angle) ** 2, pushing=area / np.sin(angle) ** 2)
    assert effect.force(Signals(position=eps, pressure=P), None, PLANT) == pytest.approx(more)


def test_what_is_remembered_has_an_end():
    kept, made = Remembered(100, lambda x: x.nbytes), []

    def make(k):
        made.append(k)
        return np.zeros(5)

    for k in (0, 1, 0, 2, 1):
        kept.get(k, lambda k=k: make(k))
    assert made == [0, 1, 2, 1]  # 1 was the oldest when 2 came


def test_areas_that_the_model_lacks_act_with_what_a_threshold_leaves(evidence):
    spec = {"threshold_pressure": {"pressure": 6e4, "growth": 1e6, "onset": 1e3}}
    more = {"braid_geometry": {"pulling": -1e-4, "pushing": -2e-4}}

    def modelled(spec):
        return evidence.equation.modelled(evidence.active(spec))

    left = modelled(spec | more) - modelled(spec)
    s = Signals(**{role: evidence.equation.table[role] for role in ("position", "pressure")})
    pressing = make_effect("threshold_pressure", **spec["threshold_pressure"]).braid_pressure(s, PLANT)
    areas = -1e-4 * (1.0 - s.position) ** 2 + 2e-4
    np.testing.assert_allclose(left, (pressing - PLANT.atmospheric_pressure) * areas, atol=1e-9)
    alone = modelled(more) - modelled({})
    assert np.abs(left).max() < 0.95 * np.abs(alone).max()


def test_a_muscle_that_is_known_pulls_whichever_sign_would_explain_more(log):
    """A geometry that is fitted without the rest length lies too low at one contraction, and too high at another."""
    law = make_effect("constant_area", area=7.7e-4, growth=1.4e6, displacement=3e-3, onset=6e4)
    held = log[(log["eps"] > 0.01) & (log.groupby("trajectory").cumcount() % 3 == 0)].reset_index(drop=True)
    P = PLANT.atmospheric_pressure + 1.5 * (held["P"].to_numpy() - PLANT.atmospheric_pressure)
    held = held.assign(P=P)
    table = {"position": held["eps"].to_numpy(), "pressure": P}
    F = nominal(table) + law.force(Signals(**table), None, PLANT)
    held["F"] = F + 0.3 * np.random.default_rng(1).standard_normal(len(F))
    state, taut = ["eps", "deps", "P", "dP"], held["F"] > 5.0
    model = GeometricForce("chou_hannaford", rest_length=0.3, rest_diameter=0.01)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the braid comes out far too wide
        model.fit(held.loc[taut, state], held.loc[taut, "F"])
    sizes = {name: model.parameters_[name] for name in ("rest_diameter", "braid_angle")}
    plant = Muscle(rest_length=0.3, **sizes).plant()
    found = GapDiagnoser(lambda X: model.predict(X[state]), ["constant_area"], plant=plant, random_state=0)
    found.fit(held[["time", *state]], held["F"], groups=held["trajectory"], where=taut)
    assert found.scaling_.target > 0.0
    assert set(found.effects_) == {"constant_area"}
    assert found.effects_["constant_area"]["area"] == pytest.approx(7.7e-4, rel=0.05)
    assert found.closure_[0].closed_share > 0.95
