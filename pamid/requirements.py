"""What estimators declare of themselves, and one checker that words the error where a declaration does not fit.

An estimator declares ``reads`` (the signals it takes from X), ``equations`` (what it learns), ``outputs`` (of which it
runs freely), ``sequential`` (whether rows are read in order) and ``settings(equation)`` (those that are compared).
An estimator of somebody else's declares nothing; what holds for it then is said by the caller.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from .errors import IncompatibleError


def reads_of(model: Any, otherwise: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the signals that an estimator reads from X.

    Parameters
    ----------
    model : estimator
        Any estimator, or a class of estimators.
    otherwise : sequence of str, default=()
        What to take where it does not say.

    Examples
    --------
    >>> from pamid.estimators import GeometricForce
    >>> from pamid.requirements import reads_of
    >>> reads_of(GeometricForce())
    ('eps', 'P')
    """
    return tuple(getattr(model, "reads", otherwise))


def is_sequential(model: Any) -> bool:
    """Tell whether an estimator reads the sequence of samples, as it says itself or by its parameters."""
    return bool(getattr(model, "sequential", "one_trajectory" in model.get_params()))


def check_reads(
    model: Any,
    allowed: Collection[str],
    *,
    needed: Collection[str] = (),
    sequential: bool = True,
    otherwise: Sequence[str] = (),
    instead: str,
) -> tuple[str, ...]:
    """Return the signals that an estimator reads, once they are known to fit.

    Parameters
    ----------
    model : estimator
        What is asked.
    allowed : collection of str
        Signals that can be given.
    needed : collection of str, default=()
        Signals that it has to read.
    sequential : bool, default=True
        Whether one that reads the sequence of samples will do.
    otherwise : sequence of str, default=()
        What to take where it does not say.
    instead : str
        What to choose instead, a sentence.

    Raises
    ------
    IncompatibleError
        If it reads other signals, not all that are needed, or sequences where single rows are given.
    """
    reads = reads_of(model, otherwise)
    ordered = not sequential and is_sequential(model)
    if ordered or set(reads) - set(allowed) or set(needed) - set(reads) or not reads:
        rows = "" if sequential else " of single rows"
        least = f", at least of {', '.join(needed)}" if needed else ""
        raise IncompatibleError(
            f"{type(model).__name__} reads {', '.join(reads) or 'unknown signals'}{' in sequence' if ordered else ''}.",
            f"a model{rows} of {', '.join(allowed)}{least}",
            instead,
        )
    return reads
