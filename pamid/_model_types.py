"""Which types a model file may bring to life: an allow-list by kind of node, and the audit of a schema against it.

The list is closed: the few types of scikit-learn that pipelines and searches need, numpy and Python containers, the
estimators of `pamid.estimators`, the trainers, splitters and dataclasses of pamid. Whatever else a file
names is refused before anything is built, and no module outside these packages is imported to look.
"""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pkgutil
import sys
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ._model_archive import COPIES, MAX_BYTES, hostile, json_cost
from .errors import HostileModelError

MAX_DEPTH = 400
_DATACLASS_PACKAGES = (
    "pamid.laws",
    "pamid.volume",
    "pamid.training",
    "pamid.adapters",
    "pamid.signals",
    "pamid.effects",
    "pamid.bench",
    "pamid.gap",
    "pamid.gap.residuals",
    "pamid.gap.diagnosis",
)
_PRIMITIVES = {"builtins.str", "builtins.int", "builtins.float", "builtins.bool", "builtins.NoneType"}
_SIMPLE_LOADERS: dict[str, set[str]] = {
    "DictNode": {"builtins.dict", "collections.OrderedDict"},
    "ListNode": {"builtins.list"},
    "SetNode": {"builtins.set", "builtins.frozenset"},
    "SliceNode": {"builtins.slice"},
    "JsonNode": _PRIMITIVES,
    "BytesNode": {"builtins.bytes"},
    "MaskedArrayNode": {"numpy.ma.MaskedArray", "numpy.ma.core.MaskedArray"},
    "DTypeNode": {"numpy.dtype"},
    "RandomStateNode": {"numpy.random.mtrand.RandomState", "numpy.random.RandomState"},
}
_FILE_ENDINGS = {"NdArrayNode": ".npy", "BytesNode": ".bin"}


_SKLEARN = {
    "sklearn.pipeline": ("Pipeline",),
    "sklearn.frozen._frozen": ("FrozenEstimator",),
    "sklearn.preprocessing._data": ("StandardScaler", "MinMaxScaler", "MaxAbsScaler", "RobustScaler"),
    "sklearn.preprocessing._polynomial": ("PolynomialFeatures",),
    "sklearn.linear_model._base": ("LinearRegression",),
    "sklearn.linear_model._ridge": ("Ridge",),
    "sklearn.neural_network._multilayer_perceptron": ("MLPRegressor",),
    "sklearn.neural_network._stochastic_optimizers": ("AdamOptimizer", "SGDOptimizer"),
    "sklearn.model_selection._search": ("GridSearchCV", "RandomizedSearchCV"),
    "sklearn.model_selection._split": ("KFold", "GroupKFold", "LeaveOneGroupOut", "GroupShuffleSplit", "ShuffleSplit"),
    "sklearn.metrics._scorer": ("_Scorer", "_PassthroughScorer"),
}
"""What pipelines and searches around pamid's estimators are made of, by module.

Whatever hands arrays of a file to compiled code unseen, as trees, neighbours and libsvm do, is not here.
"""

PLACES = frozenset({"memory", "checkpoint", "cache", "folder", "path", "file", "temp_folder", "backend", "callbacks"})
"""Attributes that name a place on a disk or something to run; in a file they are empty."""


@cache
def sklearn_types() -> frozenset[str]:
    """Return the scikit-learn classes that a model file may name."""
    return frozenset(f"{module}.{name}" for module, names in _SKLEARN.items() for name in names)


@cache
def functions() -> frozenset[str]:
    """Return the functions that the scorer of a search may name: scikit-learn's metrics."""
    import sklearn.metrics

    return frozenset(
        f"{f.__module__}.{f.__name__}"
        for _, f in inspect.getmembers(sklearn.metrics, inspect.isfunction)
        if f.__module__.startswith("sklearn.metrics.")
    )


@cache
def numpy_scalars() -> frozenset[str]:
    """Return numpy's types of numbers."""
    return frozenset(f"numpy.{t.__name__}" for kind in "?bhilqpBHILQPefdgFDG" if (t := np.dtype(kind).type))


