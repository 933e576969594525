"""The diagnosis of one equation on systems that are no muscles, with inputs as they come."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
import sklearn
from pamid.estimators import GapDiagnoser
from sklearn.base import clone
from sklearn.frozen import FrozenEstimator
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from pamid import persistence
from pamid.errors import ExcitationError, MissingColumnError, TimeOrderError, UnknownOptionError

FEW = (
    "coulomb_friction",
    "viscous_friction",
    "bladder_elasticity",
    "force_bias",
    "quadratic_drag",
    "creep",
    "hysteresis",
)
AREA = 4.9e-4


def runs(make, n):
    rng = np.random.default_rng(4)
    return pd.concat([make(k, rng).assign(run=f"run {k}") for k in range(n)], ignore_index=True)


def stroke(k, t):
    return 50 + 40 * np.sin(0.6 * (1 + 0.4 * k) * t) + 6 * np.sin(3.3 * t + k)


def cylinder(add):
    """Stroke in mm at 50 Hz, pressure in Pa; nominal is P A."""

    def make(k, rng):
        t = np.arange(0, 16, 0.02)
        x, p = stroke(k, t), (1 + k) * 1e5 * (1 + 0.05 * np.sin(2 * t))
        F = AREA * p + add(x, np.gradient(x, t), p) + 0.3 * rng.standard_normal(len(t))
        return pd.DataFrame({"t": t, "stroke": x, "p": p, "F": F})

    return runs(make, 3)


def push(X):
    return AREA * X["p"].to_numpy()


CYLINDER = {"nominal": push, "signals": {"time": "t", "position": "stroke", "pressure": "p"}, "random_state": 0}
COLUMNS = ["t", "stroke", "p"]


def diagnosed(table, columns, target, effects=FEW, **settings):
    return GapDiagnoser(effects=effects, **settings).fit(table[columns], table[target], groups=table["run"])


@pytest.fixture(scope="module")
def rubbing():
    table = cylinder(lambda x, v, p: -8 * np.tanh(v / 0.5))
    return table, diagnosed(table, COLUMNS, "F", **CYLINDER)


def test_cylinder_with_seal_friction(rubbing):
    """Another form of friction than the library's is named friction, with its force in newtons."""
    table, found = rubbing
    assert found.verdict_ == "cause"
    assert found.causes_[0].effects == ("coulomb_friction",)
    assert found.effects_["coulomb_friction"]["amplitude"] == pytest.approx(8, rel=0.1)
    low, high = found.causes_[0].parameters["amplitude"].ci90
    assert low < found.effects_["coulomb_friction"]["amplitude"] < high
    assert found.closure_[0].closed_share > 0.9
    before = np.sqrt(np.mean((table["F"] - push(table)) ** 2))
    after = np.sqrt(np.mean((table["F"] - found.predict(table[COLUMNS], groups=table["run"])) ** 2))
    assert after < 0.3 * before
    assert found.score(table[COLUMNS], table["F"], groups=table["run"]) > 0.99
    assert sum(c.confidence for c in found.candidates_) == pytest.approx(1)
    assert {t.trajectory for t in found.where_["trajectories"]} == {"run 0", "run 1", "run 2"}
    assert np.ptp(found.diagnosis_.windows["time"]) == pytest.approx(16, abs=0.5)


def test_without_the_cause_in_the_library_it_is_unknown(rubbing):
    found = diagnosed(rubbing[0], COLUMNS, "F", effects=("bladder_elasticity", "force_bias"), **CYLINDER)
    assert found.verdict_ == "unknown"
    assert found.effects_ == {}
    assert found.gap_


def test_no_gap():
    found = diagnosed(cylinder(lambda x, v, p: 0.0), COLUMNS, "F", **CYLINDER)
    assert (found.verdict_, found.gap_, found.causes_) == ("none", False, [])
    assert found.p_value_ > 0.01


def test_biased_force_sensor():
    found = diagnosed(cylinder(lambda x, v, p: 3.0), COLUMNS, "F", **CYLINDER)
    assert found.causes_[0].effects[0] == "force_bias"
    assert found.effects_["force_bias"]["offset"] == pytest.approx(3, abs=0.1)


