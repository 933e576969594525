"""Saving and loading models: bit-equal round trips, whole files or none, and no way in for a hostile file."""

from __future__ import annotations

import contextlib
import json
import warnings
from pathlib import Path
from unittest import mock

import numpy as np
import pandas as pd
import pytest
import sklearn
from pamid.estimators import all_estimators, checked_instances
from sklearn.ensemble import RandomForestRegressor
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler
from sklearn.tree import DecisionTreeRegressor
from support.model_files import rewrite, saved, table

from pamid import persistence
from pamid.errors import (
    HostileModelError,
    ModelFileError,
    ModelNotFoundError,
    ModelVersionError,
    OutputError,
    ParameterError,
    TruncatedModelError,
)
from pamid.persistence import inspect, load, save

DATA = Path(__file__).parent / "data"


# --- round trips --------------------------------------------------------------------------------------------
def small_fit(estimator, X, y):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return estimator.fit(X, y)
        except TypeError:
            return estimator.fit(X)


@pytest.mark.parametrize("estimator", checked_instances(), ids=lambda e: type(e).__name__)
def test_every_public_estimator_comes_back_bit_equal(estimator, tmp_path):
    rng = np.random.default_rng(1)
    X = rng.uniform(0.1, 1.0, size=(40, 3))
    y = X @ [1.0, 2.0, 3.0]
    fitted = small_fit(sklearn.base.clone(estimator), X, y)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        back = load(save(fitted, tmp_path / "e.pamid"))
        for method in ("predict", "transform"):
            if hasattr(fitted, method):
                before, after = getattr(fitted, method)(X), getattr(back, method)(X)
                np.testing.assert_array_equal(np.asarray(before), np.asarray(after))
    assert repr(back) == repr(fitted)


def test_all_public_estimators_are_covered():
    assert {type(e).__name__ for e in checked_instances()} == {name for name, _ in all_estimators()}


def test_pipeline_and_search_come_back_bit_equal(tmp_path):
    X, y = table()
    groups = np.repeat(np.arange(6), 10)
    search = GridSearchCV(
        make_pipeline(StandardScaler(), Ridge()),
        {"ridge__alpha": [0.1, 1.0]},
        cv=GroupKFold(3),
        scoring="neg_root_mean_squared_error",
    ).fit(X, y, groups=groups)
    back = load(save(search, tmp_path / "s.pamid"))
    np.testing.assert_array_equal(back.predict(X), search.predict(X))
    assert back.best_params_ == search.best_params_
    assert back.score(X, y) == search.score(X, y)
    assert list(back.feature_names_in_) == ["eps", "P"]
    refit = sklearn.base.clone(back).fit(X, y, groups=groups)
    np.testing.assert_array_equal(refit.predict(X), search.predict(X))


def test_random_generator_state_survives(tmp_path):
    X, y = table()
    model = MLPRegressor(hidden_layer_sizes=(4,), max_iter=3, random_state=np.random.RandomState(3))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.fit(X, y)
        back = load(save(model, tmp_path / "m.pamid"))
        np.testing.assert_array_equal(back.fit(X, y).predict(X), model.fit(X, y).predict(X))


def test_inspect_tells_what_is_inside_without_loading(tmp_path):
    X, y = table()
    model = make_pipeline(StandardScaler(), Ridge()).fit(X, y)
    file = save(model, tmp_path / "m.pamid", metadata={"log": "sine-1-10", "rmse": 0.3})
    with mock.patch("skops.io.loads", side_effect=AssertionError("loaded")):
        head = inspect(file)
    assert head["format"] == persistence.FORMAT_VERSION
    assert head["class"] == "sklearn.pipeline.Pipeline"
    assert head["steps"] == ["StandardScaler", "Ridge"]
    assert head["columns"] == ["eps", "P"]
    assert head["units"] == {"eps": "1", "P": "Pa"}
    assert head["sklearn"] == sklearn.__version__
    assert head["metadata"] == {"log": "sine-1-10", "rmse": 0.3}