@cache
def _own_modules() -> frozenset[str]:
    """Return the modules of pamid that may define dataclasses which models hold; found, not imported."""
    found = set()
    for name in _DATACLASS_PACKAGES:
        package = importlib.import_module(name)
        found |= {m for path in package.__path__ for m in _below(name, path)}
    return frozenset(found)


def _below(name: str, path: str) -> Iterator[str]:
    for module in pkgutil.iter_modules([path]):
        full = f"{name}.{module.name}"
        yield full
        if module.ispkg:
            yield from _below(full, str(Path(path) / module.name))


@cache
def own_estimators() -> frozenset[str]:
    """Return the public estimators of the package."""
    from pamid.estimators import all_estimators

    return frozenset(f"{c.__module__}.{c.__qualname__}" for _, c in all_estimators())


@cache
def own_type(module: str, name: str) -> bool:
    """Say whether a type is a public estimator, a trainer, splitter, dataclass or named tuple of pamid."""
    if module.startswith("pamid.estimators."):
        return f"{module}.{name}" in own_estimators()
    if module not in _own_modules() or not name.isidentifier():
        return False
    found = getattr(importlib.import_module(module), name, None)
    if not inspect.isclass(found) or found.__module__ != module:
        return False
    from sklearn.base import BaseEstimator  # what has parameters to search over, such as a trainer, derives from it
    from sklearn.model_selection import BaseCrossValidator

    named_tuple = issubclass(found, tuple) and hasattr(found, "_fields") and found.__bases__ == (tuple,)
    return dataclasses.is_dataclass(found) or named_tuple or issubclass(found, (BaseEstimator, BaseCrossValidator))


def allowed(loader: str, module: str, name: str, trusted: frozenset[str]) -> bool:
    """Say whether a node of this kind may bring this type to life."""
    full = f"{module}.{name}"
    if loader in _SIMPLE_LOADERS:
        return full in _SIMPLE_LOADERS[loader]
    if loader == "NdArrayNode":
        return full == "numpy.ndarray" or full in numpy_scalars()
    if loader == "TypeNode":
        return (
            full in _PRIMITIVES | {"builtins.list", "builtins.dict", "builtins.tuple"}
            or full in numpy_scalars()
            or full in trusted
        )
    if loader == "FunctionNode":
        return full in functions() or full in trusted
    if loader == "TupleNode":
        return full == "builtins.tuple" or own_type(module, name) or full in trusted
    if loader == "ObjectNode":
        return full in sklearn_types() or own_type(module, name) or full in trusted
    # A tree's node array is read without bounds checks, so its type must be trusted by the caller.
    return loader == "TreeNode" and full in trusted


