"""Matrices of a mechanism at many instants: numpy's own functions, over arrays whose last axis is the instants."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np

from .branches import Instants
from .ports import rows_of


def _over_each(name: str) -> Callable[..., Any]:
    """Return a method of arrays that goes over the numbers of each instant, not over the instants."""

    def of(self: Any, axis: Any = None, *given: Any, **options: Any) -> Any:
        plain, depth = np.asarray(self), self.ndim - 1
        if name.startswith("cum") and axis is None:
            plain, depth, axis = plain.reshape(-1, plain.shape[-1]), 1, 0
        some = range(depth) if axis is None else [axis] if np.ndim(axis) == 0 else axis
        over = tuple(k % depth for k in some) if depth else ()
        if not depth or options.get("out") is not None:
            return self
        if name.startswith(("cum", "arg")):
            [over] = over  # they go along one
        return getattr(plain, name)(over, *given, **options).view(type(self))

    return of


class AtEachInstant(Instants):
    """Numbers, vectors or matrices at many instants, the last axis; products and sums are those of each instant."""

    sum, prod, mean, max, min = (_over_each(name) for name in ("sum", "prod", "mean", "max", "min"))
    any, all, cumsum, cumprod, std = (_over_each(name) for name in ("any", "all", "cumsum", "cumprod", "std"))
    var, argmax, argmin = (_over_each(name) for name in ("var", "argmax", "argmin"))

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *given: Any, **options: Any) -> Any:
        """Return what numpy does with the numbers of each instant; constants are the same at all of them."""
        if ufunc is np.matmul and method == "__call__" and not options:
            return product(*given)
        if method != "__call__":
            return NotImplemented
        change = {"out": lambda out: tuple(map(np.asarray, out)), "where": _beside}
        options = {k: change[k](v) if k in change else v for k, v in options.items()}
        found = ufunc(*map(_beside, given), **options)
        return tuple(map(_each, found)) if isinstance(found, tuple) else _each(found)

    def __matmul__(self, other: Any) -> Any:
        return product(self, other)

    def __rmatmul__(self, other: Any) -> Any:
        return product(other, self)

    def dot(self, other: Any, out: Any = None) -> Any:
        """Return the product at each instant."""
        return product(self, other)

    @property
    def T(self) -> Any:
        """The transpose at each instant."""
        return np.moveaxis(np.transpose(self), 0, -1)

    def reshape(self, *shape: Any, order: Any = "C") -> Any:  # type: ignore[override]
        """Return the numbers of each instant in another shape."""
        [shape] = shape if len(shape) == 1 and np.ndim(shape[0]) else [shape]
        return np.asarray(self).reshape(*shape, self.shape[-1]).view(type(self))

    def flatten(self, order: Any = "C") -> Any:
        """Return the numbers of each instant as a vector."""
        return self.reshape(-1)

    ravel = flatten


def _each(value: Any) -> Any:
    return np.asarray(value).view(AtEachInstant)


def _beside(value: Any) -> Any:
    """Return a value with the instants as its last axis, as an array; of a constant that axis has one entry."""
    found, depth = _stacked(value)
    return found if found.ndim > depth or not depth else found[..., None]


def _depth(value: Any) -> int:
    """Return how many axes a value has at one instant."""
    return np.ndim(value) - isinstance(value, AtEachInstant)


def product(a: Any, b: Any) -> Any:
    """Return the product of two values at each instant."""
    rows, columns = _stacked(a)[1], _stacked(b)[1]
    if not (rows and columns):
        return _each(_beside(a) * _beside(b))
    if not (rows <= 2 and columns <= 2):
        raise ValueError("products are of vectors and matrices")
    left, right = "ij"[2 - rows :], "jk"[:columns]
    out = left[:-1] + right[1:]
    return _each(np.einsum(f"{left}...,{right}...->{out}...", _beside(a), _beside(b)))


def _stacked(value: Any) -> tuple[np.ndarray, int]:
    """Return nested lists as an array, with its number of axes at one instant."""
    if not isinstance(value, (list, tuple)):
        value = rows_of(value)
        return np.asarray(value), _depth(value)
    parts, depths = zip(*map(_stacked, value), strict=True)
    if len(set(depths)) > 1:
        raise ValueError("rows of different length")
    depth = depths[0]
    if any(part.ndim > depth for part in parts):  # the others are the same at each instant
        parts = np.broadcast_arrays(*(part if part.ndim > depth else part[..., None] for part in parts))
    return np.stack(parts), depth + 1


def _array(value: Any, *given: Any, **options: Any) -> Any:
    return _each(_beside(value).astype(float))


def _joined(parts: Any, axis: int = 0) -> Any:
    """Return vectors or matrices put together at each instant."""
    some = list(map(_beside, parts))
    n = max(one.shape[-1] for one in some)
    wide = [np.broadcast_to(one, (*one.shape[:-1], n)) for one in some]
    return _each(np.concatenate(wide, axis % (some[0].ndim - 1)))


def _beside_each_other(parts: Any) -> Any:
    """Return what `numpy.hstack` does at each instant."""
    some = [part if _stacked(part)[1] else _array([part]) for part in parts]
    return _joined(some, 0 if _stacked(some[0])[1] == 1 else 1)


def _length(value: Any) -> Any:
    found, depth = _stacked(value)
    return _each(np.sqrt(np.sum(np.square(found), axis=tuple(range(depth)))))


def _crossed(a: Any, b: Any) -> Any:
    """Return the cross product at each instant."""
    return _each(np.moveaxis(np.cross(_first(a), _first(b)), 0, -1))


def _summed(form: str) -> Callable[..., Any]:
    """Return a function that is a sum over indices at each instant."""

    def of(*given: Any) -> Any:
        return _each(np.einsum(form, *map(_beside, given)))

    return of


def _diagonal(a: Any) -> Any:
    found, depth = _stacked(a)
    if depth == 2:
        return _each(np.einsum("ii...->i...", found))
    return _each(np.eye(len(found))[..., None] * found[:, None])


def _below_each_other(parts: Any) -> Any:
    """Return what `numpy.vstack` does at each instant."""
    return _joined([part if _stacked(part)[1] > 1 else _array([part]) for part in parts])


def _where(condition: Any, *either: Any) -> Any:
    return _each(np.where(*map(_beside, (condition, *either))))


def _first(value: Any) -> np.ndarray:
    """Return matrices or vectors with the instants as the first axis, which numpy's linear algebra expects."""
    return np.moveaxis(np.asarray(value), -1, 0) if isinstance(value, AtEachInstant) else np.asarray(value)[None]


