"""What a loaded model may hold: the walk over everything that was built, before anybody is given it.

A schema says in many ways what an object shall be, so the judgement is made on the objects themselves: their attributes
are those that their class sets, their values plain data, arrays or objects of the allow-list; nothing is a place on a
disk, a cache, or something to be called; and what belongs together fits together (`pamid._model_fit`).
"""

import ast
import dataclasses
import inspect
import sys
from collections import OrderedDict
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from ._model_archive import hostile
from ._model_fit import misfit
from ._model_types import PLACES, allowed, functions
from .errors import HostileModelError

MOST_JOBS = 64

_PLAIN = (type(None), bool, int, float, complex, str, bytes, slice)
_SCORER_FUNCTION = ("sklearn.metrics._scorer", "_score_func")
_REQUESTS = ("sklearn.utils._metadata_requests", "MetadataRequest")
_EVERYWHERE = {"n_features_in_", "feature_names_in_", "_sklearn_version", "_sklearn_output_config", "_metadata_request"}


def check_model(model: Any, name: str, trusted: frozenset[str] = frozenset()) -> None:
    """Refuse a model with contents that no model of pamid needs, or with inconsistent parts."""
    _Walk(name, trusted).visit(model, type(model).__name__)


class _Walk:
    def __init__(self, name: str, trusted: frozenset[str]) -> None:
        self.name = name
        self.trusted = trusted
        self.seen: dict[int, Any] = {}  # keeps what was seen alive, so that no identity comes twice

    def visit(self, value: Any, where: str) -> None:
        if type(value) in _PLAIN:
            return
        if id(value) in self.seen:
            return
        self.seen[id(value)] = value
        if type(value) in (list, tuple, set, frozenset):
            for k, item in enumerate(value):
                self.visit(item, f"{where}[{k}]")
        elif type(value) in (dict, OrderedDict):
            for key, item in value.items():
                self.visit(key, f"a key of {where}")
                self.visit(item, f"{where}[{key!r:.40}]")
        elif isinstance(value, (np.ndarray, np.generic)):
            self._array(value, where)
        elif isinstance(value, np.random.RandomState):
            self._random(value, where)
        elif isinstance(value, (type, np.dtype)):
            self._dtype(value, where)
        else:
            self._object(value, where)

    def _array(self, value: Any, where: str) -> None:
        if value.dtype.kind not in "biufcSUO" or type(value) not in (np.ndarray, np.ma.MaskedArray, value.dtype.type):
            raise self._refusal(where, f"an array of {value.dtype}", "numbers, booleans and text")
        if value.dtype.kind == "O":
            for item in np.ma.getdata(value).ravel():
                self.visit(item, f"an item of {where}")

    def _random(self, value: np.random.RandomState, where: str) -> None:
        state = value.get_state(legacy=False)
        # numpy reads the key at this position without a look at its length.
        if state["bit_generator"] != "MT19937" or not 0 <= state["state"]["pos"] <= len(state["state"]["key"]):
            raise self._refusal(where, "a random generator in a state that it cannot be in", "one from numpy")

    def _dtype(self, value: Any, where: str) -> None:
        kind = getattr(np, "dtype", None)
        try:
            plain = value in (bool, int, float, str, type(None)) or (kind and np.dtype(value).kind in "biufcSU")
        except TypeError:
            plain = False
        if not plain and f"{value.__module__}.{value.__qualname__}" not in self.trusted:
            raise self._refusal(where, f"the type {value!r:.80}", "types of numbers")

    def _object(self, value: Any, where: str) -> None:
        cls = type(value)
        full = f"{cls.__module__}.{cls.__qualname__}"
        if inspect.isroutine(value) or isinstance(value, np.ufunc):
            raise self._refusal(where, f"{value!r:.80}, something to call", "names of functions, not functions")
        trusted = full in self.trusted
        if not trusted and not any(
            allowed(loader, cls.__module__, cls.__qualname__, frozenset()) for loader in ("ObjectNode", "TupleNode")
        ):
            raise self._refusal(where, f"a {full}", "scikit-learn's and pamid's own types, arrays and plain containers")
        if isinstance(value, tuple):
            for item in value:
                self.visit(item, where)
        for key, item in getattr(value, "__dict__", {}).items():
            inside = f"{where}.{key}"
            if not trusted:
                self._attribute(cls, key, item, inside)
            if (cls.__module__, key) == _SCORER_FUNCTION and self._is_metric(item):
                continue
            self.visit(item, inside)
        if not trusted and (said := misfit(value)):
            raise hostile(f"In {self.name} {where} does not fit together: {said}.", "arrays of one fit")

    def _attribute(self, cls: type, key: Any, value: Any, where: str) -> None:
        if not isinstance(key, str) or key not in attributes(cls) or callable(getattr(cls, key, None)):
            raise self._refusal(where, f"an attribute that {cls.__name__} does not have", "those that its fit sets")
        if key in PLACES and value is not None:
            raise HostileModelError(
                f"{self.name} holds {where} = {value!r:.60}, a place or cache that a fit would read or write.",
                f"{key}=None",
                f"Set {key}=None before saving; choose one again after loading.",
            )
        if key == "n_jobs" and not (value is None or (type(value) is int and -1 <= value <= MOST_JOBS)):
            raise self._refusal(where, f"{value!r:.40} jobs", f"None or -1 to {MOST_JOBS}")
        if key == "pre_dispatch" and value not in ("all", "2*n_jobs") and type(value) is not int:
            raise self._refusal(where, f"{value!r:.40}", "'2*n_jobs', 'all' or a number")

    def _is_metric(self, value: Any) -> bool:
        known = inspect.isfunction(value) and f"{value.__module__}.{value.__name__}" in functions()
        return known and getattr(sys.modules[value.__module__], value.__name__, None) is value

    def _refusal(self, where: str, found: str, expected: str) -> HostileModelError:
        return hostile(f"{self.name} holds {found} as {where[:120]}.", expected)


@cache
def attributes(cls: type) -> frozenset[str]:
    """Return the names of the attributes that the code of a class, its bases and their modules sets on an object."""
    names = set(_EVERYWHERE)
    for c in cls.__mro__:
        if c.__module__.partition(".")[0] not in ("sklearn", "pamid", "estimators"):
            continue
        names |= _assigned(c.__module__) | set(inspect.get_annotations(c))
        start: Callable[..., Any] | None = c.__dict__.get("__init__")
        if start is not None:
            names |= set(inspect.signature(start).parameters) - {"self"}
        if dataclasses.is_dataclass(c):
            names |= {field.name for field in dataclasses.fields(c)}
        if (c.__module__, c.__name__) == _REQUESTS:  # it has one attribute a method that may ask for something
            names |= set(sys.modules[c.__module__].SIMPLE_METHODS)
    return frozenset(names)


@cache
def _assigned(module: str) -> frozenset[str]:
    """Return the names after a dot that a module assigns to, such as ``coef_`` in ``self.coef_ = ...``."""
    source = inspect.getsource(sys.modules[module])
    return frozenset(
        node.attr
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) and isinstance(node.value, ast.Name)
    )