def audit_schema(
    schema: dict[str, Any],
    files: Mapping[str, bytes],
    name: str,
    trusted: Iterable[str] = (),
    max_bytes: int = MAX_BYTES,
) -> set[str]:
    """Walk the whole schema and refuse whatever is not on the allow-list.

    Every JSON object that names a class, a module or a loader counts as a node, wherever it stands: the walk is
    stricter than the loader, never the other way round.

    Parameters
    ----------
    schema : dict
        The parsed ``schema.json``.
    files : mapping of str to bytes
        The entries of the archive.
    name : str
        Name of the file, for messages.
    trusted : iterable of str
        Full names of further types that the caller trusts.
    max_bytes : int, default=2**29
        Most memory that the objects may take, see `pamid._model_archive`.

    Returns
    -------
    set of str
        Full names of all types of the schema; each is allowed.

    Raises
    ------
    HostileModelError
        Something is not on the allow-list, or an entry that a node reads is missing.
    """
    skipped = {"__id__", "file"}
    trust = frozenset(trusted)
    types: set[str] = set()
    contents: dict[Any, int] = {}
    depth = 0
    spent = 0
    read: set[tuple[Any, str]] = set()

    def spend(size: int) -> None:
        nonlocal spent
        spent += size
        if spent > max_bytes // COPIES:
            raise hostile(
                f"{name} describes objects of more than {max_bytes // COPIES} bytes.", "fewer or smaller ones"
            )

    def walk(item: Any) -> int:
        nonlocal depth
        if not isinstance(item, (dict, list)):
            return hash(repr(item))
        depth += 1
        if depth > MAX_DEPTH:
            raise hostile(f"{name} nests its objects more than {MAX_DEPTH} levels deep.", "a shallow model")
        loader = None
        if isinstance(item, dict):
            loader = _check_node(item)
            digest = hash(tuple((hash(key), walk(value)) for key, value in item.items() if key not in skipped))
            if loader is not None and "file" in item:  # one object written twice has two files of one content
                digest = hash((digest, files[item["file"]]))
        else:
            digest = hash(tuple(walk(value) for value in item))
        depth -= 1
        # The loader builds each id once and reuses it: a second, different content would never be looked at.
        if isinstance(item, dict) and loader is not None and "__id__" in item:
            identity = item["__id__"]
            if contents.setdefault(identity, digest) != digest:
                raise hostile(f"{name} uses the object id {identity} for two contents.", "one content an id")
        return digest

    def _check_node(node: dict[str, Any]) -> str | None:
        if not {"__class__", "__module__", "__loader__"} & node.keys():
            return None
        loader, module, cls = (node.get(key) for key in ("__loader__", "__module__", "__class__"))
        if not all(isinstance(part, str) for part in (loader, module, cls)):
            raise hostile(f"{name} holds a node of {module!r}, {cls!r}, {loader!r}.", "names of a type and a loader")
        full = f"{module}.{cls}"
        if not allowed(str(loader), str(module), str(cls), trust):
            raise HostileModelError(
                f"{name} asks for {full[:120]} by {str(loader)[:60]}, which no model of pamid needs.",
                "only scikit-learn's and pamid's own types, arrays and plain containers",
                "Do not load this file. If it is your own and holds a type of yours, pass trusted=[that type].",
            )
        if "__id__" in node and (isinstance(node["__id__"], bool) or not isinstance(node["__id__"], int)):
            raise hostile(f"{name} holds a node with the id {node['__id__']!r}.", "a number")
        if "file" in node:
            ending = _FILE_ENDINGS.get(str(loader), "?")
            file = str(node["file"])
            if file != node["file"] or file not in files or not file.endswith(ending):
                raise hostile(f"{name} reads {file[:80]!r} for {full}.", "the array or bytes of an entry of the file")
            # Each object that reads an array has a copy of it, unless it is the same object once more.
            if (key := (node.get("__id__"), file)) not in read or key[0] is None:
                read.add(key)
                spend(len(files[file]))
        _check_places(node, full)
        if loader == "JsonNode":
            spend(json_cost(str(node.get("content")).encode("utf-8", "replace")))
        if loader != "JsonNode":  # a JsonNode's class says nothing: its content is plain data
            types.add(full)
        return str(loader)

    def _check_places(node: dict[str, Any], full: str) -> None:
        """Refuse a place where it stands in plain sight; where it hides is seen once the objects are built."""
        content = node.get("content")
        attributes = content.get("content") if isinstance(content, dict) else None
        if node["__loader__"] != "ObjectNode" or not isinstance(attributes, dict):
            return
        for key in PLACES & attributes.keys():
            if not isinstance(attributes[key], dict) or attributes[key].get("content") != "null":
                raise HostileModelError(
                    f"{name} gives {full} a place or cache ({key}), which a fit would read or write.",
                    f"{key}=None",
                    f"Set {key}=None before saving; choose one again after loading.",
                )

    limit = sys.getrecursionlimit()
    try:
        sys.setrecursionlimit(max(limit, 4 * MAX_DEPTH + 1000))
        walk(schema)
    except RecursionError:
        raise hostile(f"{name} nests its objects without end.", "a shallow model") from None
    finally:
        sys.setrecursionlimit(limit)
    return types