def _solve(a: Any, b: Any) -> Any:
    vector = _depth(b) == 1
    found = np.linalg.solve(_first(a), _first(b)[..., None] if vector else _first(b))
    return np.moveaxis(found[..., 0] if vector else found, 0, -1).view(AtEachInstant)


def _of(plain: Callable[..., Any]) -> Callable[[Any], Any]:
    return lambda a: np.moveaxis(plain(_first(a)), 0, -1).view(AtEachInstant)


def _at_each(plain: Callable[..., Any], n: int) -> Callable[..., Any]:
    """Return a function that makes an array, so that it makes one at each of n instants, to be filled."""

    def of(*given: Any, **options: Any) -> Any:
        return np.repeat(plain(*given, **options)[..., None], n, axis=-1).view(AtEachInstant)

    return of


def _many(value: Any) -> bool:
    """Return whether a value, or something in a list, is of many instants."""
    if isinstance(value, (list, tuple)):
        return any(map(_many, value))
    return isinstance(rows_of(value), AtEachInstant)


def _at_many(plain: Callable[..., Any], made: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that goes instant by instant where what it is given is of many."""

    def of(*given: Any, **options: Any) -> Any:
        return (made if any(map(_many, given)) else plain)(*given, **options)

    return of


_NORMS: dict[str, Callable[..., Any]] = {
    "solve": _solve, "inv": _of(np.linalg.inv), "det": _of(np.linalg.det), "norm": _length,
}  # fmt: skip
_OWN: dict[str, Callable[..., Any]] = {
    "array": _array, "asarray": _array, "stack": _array, "where": _where, "dot": product, "matmul": product,
    "concatenate": _joined, "hstack": _beside_each_other, "vstack": _below_each_other, "cross": _crossed,
    "outer": _summed("i...,j...->ij..."), "trace": _summed("ii...->..."), "diag": _diagonal,
}  # fmt: skip
_MADE = "zeros", "ones", "empty", "eye", "identity"


def matrices(n: int) -> Mapping[int, Any]:
    """Return what takes the place of numpy and its functions for n instants, by the identity of what it replaces."""
    solved = {name: _at_many(getattr(np.linalg, name), made) for name, made in _NORMS.items()}
    linalg = SimpleNamespace(**vars(np.linalg) | solved)
    own = {name: _at_many(getattr(np, name), made) for name, made in _OWN.items()}
    own |= {name: _at_each(getattr(np, name), n) for name in _MADE}
    out = {id(getattr(np, name)): made for name, made in own.items()}
    out |= {id(getattr(np.linalg, name)): made for name, made in solved.items()}
    return out | {id(np): SimpleNamespace(**vars(np) | own | {"linalg": linalg}), id(np.linalg): linalg}
