"""Hostile model files are refused before anything is built."""

from __future__ import annotations

import io
import json
import struct
import warnings
import zipfile
from unittest import mock

import numpy as np
import pytest
from sklearn.linear_model import Ridge
from support.model_files import attributes, edit_schema, rewrite, saved

from pamid.errors import (
    HostileModelError,
    ModelFileError,
    TruncatedModelError,
)
from pamid.persistence import load


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
    with pytest.raises(TruncatedModelError, match="no model file"):
        load(file)


def test_contents_that_do_not_fit_their_types(tmp_path):
    """A file of allowed types alone whose parts make no model gives our error, not the library's."""
    file = edit_schema(saved(tmp_path, Ridge()), lambda schema: schema.update(content=list_node([json_node(3)])))
    with pytest.raises(ModelFileError, match="does not describe a whole model"):
        load(file)
