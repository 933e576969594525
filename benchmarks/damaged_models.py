"""What becomes of damaged and hostile model files: refused, predicting as the healthy one, or unable to predict.

Each damage is one step of a list, so that every run makes the same files.
"""

from __future__ import annotations

import io
import json
import struct
import tempfile
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from pamid.estimators import GeometricForce, InverseModel, SINDyRegressor, StaticPIHM, ThreeElement
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.neighbors import KNeighborsRegressor
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, PolynomialFeatures, StandardScaler
from sklearn.svm import SVR
from sklearn.tree import DecisionTreeRegressor

from pamid.errors import ModelFileError
from pamid.persistence import load, save
from pamid.training import Adam

CANARY = Path("/tmp/pamid-canary")
"""What a file would make if something of it ran."""

RNG = np.random.default_rng(0)
X = RNG.uniform(0.1, 1.0, size=(60, 4))
Y = X @ [1.0, 2.0, 3.0, 0.5] + 0.05 * RNG.normal(size=60)
GROUPS = np.repeat(np.arange(6), 10)

MODELS: dict[str, Callable[[], Any]] = {
    "pipeline": lambda: make_pipeline(StandardScaler(), PolynomialFeatures(2), Ridge()).fit(X, Y),
    "search": lambda: GridSearchCV(Ridge(), {"alpha": [0.1, 1.0]}, cv=GroupKFold(3)).fit(X, Y, groups=GROUPS),
    "network": lambda: MLPRegressor(hidden_layer_sizes=(3,), max_iter=3, random_state=0).fit(X, Y),
    "force": lambda: GeometricForce(signals={"eps": 0, "P": 1}).fit(X, Y),
    "hybrid": lambda: StaticPIHM(hidden_layer_sizes=(3,), max_iter=1, random_state=0, trainer=Adam(max_iter=1)).fit(
        X, Y
    ),
    "sindy": lambda: SINDyRegressor(inputs=("x", "y"), signals={"x": 0, "y": 1}).fit(X, Y),
    "inverse": lambda: InverseModel(
        inputs=("F", "eps"), hidden=3, max_iter=2, n_starts=1, signals={"F": 0, "eps": 1}, random_state=0
    ).fit(X, Y),
    "elements": lambda: ThreeElement(pieces=2, signals={"eps": 0, "deps": 1, "P": 2, "dP": 3}).fit(X, Y),
}


Healthy = dict[str, tuple[Path, np.ndarray]]
"""File and predictions by the name of a model."""
Hostile = Iterator[tuple[str, str, bytes]]
"""The name of the model that was healthy, what was done to its file, and the file."""


def healthy_models(folder: Path) -> Healthy:
    """Fit and save a small model of each kind."""
    found = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name, make in MODELS.items():
            model = make()
            found[name] = (save(model, folder / f"{name}.pamid"), model.predict(X))
    return found


