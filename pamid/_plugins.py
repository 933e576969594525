"""What other packages bring: effects, kinds of simulators and readers of logs, declared as entry points.

``importlib.metadata`` is asked when the first effect, page or log is, so ``import pamid`` stays quick.
"""

import warnings
from collections.abc import Iterator
from typing import Any

from .errors import PamidWarning


def plugins(group: str, expected: str) -> Iterator[tuple[str, Any]]:
    """Yield entry points of installed packages in a group, by name; warn of those that cannot be loaded."""
    from importlib.metadata import entry_points

    for entry in sorted(entry_points(group=group), key=lambda e: (e.name, e.value)):
        package = entry.dist.name if entry.dist is not None else entry.module
        source = f"{group}: {entry.name} of the package {package}"
        try:
            thing = entry.load()
        except Exception as error:  # another package's code: whatever it raises must not stop pamid
            left_out(source, f"{type(error).__name__}: {' '.join(str(error).split())[:200]}", expected)
        else:
            yield source, thing


def left_out(source: str, found: str, expected: str) -> None:
    """Warn that a plug-in is left out."""
    warnings.warn(
        f"{source} is left out ({found}). Expected {expected}. Update or uninstall that package.",
        PamidWarning,
        stacklevel=2,
    )
