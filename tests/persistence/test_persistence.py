"""Saving and loading models: bit-equal round trips, whole files or none, and no way in for a hostile file."""

from __future__ import annotations

import contextlib
import io
import json
import struct
import warnings
import zipfile
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


def table(n: int = 60) -> tuple[pd.DataFrame, np.ndarray]:
    rng = np.random.default_rng(0)
    X = pd.DataFrame(rng.normal(size=(n, 2)), columns=["eps", "P"])
    return X, X["eps"].to_numpy() * 3 + rng.normal(size=n) * 0.1


def saved(path: Path, estimator: object | None = None) -> Path:
    X, y = table()
    return save(estimator or make_pipeline(StandardScaler(), Ridge()).fit(X, y), path / "model.pamid")


def rewrite(file: Path, change) -> Path:
    """Rewrite the entries of a model file through ``change(entries)``."""
    with zipfile.ZipFile(file) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    change(entries)
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in entries.items():
            archive.writestr(name, data)
    return file


def edit_schema(file: Path, change) -> Path:
    def edit(entries: dict[str, bytes]) -> None:
        schema = json.loads(entries["schema.json"])
        change(schema)
        entries["schema.json"] = json.dumps(schema).encode()

    return rewrite(file, edit)


def attributes(schema: dict) -> dict:
    return schema["content"]["content"]


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


@pytest.mark.parametrize("name", ["model_format1", "geometric_force_format1"])
def test_file_of_format_1_loads(name):
    file = DATA / f"{name}.pamid"
    assert inspect(file)["format"] == 1
    model = load(file)
    expected = json.loads((DATA / f"{name}.json").read_text())
    got = model.predict(pd.DataFrame(expected["X"]))
    np.testing.assert_allclose(got, expected["prediction"], rtol=1e-12)


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
    monkeypatch.setattr(persistence, "FORMAT_VERSION", 3)
    with pytest.raises(ModelVersionError, match="no longer reads"):
        load(file)
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


# --- hostile files: each is refused before anything is built ---------------------------------------------------
class Built(Exception):
    """Raised if a hostile file gets anything built."""


@pytest.fixture
def no_construction():
    with mock.patch("skops.io.loads", side_effect=Built):
        yield


def node(module: str, name: str, loader: str, **more) -> dict:
    return {"__class__": name, "__module__": module, "__loader__": loader, **more}


def json_node(value) -> dict:
    return node("builtins", "str", "JsonNode", content=json.dumps(value), is_json=True)


def list_node(items: list, kind: str = "list") -> dict:
    return node("builtins", kind, "ListNode" if kind == "list" else "TupleNode", content=items)


def dict_node(content: dict) -> dict:
    return node("builtins", "dict", "DictNode", content=content, key_types=list_node([]))


