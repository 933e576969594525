"""scikit-learn's base classes, with types for those that check them.

They come without types; a class with an untyped base would accept any argument of its constructor.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:

    class BaseEstimator:
        """Parameters, clones and tags."""

        def get_params(self, deep: bool = True) -> dict[str, Any]: ...
        def set_params(self, **params: Any) -> Self: ...
        def __sklearn_tags__(self) -> Any: ...
        def __getattr__(self, name: str) -> Any: ...
        def __setattr__(self, name: str, value: Any) -> None: ...

    class RegressorMixin:
        """The score of a regressor."""

        def score(self, X: Any, y: Any, sample_weight: Any = None) -> float: ...

    class TransformerMixin:
        """What comes of a transformer."""

        def set_output(self, *, transform: str | None = None) -> Self: ...

    class MetaEstimatorMixin:
        """An estimator with another one inside."""
else:
    from sklearn.base import BaseEstimator, MetaEstimatorMixin, RegressorMixin, TransformerMixin

__all__ = ["BaseEstimator", "MetaEstimatorMixin", "RegressorMixin", "TransformerMixin"]