# --- writing ------------------------------------------------------------------------------------------------
def test_crash_while_writing_leaves_the_old_file(tmp_path):
    file = saved(tmp_path)
    before = file.read_bytes()
    X, y = table()
    full = mock.patch("os.fsync", side_effect=OSError(28, "No space left on device"))
    with full, pytest.raises(OutputError, match=r"No space left.*Expected.*free some space"):
        save(LinearRegression().fit(X, y), file)
    assert file.read_bytes() == before
    assert list(tmp_path.iterdir()) == [file]


def test_folder_that_does_not_exist(tmp_path):
    with pytest.raises(OutputError, match="cannot be written"):
        saved(tmp_path / "nowhere")


def test_what_load_would_refuse_is_never_written(tmp_path):
    X, y = table()
    model = make_pipeline(FunctionTransformer(np.linalg.norm), Ridge())
    with pytest.raises(ModelFileError, match=r"cannot be saved so that it loads again.*FunctionTransformer"):
        save(model, tmp_path / "m.pamid")
    with pytest.raises(ModelFileError, match=r"without pickle|loads again"):
        save(make_pipeline(FunctionTransformer(lambda x: x), Ridge()).fit(X, y), tmp_path / "m.pamid")
    with pytest.raises(ModelFileError, match="memory"):
        save(make_pipeline(StandardScaler(), Ridge(), memory=str(tmp_path)), tmp_path / "m.pamid")
    assert not list(tmp_path.iterdir())


def test_metadata_must_be_json(tmp_path):
    with pytest.raises(ParameterError, match=r"metadata cannot be written as JSON.*tolist"):
        save(Ridge(), tmp_path / "m.pamid", metadata={"a": np.zeros(2)})


def test_types_of_the_user_need_trust_on_both_sides(tmp_path):
    X, y = table()
    forest = RandomForestRegressor(3, max_depth=2, random_state=0).fit(X, y)
    file = tmp_path / "f.pamid"
    with pytest.raises(ModelFileError, match=r"RandomForestRegressor"):
        save(forest, file)
    trusted = ["sklearn.tree._tree.Tree", RandomForestRegressor, DecisionTreeRegressor]
    save(forest, file, trusted=trusted)
    with pytest.raises(HostileModelError, match=r"RandomForestRegressor"):
        load(file)
    np.testing.assert_array_equal(load(file, trusted=trusted).predict(X), forest.predict(X))


# --- versions -----------------------------------------------------------------------------------------------
def set_format(version) -> callable:
    def change(entries: dict[str, bytes]) -> None:
        head = json.loads(entries["pamid.json"])
        head["format"] = version
        entries["pamid.json"] = json.dumps(head).encode()

    return change


@pytest.mark.parametrize("version", [2**30, 0, -1, "1", None, True, 1.0])
def test_unknown_format_version(version, tmp_path):
    file = rewrite(saved(tmp_path), set_format(version))
    with pytest.raises(ModelVersionError, match=r"Expected .*1"):
        load(file)
    with pytest.raises(ModelVersionError):
        inspect(file)


@pytest.mark.parametrize("name", ["model_format1", "geometric_force_format1", "gap_diagnoser_format1"])
def test_file_of_format_1_loads(name):
    file = DATA / f"{name}.pamid"
    assert inspect(file)["format"] == 1
    model = load(file)
    expected = json.loads((DATA / f"{name}.json").read_text())
    got = model.predict(pd.DataFrame(expected["X"]))
    np.testing.assert_allclose(got, expected["prediction"], rtol=1e-12)


def test_the_old_names_of_the_next_run_serve_one_version():
    model = load(DATA / "gap_diagnoser_format1.pamid")
    found = model.diagnosis_
    assert found.next_run == model.next_run_
    with pytest.warns(FutureWarning, match="next_run_"):
        assert model.next_experiment_ == model.next_run_
    with pytest.warns(FutureWarning, match="next_run"):
        assert found.next_experiment == found.next_run
    told = json.loads(found.to_json())
    assert told["next_experiment"] == told["next_run"]


def test_trainers_of_pamid_are_kept(tmp_path):
    from pamid.estimators import StaticPIHM

    from pamid.training import Adam

    model = StaticPIHM(trainer=Adam(max_iter=7, learning_rate=0.02), hidden_layer_sizes=(4,))
    back = load(save(model, tmp_path / "m.pamid")).trainer
    assert type(back) is Adam
    assert back.get_params() == model.trainer.get_params()


