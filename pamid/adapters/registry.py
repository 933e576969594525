"""Which adapters there are: found in the modules of this folder, so that a new one is one new file and no list."""

import inspect
from functools import cache
from typing import Any

from .._discovery import subclasses
from ..errors import UnknownOptionError
from .base import Adapter


@cache
def adapters() -> dict[str, Any]:
    """Return the adapters of the package by their names."""
    return {c.name: c for c in subclasses("pamid.adapters", Adapter, leave_out=("base", "registry"))}


def adapter_named(adapter: Any) -> Any:
    """Return an adapter by its name, with its default parameters, or the adapter itself.

    Examples
    --------
    >>> from pamid.adapters.registry import adapter_named
    >>> adapter_named("low_rank")
    LowRank(ranks=(2, 4))
    """
    if isinstance(adapter, str) and adapter in adapters():
        return adapters()[adapter]()
    if isinstance(adapter, str) or inspect.isclass(adapter) or not isinstance(adapter, Adapter):
        raise UnknownOptionError(
            f"adapter={adapter!r} is not known.",
            f"one of {', '.join(adapters())}, or an adapter such as LowRank(ranks=(1, 2))",
            "Choose one of these.",
        )
    return adapter