def test_units_do_not_matter(rubbing):
    """Metres, minutes and kilonewtons get the same name, and the same friction in the new unit."""
    table = rubbing[0].assign(t=rubbing[0]["t"] / 60, stroke=rubbing[0]["stroke"] / 1000, F=rubbing[0]["F"] / 1000)
    other = diagnosed(table, COLUMNS, "F", **{**CYLINDER, "nominal": lambda X: push(X) / 1000})
    assert other.causes_[0].effects == ("coulomb_friction",)
    assert other.effects_["coulomb_friction"]["amplitude"] == pytest.approx(8e-3, rel=0.1)


def test_servo_that_is_moved_by_its_torque():
    """Torque adds friction to what the model needs; the angle is in rad, quantised, and runs are few."""

    def make(k, rng):
        t = np.arange(0, 6, 0.005)
        q = np.sin((1 + k) * t) + 0.3 * np.sin(2.7 * t + k)
        v = np.gradient(q, t)
        tau = 0.48 * np.sin(q) + 0.05 * np.tanh(v / 0.02) + 0.003 * rng.standard_normal(len(t))
        return pd.DataFrame({"t": t, "q": np.round(q / 0.0015) * 0.0015, "tau": tau})

    settings = {"equation": "torque", "signals": {"time": "t", "position": "q"}, "random_state": 0}
    table = runs(make, 3)
    library = (*FEW, "gravity", "joint_damping")
    nominal = {"nominal": lambda X: 0.48 * np.sin(X["q"].to_numpy())}
    found = diagnosed(table, ["t", "q"], "tau", library, **settings, **nominal)
    assert found.causes_[0].effects == ("coulomb_friction",)
    assert found.effects_["coulomb_friction"]["amplitude"] == pytest.approx(0.05, rel=0.15)
    assert any("added to y" in note for note in found.diagnosis_.notes)
    weight = diagnosed(table, ["t", "q"], "tau", library, **settings)
    assert "gravity" in weight.effects_
    assert weight.effects_["gravity"]["moment"] == pytest.approx(0.48, rel=0.05)


def test_a_clean_viscous_torque_adds_to_what_moves_the_joint():
    """A late angle would look much the same, in either sense; it is the damper that tells which way."""

    def make(k, rng):
        t = np.arange(0, 8, 0.004)
        w = (1.0, 2.3, 4.0)[k]
        q, dq = 0.5 * np.sin(w * t), 0.5 * w * np.cos(w * t)
        tau = 0.8 * np.sin(q) - 0.02 * w * w * q + 0.05 * dq + 0.002 * rng.standard_normal(len(t))
        return pd.DataFrame({"t": t, "q": q, "dq": dq, "ddq": -w * w * q, "tau": tau})

    found = diagnosed(
        runs(make, 3),
        ["t", "q", "dq", "ddq"],
        "tau",
        (*FEW, "joint_damping", "gravity", "angle_delay", "angle_gain", "force_gain", "force_lag"),
        nominal=lambda X: 0.8 * np.sin(X["q"].to_numpy()) + 0.02 * X["ddq"].to_numpy(),
        signals={"time": "t", "position": "q", "velocity": "dq"},
        equation="torque",
        units={"target": "N m", "position": "rad"},
        random_state=0,
    )
    assert found.scaling_.target < 0
    assert found.causes_[0].effects == ("viscous_friction",)
    p = found.causes_[0].parameters["coefficient"]
    assert (p.value, p.unit) == (pytest.approx(0.05, rel=0.03), "N m s/rad")


def test_a_model_with_a_root_under_a_sensor_that_may_be_wrong():
    """An outlet's flow grows with the root of the level, which no candidate may make negative."""

    def make(k, rng):
        t = np.arange(0, 8, 0.01)
        h = 0.5 + 0.3 * np.sin((1 + 0.5 * k) * t) + 0.1 * np.sin(3.1 * t)
        return pd.DataFrame({"t": t, "h": h, "Q": 2e-3 * np.sqrt(h) + 3e-4 * h + 2e-5 * rng.standard_normal(len(t))})

    settings = {"equation": "flow", "signals": {"time": "t", "pressure": "h"}, "random_state": 0}
    found = diagnosed(
        runs(make, 3), ["t", "h"], "Q", "all", nominal=lambda X: 2e-3 * np.sqrt(X["h"].to_numpy()), **settings
    )
    assert found.gap_ and found.closure_[0].closed_share > 0.9


