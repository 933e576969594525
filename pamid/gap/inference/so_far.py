"""What is known so far: a preliminary answer during the search, and the answer where it is cut short."""

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import numpy as np

from ..settings import EXCESS
from .hypotheses import Single

INTERRUPTED = (
    "The search was interrupted: this is the best answer so far. Causes that were not tried yet may explain the gap as "
    "well, and further ones may be missing."
)
"""What a diagnosis notes that was interrupted."""
_MOST = 3
T = TypeVar("T")


class SoFar(str):
    """A text of progress that is an answer so far: it is shown at once, and stays."""

    __slots__ = ()


def stopped(stop: KeyboardInterrupt) -> None:
    """Re-raise where the system ends the process: only a waiting user wants an answer so far."""
    if type(stop) is not KeyboardInterrupt:
        raise stop


def unless_stopped(step: Callable[[], T], otherwise: Callable[[], T]) -> T:
    """Return the result of a step; where a waiting user interrupts it, what stands without it."""
    try:
        return step()
    except KeyboardInterrupt as stop:
        stopped(stop)
        return otherwise()


def twice(step: Callable[[bool], T]) -> T:
    """Return the result of a last step, which is done again in short where a waiting user interrupts it."""
    return unless_stopped(lambda: step(False), lambda: step(True))


def where_so_far(equations: Sequence[str], scales: np.ndarray) -> SoFar:
    """Return in which equations residuals exceed their noise, and how far."""
    order = [int(k) for k in np.argsort(-scales, kind="stable") if scales[k] > 1.0 + EXCESS]
    if not order:
        return SoFar("no residual exceeds its noise")
    named = [f"{equations[k]} {scales[k]:.2g} times" for k in order[:_MOST]]
    more = f" and {len(order) - _MOST} more" if len(order) > _MOST else ""
    return SoFar(
        f"before parameters are fitted within tolerances, residuals exceed the noise: {', '.join(named)}{more}"
    )


def alone_so_far(singles: Mapping[str, Single]) -> SoFar:
    """Return which effects close most by themselves, to first order."""
    first = [name for name in sorted(singles, key=lambda n: -singles[n].gain) if singles[name].gain > 0.0][:_MOST]
    if not first:
        return SoFar("no single effect improves the fit by more than its parameters cost")
    named = ", ".join(f"{in_words(name)} {singles[name].closed:.0%}" for name in first)
    return SoFar(f"closes most of the gap by itself, by a linear estimate: {named}")


def causes_so_far(names: Sequence[str], closed: float) -> SoFar:
    """Return the best set of causes so far, and the share of the gap that it closes."""
    return SoFar(f"{' and '.join(map(in_words, names))}, which closes {closed:.0%}")


def in_words(name: str) -> str:
    """Return the name of an effect, its port and the logs in which it acts as a person writes them."""
    effect, *places = name.split("@")
    words = [effect.replace("_", " ")]
    for place in places:
        when, _, log = place.partition(" ")
        some = {"from": f"from log {log} on", "until": f"until log {log}"}
        words.append(some.get(when, f"at {place}"))
    return " ".join(words)
