"""Which types a model file may bring to life: an allow-list by kind of node, and the audit of a schema against it.

The list is closed: the few types of scikit-learn that pipelines and searches need, numpy and Python containers, the
estimators of `pamid.estimators`, the trainers, splitters and dataclasses of pamid. Whatever else a file
names is refused before anything is built, and no module outside these packages is imported to look.
"""

import dataclasses
import importlib
import inspect
from functools import cache

import numpy as np

from ._discovery import module_names

MAX_DEPTH = 400
_DATACLASS_PACKAGES = (
    "pamid.laws",
    "pamid.volume",
    "pamid.training",
    "pamid.adapters",
    "pamid.signals",
    "pamid.effects",
    "pamid.simulators",
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
FILE_ENDINGS = {"NdArrayNode": ".npy", "BytesNode": ".bin"}


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
    "sklearn.utils._metadata_requests": ("MetadataRequest", "MethodMetadataRequest"),  # of a scorer, before 1.8
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
    return frozenset(name for package in _DATACLASS_PACKAGES for name in module_names(package, nested=True))


@cache
def own_estimators() -> frozenset[str]:
    """Return the public estimators of the package."""
    from pamid.estimators import all_estimators

    return frozenset(f"{c.__module__}.{c.__qualname__}" for _, c in all_estimators())


@cache
def own_type(module: str, name: str) -> bool:
    """Return whether a type is a public estimator, a trainer, splitter, dataclass or named tuple of pamid."""
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
    """Return whether a node of this kind may bring this type to life."""
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