def test_falling_body_filmed():
    """Sixty pictures a second, 1.6 s: a model of free fall lacks drag."""

    def make(k, rng):
        t = np.arange(0, 1.6, 1 / 60)
        v = 3.5 * np.tanh(9.81 * t / 3.5)
        noise = rng.standard_normal((3, len(t)))
        x = 3.5**2 / 9.81 * np.log(np.cosh(9.81 * t / 3.5)) + 0.001 * noise[0]
        a = 9.81 * (1 - (v / 3.5) ** 2) + 0.15 * noise[1]
        return pd.DataFrame({"t": t, "x": x, "v": v + 0.01 * noise[2], "a": a})

    found = diagnosed(
        runs(make, 3),
        ["t", "x", "v"],
        "a",
        nominal=lambda X: np.full(len(X), 9.81),
        signals={"time": "t", "position": "x", "velocity": "v"},
    )
    assert found.causes_[0].effects[0] == "quadratic_drag"


def test_creeping_polymer():
    """A load that is changed every few minutes, displacement at 1 Hz over an hour; the load stands for a position."""

    def make(k, rng):
        load = np.repeat(rng.uniform(0, 5, 9), 300)
        slow = np.empty(len(load))
        slow[0] = load[0]
        for i in range(1, len(load)):
            slow[i] = slow[i - 1] + (load[i] - slow[i - 1]) / 40
        y = 20 * load - 6 * (load - slow) + 0.1 * rng.standard_normal(len(load))
        return pd.DataFrame({"t": np.arange(len(load)), "u": load, "y": y})

    found = diagnosed(
        runs(make, 2),
        ["t", "u"],
        "y",
        nominal=lambda X: 20 * X["u"].to_numpy(),
        signals={"time": "t", "command": "u"},
    )
    assert found.causes_[0].effects == ("creep",)
    times = [found.effects_["creep"][k] for k in ("time_constant", "slow_time_constant")]
    assert min(abs(tau - 40) for tau in times) < 8
    assert any("computed from the drive" in note for note in found.diagnosis_.notes)


def test_hysteretic_piezo():
    """Plays of several widths from volt to micrometre at 10 kHz, in two runs of a second."""

    def make(k, rng):
        t = np.arange(0, 1, 1e-4)
        V = 50 - 45 * np.cos(25 * t) * (1 - 0.6 * t) + 8 * k * np.sin(70 * t)
        y = 0.1 * V
        for width in (5.0, 12.0, 25.0):
            held = np.empty(len(V))
            held[0] = V[0]
            for i in range(1, len(V)):
                held[i] = min(max(held[i - 1], V[i] - width), V[i] + width)
            y = y + 0.015 * (held - V)
        return pd.DataFrame({"t": t, "V": V, "y": y + 0.01 * rng.standard_normal(len(t))})

    found = diagnosed(
        runs(make, 2),
        ["t", "V"],
        "y",
        nominal=lambda X: 0.1 * X["V"].to_numpy(),
        signals={"time": "t", "position": "V"},
    )
    assert found.causes_[0].effects == ("hysteresis",)


def test_tank_with_an_outlet():
    """Water leaves with the root of the level: a leak, as little pressure drives one."""

    def make(k, rng):
        t = np.arange(0, 500, 1.0)
        h = 0.3 + 0.2 * np.sin(0.03 * t + k) + 0.05 * np.sin(0.09 * t)
        q = 2e-4 * (1 + np.sin(t / 30 + k))
        return pd.DataFrame({"t": t, "h": h, "q": q, "y": q - 2e-4 * np.sqrt(h) + 2e-6 * rng.standard_normal(len(t))})

    found = diagnosed(
        runs(make, 3),
        ["t", "h", "q"],
        "y",
        ("leakage", "flow_bias"),
        nominal=lambda X: X["q"].to_numpy(),
        equation="flow",
        signals={"time": "t", "pressure": "h"},
    )
    assert found.causes_[0].effects == ("leakage",)


