"""Matrices of a mechanism at many instants: numpy's own functions, over arrays whose last axis is the instants."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np

from .branches import Instants


class AtEachInstant(Instants):
    """Numbers, vectors or matrices at many instants, the last axis; products are those of each instant."""

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

    def flatten(self, order: Any = "C") -> Any:
        """Return the numbers of each instant as a vector."""
        return self.reshape(-1, self.shape[-1])

    ravel = flatten


def _depth(value: Any) -> int:
    """Return how many axes a value has at one instant."""
    return np.ndim(value) - isinstance(value, AtEachInstant)


def product(a: Any, b: Any) -> Any:
    """Return the product of two values, of which at least one is of many instants, at each instant."""
    if not (isinstance(a, AtEachInstant) or isinstance(b, AtEachInstant)):
        return np.dot(a, b)
    rows, columns = _depth(a), _depth(b)
    if not (0 < rows <= 2 and 0 < columns <= 2):
        raise ValueError("products are of vectors and matrices")
    left, right = "ij"[2 - rows :], "jk"[:columns]
    out = left[:-1] + right[1:]
    return np.einsum(f"{left}...,{right}...->{out}...", np.asarray(a), np.asarray(b)).view(AtEachInstant)


def _stacked(value: Any) -> tuple[np.ndarray, int]:
    """Return nested lists as an array, with its number of axes at one instant."""
    if not isinstance(value, (list, tuple)):
        return np.asarray(value), _depth(value)
    parts, depths = zip(*map(_stacked, value), strict=True)
    if len(set(depths)) > 1:
        raise ValueError("rows of different length")
    depth = depths[0]
    if any(part.ndim > depth for part in parts):  # the others are the same at each instant
        parts = np.broadcast_arrays(*(part if part.ndim > depth else part[..., None] for part in parts))
    return np.stack(parts), depth + 1


def _array(value: Any, *given: Any, **options: Any) -> Any:
    found, depth = _stacked(value)
    if found.ndim == depth:
        return np.array(value, *given, **options)
    return found.astype(float).view(AtEachInstant)


def _where(condition: Any, *either: Any) -> Any:
    found = np.where(condition, *either)
    return found.view(AtEachInstant) if any(isinstance(one, AtEachInstant) for one in (condition, *either)) else found


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


def matrices(n: int) -> Mapping[int, Any]:
    """Return what takes the place of numpy and its functions for n instants, by the identity of what it replaces."""
    solved = {"solve": _solve, "inv": _of(np.linalg.inv), "det": _of(np.linalg.det)}
    linalg = SimpleNamespace(**vars(np.linalg) | solved)
    own = {"array": _array, "asarray": _array, "where": _where, "dot": product, "matmul": product}
    own |= {name: _at_each(getattr(np, name), n) for name in ("zeros", "ones", "empty", "eye", "identity")}
    out = {id(getattr(np, name)): made for name, made in own.items()}
    out |= {id(getattr(np.linalg, name)): made for name, made in solved.items()}
    return out | {id(np): SimpleNamespace(**vars(np) | own | {"linalg": linalg}), id(np.linalg): linalg}
