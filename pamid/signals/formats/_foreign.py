"""Reading by packages of other people: whatever they raise is a damaged file, and what they print stays unseen."""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Iterator
from pathlib import Path

from pamid.errors import PamidError, TruncatedLogError


@contextlib.contextmanager
def foreign_reader(path: Path, whole: str) -> Iterator[None]:
    """Turn what a reader of somebody else's raises into one error of a damaged file."""
    try:
        with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except PamidError:
        raise
    except Exception as error:
        detail = " ".join(str(error).split())[:120]
        raise TruncatedLogError(
            f"{path.name} is damaged or cut off: {type(error).__name__}{': ' if detail else ''}{detail}.",
            whole,
            "Copy the log again.",
        ) from None


def require_all(path: Path, read: int, said: int | None, whole: str) -> None:
    """Raise where a file says that it holds another number of messages than were read."""
    if said is not None and read != said:
        raise TruncatedLogError(
            f"{path.name} is damaged: it declares {said} messages, of which {read} can be read.",
            whole,
            "Copy the log again.",
        )