def test_file_of_format_1_loads_through_migrations_of_later_versions(monkeypatch):
    """A later version in which StandardScaler and an attribute of Ridge go by other names still reads today's files."""

    def one_to_two(head, schema):
        schema = persistence.rename_type(schema, "sklearn.linear_model._ridge.Ridge", "pamid.future.Ridge2")
        return head, schema

    def two_to_three(head, schema):
        schema = persistence.rename_type(schema, "pamid.future.Ridge2", "sklearn.linear_model._ridge.Ridge")
        return head, persistence.rename_attribute(
            schema, "sklearn.linear_model._ridge.Ridge", "intercept_", "intercept_"
        )

    file = DATA / "model_format1.pamid"
    expected = load(file).predict(pd.DataFrame(json.loads((DATA / "model_format1.json").read_text())["X"]))
    monkeypatch.setattr(persistence, "FORMAT_VERSION", persistence.FORMAT_VERSION + 1)
    with pytest.raises(ModelVersionError, match="no longer reads"):
        load(file)
    monkeypatch.setattr(persistence, "FORMAT_VERSION", 3)
    monkeypatch.setattr(persistence, "MIGRATIONS", {1: one_to_two, 2: two_to_three})
    got = load(file).predict(pd.DataFrame(json.loads((DATA / "model_format1.json").read_text())["X"]))
    np.testing.assert_array_equal(got, expected)


def test_rename_attribute_moves_a_fitted_value(tmp_path):
    schema = {
        "__class__": "Ridge",
        "__module__": "m",
        "content": {"content": {"old_": {"content": "1"}, "kept": {"content": "2"}}},
    }
    renamed = persistence.rename_attribute(schema, "m.Ridge", "old_", "new_")
    assert list(renamed["content"]["content"]) == ["new_", "kept"]


# --- damaged files ------------------------------------------------------------------------------------------
def test_no_file(tmp_path):
    with pytest.raises(ModelNotFoundError, match="There is no file"):
        load(tmp_path / "nothing.pamid")
    with pytest.raises(ModelNotFoundError, match="is a folder"):
        load(tmp_path)


def test_truncated_anywhere(tmp_path):
    file = saved(tmp_path)
    whole = file.read_bytes()
    for share in (0.0, 0.01, 0.3, 0.7, 0.95, 0.999):
        file.write_bytes(whole[: int(len(whole) * share)])
        with pytest.raises(TruncatedModelError):
            load(file)


def test_any_flipped_byte_is_refused_or_harmless(tmp_path):
    """A damaged file raises one of our errors, or (a byte outside the contents) loads the same model."""
    X, y = table()
    model = Ridge().fit(X, y)
    file = save(model, tmp_path / "m.pamid")
    whole = file.read_bytes()
    rng = np.random.default_rng(0)
    for position in rng.choice(len(whole), 150, replace=False):
        damaged = bytearray(whole)
        damaged[position] ^= 1 << int(rng.integers(8))
        file.write_bytes(bytes(damaged))
        with contextlib.suppress(ModelFileError):
            np.testing.assert_array_equal(load(file).predict(X), model.predict(X))


@pytest.mark.parametrize("entry", ["schema.json", "pamid.json"])
def test_missing_entry(entry, tmp_path):
    file = rewrite(saved(tmp_path), lambda entries: entries.pop(entry))
    with pytest.raises(TruncatedModelError, match=f"without {entry}"):
        load(file)


@pytest.mark.parametrize("entry", ["schema.json", "pamid.json"])
@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"\xff\xfe{}", "not UTF-8"),
        (b"{", "not valid JSON"),
        (b"[]", "holds a list"),
        (b"[" * 200_000, "nested without end|not valid JSON"),
        (b'{"format": 1, "format": 1}', "a key twice"),
    ],
)
def test_broken_json(entry, content, words, tmp_path):
    file = rewrite(saved(tmp_path), lambda entries: entries.update({entry: content}))
    with pytest.raises(ModelFileError, match=words):
        load(file)