SYSTEM = node("os", "system", "FunctionNode")
PARTIAL = node(
    "functools",
    "partial",
    "PartialNode",
    content={"func": SYSTEM, "args": list_node([json_node("true")], "tuple"), "kwds": dict_node({}), "namespace": {}},
)
HOSTILE_NODES = {
    "os.system": SYSTEM,
    "posix.system": node("posix", "system", "FunctionNode"),
    "eval": node("builtins", "eval", "FunctionNode"),
    "eval as a type": node("builtins", "eval", "TypeNode"),
    "os.system as a type": node("os", "system", "TypeNode"),
    "partial of os.system": PARTIAL,
    "reduce": node("subprocess", "Popen", "ConstructorFromReduceNode", content=list_node([json_node("true")], "tuple")),
    "reduce of a trusted type": node(
        "sklearn.linear_model._ridge", "Ridge", "ConstructorFromReduceNode", content=list_node([], "tuple")
    ),
    "loss that is a process": node(
        "subprocess", "Popen", "LossNode", content=dict_node({}), __reduce__={"args": list_node([json_node("true")])}
    ),
    "method": node("builtins", "str", "MethodNode", content={"func": "format", "obj": json_node("x")}),
    "methodcaller": node("operator", "methodcaller", "OperatorFuncNode", attrs=list_node([json_node("system")])),
    "attrgetter": node("operator", "attrgetter", "OperatorFuncNode", attrs=list_node([json_node("__class__")])),
    "object of a foreign class": node("subprocess", "Popen", "ObjectNode", content=dict_node({})),
    "object of a private class of pamid": node("pamid.errors", "PamidError", "ObjectNode", content=dict_node({})),
    "module of pamid that does not exist": node("pamid.laws.evil", "Law", "ObjectNode", content=dict_node({})),
    "function of pamid": node("pamid.persistence", "load", "FunctionNode"),
    "dict of a foreign class": node("collections", "ChainMap", "DictNode", content={}, key_types=list_node([])),
    "list of a foreign class": node("subprocess", "Popen", "ListNode", content=[json_node("true")]),
    "array of a foreign class": node("subprocess", "Popen", "NdArrayNode", type="numpy", file="x.npy"),
    "array of object type": node("numpy", "object_", "NdArrayNode", type="json", content=[SYSTEM]),
    "sparse matrix (a zip in the zip)": node("scipy.sparse", "csr_matrix", "SparseMatrixNode", file="x.npz"),
    "cached node": node("builtins", "dict", "CachedNode", __id__=1),
    "unknown loader": node("builtins", "dict", "EvilNode"),
    "node without a type": {"__loader__": "ObjectNode"},
    "node with a list for a class": {"__loader__": "ObjectNode", "__class__": ["a"], "__module__": "b"},
    "bit generator that is a function": node(
        "numpy.random._generator",
        "Generator",
        "RandomGeneratorNode",
        content={"bit_generator": dict_node({"bit_generator": json_node("seed")}), "seed_seq": dict_node({})},
    ),
    "hidden in an object array": node(
        "numpy",
        "ndarray",
        "NdArrayNode",
        type="json",
        content=[list_node([json_node(1), SYSTEM])],
        shape=list_node([json_node(1)], "tuple"),
    ),
    "hidden under a key of the schema itself": dict_node({"__loader__": SYSTEM}),
    "entry outside the archive": node("numpy", "ndarray", "NdArrayNode", type="numpy", file="../../etc/passwd"),
    "entry that is the schema": node("builtins", "bytes", "BytesNode", file="schema.json"),
    "file that is a list": node("builtins", "bytes", "BytesNode", file=["schema.json"]),
    "cache folder": node(
        "sklearn.pipeline", "Pipeline", "ObjectNode", content=dict_node({"memory": json_node("/tmp/evil")})
    ),
}


@pytest.mark.parametrize("kind", HOSTILE_NODES)
def test_hostile_node_is_refused_before_anything_is_built(kind, tmp_path, no_construction):
    def plant(schema: dict) -> None:
        attributes(schema)["planted"] = HOSTILE_NODES[kind]

    file = edit_schema(saved(tmp_path, Ridge()), plant)
    with pytest.raises(HostileModelError, match="Expected") as caught:
        load(file)
    assert caught.value.remedy


def test_hostile_node_at_the_top(tmp_path, no_construction):
    for top in (PARTIAL, SYSTEM, dict_node({})):
        file = edit_schema(
            saved(tmp_path, Ridge()), lambda schema, top=top: (schema.clear(), schema.update(top, protocol=2))
        )
        with pytest.raises(HostileModelError):
            load(file)


def test_old_protocol_cannot_bring_back_old_rules(tmp_path, no_construction):
    for protocol in (0, 1, True, "2", None):
        file = edit_schema(saved(tmp_path, Ridge()), lambda schema, p=protocol: schema.update(protocol=p))
        with pytest.raises(HostileModelError, match="protocol"):
            load(file)


def test_one_id_for_two_contents(tmp_path, no_construction):
    def plant(schema: dict) -> None:
        attributes(schema)["a"] = node("builtins", "list", "ListNode", content=[json_node(1)], __id__=77)
        attributes(schema)["b"] = node("builtins", "list", "ListNode", content=[json_node(2)], __id__=77)

    with pytest.raises(HostileModelError, match="two contents"):
        load(edit_schema(saved(tmp_path, Ridge()), plant))