def entries_of(file: Path) -> dict[str, bytes]:
    """Return the entries of an archive."""
    with zipfile.ZipFile(file) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def packed(entries: dict[str, bytes]) -> bytes:
    """Return an archive of entries."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in entries.items():
            archive.writestr(name, content)
    return data.getvalue()


def array_entry(value: np.ndarray) -> bytes:
    """Return an array as an entry."""
    data = io.BytesIO()
    np.save(data, value, allow_pickle=False)
    return data.getvalue()


def node(module: str, name: str, loader: str) -> dict:
    """Return the head of a node of the schema."""
    return {"__class__": name, "__module__": module, "__loader__": loader}


def json_node(value: Any) -> dict:
    """Return plain data as a node of the schema."""
    return {**node("builtins", "str", "JsonNode"), "content": json.dumps(value), "is_json": True}


def changed(file: Path, change: Callable[[dict, dict[str, bytes]], None]) -> bytes:
    """Return a file whose schema and entries were changed."""
    entries = entries_of(file)
    schema = json.loads(entries["schema.json"])
    change(schema, entries)
    entries["schema.json"] = json.dumps(schema).encode()
    return packed(entries)


def objects(item: Any) -> Iterator[dict]:
    """Yield the nodes of objects with attributes, wherever they are."""
    if isinstance(item, list):
        for value in item:
            yield from objects(value)
    elif isinstance(item, dict):
        if item.get("__loader__") == "ObjectNode" and isinstance(item.get("content"), dict):
            yield item
        for value in item.values():
            yield from objects(value)


# --- the corpus -----------------------------------------------------------------------------------------------------
def misshapen(healthy: Healthy) -> Hostile:
    """Every array of every model cut, stretched, shrunk to one number, or of another type."""
    for name, (file, _) in healthy.items():
        for entry, content in entries_of(file).items():
            if not entry.endswith(".npy"):
                continue
            value = np.load(io.BytesIO(content))
            if value.dtype.kind not in "fiu" or value.size < 2:
                continue
            for word, other in {
                "one number": np.ones((1,) * value.ndim, value.dtype),
                "one more": np.concatenate([value, value[:1]]),
                "one less": value[:-1],
                "words": np.full(value.shape, "rm -rf"),
            }.items():
                yield name, f"{entry} {word}", packed({**entries_of(file), entry: array_entry(other)})


def smuggled(healthy: Healthy) -> Hostile:
    """Attributes that no such object has, or that name a place; in plain nodes and as plain data."""
    planted = {
        "memory": str(CANARY),
        "checkpoint": str(CANARY),
        "planted_": 1,
        "__class__": "builtins.object",
        "predict": "x",
        "n_jobs": 100_000,
        "pre_dispatch": f"__import__('os').system('touch {CANARY}')",
    }
    for name, (file, _) in healthy.items():
        for key, value in planted.items():

            def plant(schema: dict, _: Any, key: str = key, value: Any = value) -> None:
                for one in objects(schema):
                    if isinstance(one["content"].get("content"), dict):
                        if key not in one["content"]["content"]:
                            types = one["content"]["key_types"]["content"]
                            types.append(node("builtins", "str", "TypeNode"))
                        one["content"]["content"][key] = json_node(value)

            yield name, f"planted {key}", changed(file, plant)

        def as_json(schema: dict, _: Any) -> None:
            schema["content"] = json_node({"memory": str(CANARY), "steps": [], "n_features_in_": 4})

        yield name, "all attributes as JSON", changed(file, as_json)

        def lying(schema: dict, _: Any) -> None:
            for one in objects(schema):
                if "n_features_in_" in one["content"].get("content", ()):
                    one["content"]["content"]["n_features_in_"] = json_node(-1)

        yield name, "less than no features", changed(file, lying)


def other_types(healthy: Healthy) -> Hostile:
    """Models that compiled code would read beyond their arrays, and what can be called."""
    import skops.io

    file, _ = healthy["pipeline"]
    head = entries_of(file)["pamid.json"]
    models = {
        "SVR": SVR().fit(X, Y),
        "neighbours": KNeighborsRegressor(algorithm="brute").fit(X, Y),
        "tree": DecisionTreeRegressor(max_depth=2).fit(X, Y),
        "function": make_pipeline(FunctionTransformer(np.exp), Ridge()).fit(X, Y),
        "path": StaticPIHM(trainer=Adam(checkpoint=str(CANARY))),
        "generator": Ridge(random_state=np.random.default_rng(0)),
        "cache": make_pipeline(Ridge(), memory=str(CANARY)),
    }
    for word, model in models.items():
        data = io.BytesIO(skops.io.dumps(model))
        with zipfile.ZipFile(data, "a") as archive:
            archive.writestr("pamid.json", head)
        yield "pipeline", word, data.getvalue()
    data = io.BytesIO(skops.io.dumps(SVR().fit(X, Y)))
    with zipfile.ZipFile(data) as archive:
        entries = {n: archive.read(n) for n in archive.namelist()}
    small = {n: array_entry(np.zeros((1, 1))) if n.endswith(".npy") else c for n, c in entries.items()}
    yield "pipeline", "SVR with arrays of one", packed({**small, "pamid.json": head})

    def void(schema: dict, entries: dict[str, bytes]) -> None:
        entries["n.npy"] = array_entry(np.array(2**31))
        planted = {**node("numpy", "void", "NdArrayNode"), "type": "numpy", "file": "n.npy"}
        schema["content"]["content"]["verbose"] = planted

    yield "pipeline", "numpy.void of two gigabytes", changed(file, void)


def state_of_generator(healthy: Healthy) -> Hostile:
    """Positions that a generator of random numbers does not have."""
    file, _ = healthy["network"]
    for position in (625, 10**6, -5):

        def move(schema: dict, _: Any, position: int = position) -> None:
            for item in json_nodes(schema, "pos"):
                item["content"] = str(position)

        yield "network", f"random numbers from position {position}", changed(file, move)


def json_nodes(item: Any, key: str) -> Iterator[dict]:
    """Yield the nodes of plain data under a key, wherever they are."""
    if isinstance(item, list):
        for value in item:
            yield from json_nodes(value, key)
    elif isinstance(item, dict):
        if isinstance(item.get(key), dict) and item[key].get("__loader__") == "JsonNode":
            yield item[key]
        for value in item.values():
            yield from json_nodes(value, key)


def bombs(healthy: Healthy) -> Hostile:
    """Small files that unfold to large ones, and sizes that are false."""
    file, _ = healthy["pipeline"]
    entries = entries_of(file)
    yield "pipeline", "JSON of 8 million lists", packed({**entries, "schema.json": b"[" + b"[]," * 8_000_000 + b"[]]"})
    yield "pipeline", "a schema of 200 MB", packed({**entries, "schema.json": b" " * 200_000_000})
    yield "pipeline", "300 MB of zeros", packed({**entries, "z.npy": array_entry(np.zeros(300_000_000 // 8))})

    def text(schema: dict, _: Any) -> None:
        schema["content"]["content"]["verbose"] = {**json_node(0), "content": "[" + "[]," * 4_000_000 + "[]]"}

    yield "pipeline", "JSON within JSON", changed(file, text)

    hidden = "[" + r"[]\u002c" * 4_000_000 + "[]]"
    schema = entries["schema.json"].replace(b'"content": "true"', b'"content": "' + hidden.encode() + b'"')
    assert len(schema) > len(hidden)
    yield "pipeline", "JSON within JSON, spelt", packed({**entries, "schema.json": schema})

    def copies(schema: dict, entries: dict[str, bytes]) -> None:
        entries["big.npy"] = array_entry(np.zeros(2**20))
        one = {**node("numpy", "ndarray", "NdArrayNode"), "type": "numpy", "file": "big.npy"}
        many = {**node("builtins", "list", "ListNode"), "content": [dict(one) for _ in range(400)]}
        schema["content"]["content"]["verbose"] = many

    yield "pipeline", "one array read 400 times", changed(file, copies)
    big = packed({**entries, "z.npy": array_entry(np.zeros(400_000_000 // 8))})
    at = big.rindex(b"PK\x01\x02", 0, big.rindex(b"z.npy"))
    for word, size in (("small", 1000), ("large", 2**31)):
        false = bytearray(big)
        false[at + 24 : at + 28] = struct.pack("<I", size)
        yield "pipeline", f"a size that is {word} and false", bytes(false)


def damaged(healthy: Healthy) -> Hostile:
    """Files cut short, and single bits turned."""
    rng = np.random.default_rng(1)
    for name, (file, _) in healthy.items():
        whole = file.read_bytes()
        for share in (0.1, 0.5, 0.99):
            yield name, f"cut at {share}", whole[: int(share * len(whole))]
        for position in rng.choice(len(whole), 12, replace=False):
            flipped = bytearray(whole)
            flipped[position] ^= 1 << int(rng.integers(8))
            yield name, f"a bit at {position}", bytes(flipped)


KINDS = (misshapen, smuggled, other_types, state_of_generator, damaged)


def judged(file: Path, expected: np.ndarray) -> str:
    """Return how a file was taken: refused, loaded and predicting as before, or not predicting at all."""
    try:
        model = load(file)
    except ModelFileError as error:
        assert len(str(error)) < 1000
        return "refused"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found = np.asarray(model.predict(X))
        except Exception:
            return "no predictions"
    assert found.shape == expected.shape
    assert np.array_equal(found, expected, equal_nan=True), "other predictions without a word"
    return "same"


def outcomes(healthy: Healthy, folder: Path) -> Iterator[tuple[str, str, str]]:
    """Write one file after the other and load it; yield kind, what was done, and how it was taken."""
    target = folder / "m.pamid"
    for kind in KINDS:
        for name, what, data in kind(healthy):
            target.write_bytes(data)
            try:
                said = judged(target, healthy[name][1])
            except AssertionError as error:
                said = str(error)
            yield kind.__name__, f"{name}, {what}", said if not CANARY.exists() else "ran code of the file"


def main() -> None:
    """Print how many files came to which end."""
    with tempfile.TemporaryDirectory() as folder:
        found = list(outcomes(healthy_models(Path(folder)), Path(folder)))
    counts = Counter(said for _, _, said in found)
    print(f"{len(found)} damaged or hostile model files: " + ", ".join(f"{n} {said}" for said, n in counts.items()))


if __name__ == "__main__":
    main()