# --- inputs ---------------------------------------------------------------------------------------------------
def test_saved_and_loaded(rubbing, tmp_path):
    table, fitted = rubbing
    kept = clone(fitted).set_params(nominal=None)  # a function cannot be saved
    kept.fit(table[COLUMNS], table["F"] - push(table), groups=table["run"])
    persistence.save(kept, tmp_path / "gap.pamid")
    loaded = persistence.load(tmp_path / "gap.pamid")
    assert loaded.verdict_ == kept.verdict_
    assert loaded.causes_ == kept.causes_
    assert loaded.diagnosis_.to_json() == kept.diagnosis_.to_json()
    told = {"groups": table["run"]}
    np.testing.assert_allclose(loaded.predict(table[COLUMNS], **told), kept.predict(table[COLUMNS], **told))


def test_nominal_is_a_fitted_pipeline(rubbing):
    table = rubbing[0].drop(columns="run").assign(trajectory=rubbing[0]["run"])
    columns = ["t", "stroke", "p"]
    linear = make_pipeline(StandardScaler(), LinearRegression(fit_intercept=True)).fit(table[columns], table["F"])
    found = GapDiagnoser(FrozenEstimator(linear), ["coulomb_friction", "force_bias"], signals=CYLINDER["signals"])
    found = clone(found).fit(table[columns].assign(other=0.0)[columns], table["F"], groups=table["trajectory"])
    assert found.causes_[0].effects == ("coulomb_friction",)


def test_intervals_of_one_trajectory_are_over_pieces_of_it(rubbing):
    part = rubbing[0][rubbing[0]["run"] == "run 0"]
    found = GapDiagnoser(effects=FEW, one_trajectory=True, **CYLINDER).fit(part[COLUMNS], part["F"])
    assert found.causes_[0].effects == ("coulomb_friction",)
    low, high = found.causes_[0].parameters["amplitude"].ci90
    assert 0.0 < low < 8.0 < high < 16.0


def test_clipped_sensor(rubbing):
    table = rubbing[0].assign(F=rubbing[0]["F"].clip(upper=60.0))
    found = diagnosed(table, COLUMNS, "F", **CYLINDER)
    assert any("clipped or stuck" in note for note in found.diagnosis_.notes)
    assert "coulomb_friction" in found.effects_


@pytest.mark.parametrize(
    ("change", "error", "said"),
    [
        ({"effects": ["rust"]}, UnknownOptionError, "rust"),
        ({"equation": "valve"}, UnknownOptionError, "valve"),
        ({"sense": "up"}, UnknownOptionError, "up"),
        ({"signals": {"position": "travel"}}, MissingColumnError, "travel"),
        ({"signals": {"place": "stroke"}}, UnknownOptionError, "place"),
        ({"signals": {"time": "t"}}, MissingColumnError, "role"),
    ],
)
def test_settings_that_cannot_be(rubbing, change, error, said):
    table = rubbing[0]
    with pytest.raises(error, match=said):
        GapDiagnoser(**{**CYLINDER, **change}).fit(table[COLUMNS], table["F"], groups=table["run"])


def test_data_that_cannot_be(rubbing):
    table = rubbing[0]
    fit = GapDiagnoser(**CYLINDER).fit
    with pytest.raises(ExcitationError, match="moves"):
        fit(table[COLUMNS].assign(stroke=1.0, p=2e5), table["F"], groups=table["run"])
    with pytest.raises(ValueError, match="NaN"):
        fit(table[COLUMNS].assign(p=np.nan), table["F"], groups=table["run"])
    with pytest.raises(TimeOrderError):
        fit(table[COLUMNS].assign(t=-table["t"]), table["F"], groups=table["run"])


def test_rows_that_count_are_routed() -> None:
    """Metadata routing hands on runs and the rows that count, so that a pipeline passes both."""
    with sklearn.config_context(enable_metadata_routing=True):
        asked = GapDiagnoser().get_metadata_routing().fit.requests
    assert asked["groups"] is True and asked["where"] is True
