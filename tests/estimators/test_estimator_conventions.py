"""Promises of single estimators: no idle parameter, names of runs as text, outputs as asked, a verdict that shows."""

from __future__ import annotations

import inspect
import re
import sys

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import GapDiagnoser, PolynomialForce, RateTransformer, all_estimators
from sklearn.frozen import FrozenEstimator
from sklearn.linear_model import LinearRegression

from pamid.bench import BenchParameters, simulate, sine, unfold
from pamid.cli._tables import make_estimator

SIM = BenchParameters.for_muscle("B")


@pytest.fixture(scope="module")
def rows() -> pd.DataFrame:
    """One row per muscle and sample, with names of runs as text."""
    return unfold(simulate(SIM, [sine(6, 10, 400), sine(9, 8, 400)], seed=0), SIM)


@pytest.mark.parametrize(("name", "estimator_class"), all_estimators())
def test_every_parameter_is_read_somewhere(name, estimator_class):
    """What a constructor takes is used by a method of the class or of a base of ours, or by a function they call."""
    texts = []
    for base in estimator_class.__mro__:
        if base.__module__.startswith("pamid."):
            texts.append(inspect.getsource(base))
            called = vars(sys.modules[base.__module__]).values()
            texts += [
                inspect.getsource(f) for f in called if inspect.isfunction(f) and f.__module__.startswith("pamid.")
            ]
    used = "\n".join(texts)
    idle = [
        p for p in inspect.signature(estimator_class).parameters if not re.search(rf"self\.{p}\b|\.{p}\b|\"{p}\"", used)
    ]
    assert not idle, f"{name} takes {idle} and never reads them"


def test_names_of_runs_pass_through_rates(rows):
    texts = [c for c in rows.columns if rows[c].dtype == object or isinstance(rows[c].dtype, pd.StringDtype)]
    assert "run" in rows.columns and texts
    out = RateTransformer().fit_transform(rows.drop(columns="trajectory"), groups=rows["trajectory"])
    pd.testing.assert_series_equal(out["run"], rows["run"])
    assert np.isfinite(out[["deps", "dP"]].to_numpy()).all()


def test_an_array_holds_time_and_the_columns_in_their_order(rows):
    table = rows[["time", "eps", "P"]]
    by_name = RateTransformer().fit_transform(table, groups=rows["trajectory"])
    by_place = RateTransformer().fit_transform(table.to_numpy(), groups=rows["trajectory"].to_numpy())
    np.testing.assert_allclose(by_place[:, 3:], by_name[["deps", "dP"]].to_numpy())


@pytest.mark.parametrize(("asked", "kind"), [("default", np.ndarray), ("pandas", pd.DataFrame), (None, pd.DataFrame)])
def test_an_output_is_what_set_output_asks_for(rows, asked, kind):
    rates = RateTransformer().set_output(transform=asked)
    out = rates.fit_transform(rows[["time", "eps", "P"]], groups=rows["trajectory"])
    assert type(out) is kind


def test_one_row_is_read_by_name_whatever_was_read_before(rows):
    """Columns that were found right once are known again by identity; others, and what is not finite, are looked at."""
    table = rows[["eps", "P"]].astype(float)
    model = PolynomialForce(2).fit(table, rows["P"] * 1e-3)
    expected = model.predict(table)
    for k in (0, 5):
        assert model.predict(table.iloc[[k]]) == pytest.approx(expected[[k]])
        assert model.predict(table.iloc[[k]][["P", "eps"]].reindex(columns=["eps", "P"])) == pytest.approx(
            expected[[k]]
        )
    with pytest.raises(ValueError, match="feature names"):
        model.predict(table.iloc[[5]][["P", "eps"]])
    with pytest.raises(ValueError, match="feature names"):
        model.predict(table.iloc[[5]].rename(columns={"P": "p_gauge"}))
    for bad in (np.nan, np.inf):
        with pytest.raises(ValueError, match=r"NaN|infinity"):
            model.predict(table.iloc[[5]].assign(P=bad))
    assert model.predict(table.iloc[[5]]) == pytest.approx(expected[[5]])


def test_a_setting_on_the_command_line_is_that_of_python():
    made = make_estimator("PolynomialForce(surface)", {}, None, lambda kinds: {"rest_length": 0.2})
    assert made.get_params() == PolynomialForce(form="surface").get_params()


@pytest.fixture(scope="module")
def damped() -> pd.DataFrame:
    rng, t = np.random.default_rng(0), np.arange(0.0, 6.0, 0.01)
    runs = [
        pd.DataFrame({"run": k, "time": t, "x": np.sin(w * t), "v": w * np.cos(w * t)})
        for k, w in enumerate((1.0, 2.3))
    ]
    table = pd.concat(runs, ignore_index=True)
    noise = 0.01 * rng.standard_normal(len(table))
    return table.assign(F=3.0 * table["x"] + 0.5 * np.tanh(table["v"] / 0.05) + noise)


def test_a_nominal_model_reads_the_columns_of_its_own_fit(damped):
    """It was fitted without the time, which the diagnosis needs."""
    nominal = FrozenEstimator(LinearRegression().fit(damped[["x"]], damped["F"]))
    signals = {"position": "x", "velocity": "v"}
    found = GapDiagnoser(nominal, ["coulomb_friction", "force_bias"], signals=signals, random_state=0)
    plain = repr(found)
    found.fit(damped[["time", "x", "v"]], damped["F"], groups=damped["run"])
    assert found.causes_[0].effects == ("coulomb_friction",)
    page = found._repr_html_()
    assert page.index(found.verdict_) < page.index("GapDiagnoser")
    assert "coulomb_friction" in page and "coulomb_friction" in plain
