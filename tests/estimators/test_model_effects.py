"""Hybrid models with named effects: identified beside the geometry, remembered along whole trajectories, saved."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import QAdapter, StaticPIHM, ThermodynamicPIHM
from sklearn.base import clone

from pamid.effects import make_effect
from pamid.effects._terms import WholeLog, restored, terms_of
from pamid.effects.base import Signals
from pamid.errors import ExportError, IncompatibleError, MissingTrajectoryError, ParameterError
from pamid.export.plan import plan_of
from pamid.laws.quasi_static import QuasiStaticForce
from pamid.persistence import load, save
from pamid.signals.state import State
from pamid.volume.contact import ContactVolume

COLUMNS = ["trajectory", "time", "eps", "deps", "P", "dP"]
EFFECTS = ["pressure_lag", "pressure_hysteresis"]
MUSCLE = ContactVolume(0.2, 6e-4, 0.3, -0.2, 5e4, 0.05, 2e4, 1.6e-5)


def log(seed=0, runs=6, rows=400, dt=0.02):
    """Runs at held contractions, filled and vented: a sensor that lags by 60 ms, and stops of 12 N in the pressure."""
    rng = np.random.default_rng(seed)
    parts = []
    for k in range(runs):
        t = dt * np.arange(rows)
        P = 3e5 + sum(a * np.sin(w * t + rng.uniform(0, 6)) for a, w in ((1.2e5, 1.3), (5e4, 4.1)))
        dP = np.gradient(P, t)
        eps = np.full(rows, rng.uniform(0.02, 0.2))
        s = Signals(time=t, position=eps, velocity=0 * t, pressure=P, pressure_rate=dP)
        own = WholeLog(s, dt, np.array([0]))
        terms = terms_of([make_effect("pressure_hysteresis", middle=12.0, width=6e4)], "force", own, None)
        F = QuasiStaticForce(0.2).predict(*MUSCLE.jet(State(eps, 0 * t, P, dP)), State(eps, 0 * t, P, dP))
        F = F + terms.columns @ [{"middle": 12.0}.get(p.name, 0.0) for _, p in terms.of]
        lag = make_effect("pressure_lag", time_constant=0.06)
        x = lag.trace(s, None, dt, np.array([0]))
        read = lag.measure(P, x)
        parts.append(
            pd.DataFrame(
                {"trajectory": f"run {k}", "time": t, "eps": eps, "deps": 0.0, "P": read, "dP": np.gradient(read, t)}
            ).assign(F=F + 0.3 * rng.normal(size=rows))
        )
    return pd.concat(parts, ignore_index=True)


OPTIONS = {"hidden_layer_sizes": (8,), "max_iter": 15, "random_state": 0}


@pytest.fixture(scope="module")
def remembering():
    data = log()
    return StaticPIHM(0.2, 0.01, effects=EFFECTS, **OPTIONS).fit(data[COLUMNS], data["F"])


def test_effects_are_identified_and_halve_the_error_on_another_run(remembering, tmp_path):
    new = log(7, runs=2)
    found = {e.name: e.values for e in remembering.effects_}
    assert found["pressure_lag"]["time_constant"] == pytest.approx(0.06, rel=0.3)
    assert max(abs(found["pressure_hysteresis"][k]) for k in ("narrow", "middle", "wide")) > 3.0
    data = log()
    plain = StaticPIHM(0.2, 0.01, **OPTIONS).fit(data[COLUMNS], data["F"])

    def rmse(model):
        return float(np.sqrt(np.mean((model.predict(new[COLUMNS]) - new["F"]) ** 2)))

    assert rmse(remembering) < 0.5 * rmse(plain)
    again = load(save(remembering, tmp_path / "memory.pamid"))
    np.testing.assert_array_equal(again.predict(new[COLUMNS]), remembering.predict(new[COLUMNS]))
    assert again.effects_ == remembering.effects_
    V = remembering.volume(new[COLUMNS]).V
    assert V.shape == (len(new),)


def test_rows_without_weight_carry_the_memory_only(remembering):
    data = log()
    weight = (np.arange(len(data)) % 4 == 0).astype(float)
    spoilt = data["F"].where(weight > 0, 1e4)
    model = clone(remembering).fit(data[COLUMNS], spoilt, sample_weight=weight)
    assert np.sqrt(np.mean((model.predict(data[COLUMNS]) - data["F"]) ** 2)) < 3.0


def test_runs_do_not_touch_and_their_order_does_not_matter(remembering):
    data = log()
    whole = pd.Series(remembering.predict(data[COLUMNS]), index=data.index)
    one = data[data["trajectory"] == "run 3"]
    np.testing.assert_allclose(remembering.predict(one[COLUMNS]), whole[one.index], rtol=1e-9)


def test_what_cannot_be_is_refused(remembering):
    data = log(runs=2, rows=30)
    with pytest.raises(MissingTrajectoryError, match="trajectory"):
        StaticPIHM(effects=EFFECTS).fit(data[COLUMNS[1:]], data["F"])
    with pytest.raises(ParameterError, match="list"):
        StaticPIHM(effects="tube").fit(data[COLUMNS], data["F"])
    with pytest.raises(ParameterError, match="twice"):
        StaticPIHM(effects=["tube", "tube"]).fit(data[COLUMNS], data["F"])
    with pytest.raises(IncompatibleError, match="valve"):
        ThermodynamicPIHM(effects=["valve_dead_zone"]).fit(data[COLUMNS], data["F"])
    with pytest.raises(IncompatibleError, match="partial_fit remembers"):
        StaticPIHM(effects=["tube"]).partial_fit(data[COLUMNS], data["F"])
    with pytest.raises(IncompatibleError, match="fitted with effects"):
        QAdapter(remembering).fit(data[COLUMNS], data["F"])
    with pytest.raises(ExportError, match="before and after"):
        plan_of(remembering)


def test_a_restored_pressure_is_the_one_before_the_sensor():
    t = 0.01 * np.arange(300)
    P = 3e5 + 1e5 * np.sin(2 * t)
    lag = make_effect("pressure_lag", time_constant=0.05)
    s = Signals(time=t, position=0 * t, velocity=0 * t, pressure=P, pressure_rate=np.gradient(P, t))
    read = lag.measure(P, lag.trace(s, None, 0.01, np.array([0])))
    back = restored([lag], WholeLog(s.with_(pressure=read, pressure_rate=np.gradient(read, t)), 0.01, np.array([0])))
    np.testing.assert_allclose(back.signals.pressure[5:], P[5:], atol=300)