def test_endless_nesting(tmp_path, no_construction):
    def plant(schema: dict) -> None:
        deep = json_node(1)
        for _ in range(250):
            deep = list_node([deep])
        attributes(schema)["deep"] = deep

    with pytest.raises(HostileModelError, match=r"levels deep"):
        load(edit_schema(saved(tmp_path, Ridge()), plant))


def test_pickled_array_is_refused(tmp_path, no_construction):
    class Evil:
        def __reduce__(self):
            return (eval, ("1/0",))

    buffer = io.BytesIO()
    np.save(buffer, np.array([Evil()], dtype=object), allow_pickle=True)
    entry = {}

    def swap(entries: dict[str, bytes]) -> None:
        entry["name"] = next(name for name in entries if name.endswith(".npy"))
        entries[entry["name"]] = buffer.getvalue()

    file = rewrite(saved(tmp_path), swap)
    with pytest.raises(HostileModelError, match="pickled Python objects"):
        load(file)


@pytest.mark.parametrize(
    ("header", "words"),
    [
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }", "claims 1000000000000 items"),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (-1,), }", "negative size|no readable header"),
        ("{'descr': [('a', 'O')], 'fortran_order': False, 'shape': (1,), }", "pickled Python objects"),
        ("__import__('os').system('true')", "no readable header"),
        ("{'descr': '<f8'}", "no readable header"),
        ("", "no readable header"),
    ],
)
def test_array_headers_that_lie(header, words, tmp_path, no_construction):
    text = header.encode().ljust(118)
    fake = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + b"\0" * 8

    def swap(entries: dict[str, bytes]) -> None:
        entries[next(name for name in entries if name.endswith(".npy"))] = fake

    with pytest.raises(ModelFileError, match=words):
        load(rewrite(saved(tmp_path), swap))


def test_zip_bomb_is_refused_by_its_declared_size(tmp_path, no_construction):
    file = rewrite(saved(tmp_path), lambda entries: entries.update({"zeros.bin": b"\0" * 20_000_000}))
    assert file.stat().st_size < 100_000
    with pytest.raises(HostileModelError, match="bytes"):
        load(file, max_bytes=10_000_000)


def test_zip_bomb_that_understates_its_size(tmp_path, no_construction):
    file = rewrite(saved(tmp_path), lambda entries: entries.update({"zeros.bin": b"\0" * 3_000_000}))
    data = file.read_bytes()
    assert data.count(struct.pack("<I", 3_000_000)) == 2
    file.write_bytes(data.replace(struct.pack("<I", 3_000_000), struct.pack("<I", 8)))
    with pytest.raises(ModelFileError, match="damaged"):
        load(file)


def test_too_many_entries(tmp_path, no_construction):
    file = rewrite(saved(tmp_path), lambda entries: entries.update({f"{i}.bin": b"" for i in range(20_001)}))
    with pytest.raises(HostileModelError, match="entries"):
        load(file)


@pytest.mark.parametrize(
    "name",
    [
        "../evil.npy",
        "/etc/passwd",
        "a/b.npy",
        "..\\evil.npy",
        "evil.exe",
        "C:evil.npy",
        ".npy",
        "inner.zip",
        "a\x00.npy",
    ],
)
def test_path_tricks(name, tmp_path, no_construction):
    file = rewrite(saved(tmp_path), lambda entries: entries.update({name: b"x"}))
    with pytest.raises(HostileModelError, match="an entry named"):
        load(file)


def test_duplicated_entry(tmp_path, no_construction):
    file = saved(tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with zipfile.ZipFile(file, "a") as archive:
            archive.writestr("schema.json", "{}")
    with pytest.raises(HostileModelError, match="twice"):
        load(file)


def test_pickle_file_is_not_even_opened_as_one(tmp_path):
    import pickle

    file = tmp_path / "m.pamid"
    file.write_bytes(pickle.dumps(Ridge()))
    with pytest.raises(TruncatedModelError, match="no zip archive"):
        load(file)


def test_contents_that_do_not_fit_their_types(tmp_path):
    """A file of allowed types alone whose parts make no model gives our error, not the library's."""
    file = edit_schema(saved(tmp_path, Ridge()), lambda schema: schema.update(content=list_node([json_node(3)])))
    with pytest.raises(ModelFileError, match="does not describe a whole model"):
        load(file)
