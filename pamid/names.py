"""Names that somebody gives, checked against those that there are."""

from collections.abc import Callable, Collection, Iterable
from typing import Any

from .errors import PamidError, UnknownOptionError, UnknownParameterError

REMOVE = "Remove or correct the name."
"""What to do about a name that nobody knows."""


def require_one_of(
    name: Any, offered: Collection[str], says: str, remedy: str = "Correct the name.",
    error: type[PamidError] = UnknownOptionError,
) -> None:  # fmt: skip
    """Raise unless a name is among those offered; `says` is what is said of one that is not."""
    if name not in offered:
        raise error(says, f"one of {', '.join(offered)}", remedy)


def refuse_others(
    given: Iterable[str], known: Iterable[str], says: str, expected: str = "", remedy: str = "Correct the name.",
    error: type[PamidError] = UnknownParameterError, spelt: Callable[[str], str] = str,
) -> None:  # fmt: skip
    """Raise where names are given that are not known; `says` what they are said to be of."""
    names = list(known)
    if others := sorted(set(given) - set(names)):
        raise error(f"{says} {', '.join(map(spelt, others))}.", expected or f"only {', '.join(names)}", remedy)
