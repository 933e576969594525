"""Reading with other packages: any error of theirs means a damaged file, and their output is suppressed."""

import contextlib
import io
import warnings
from collections.abc import Iterator
from pathlib import Path

from pamid.errors import PamidError, TruncatedLogError


@contextlib.contextmanager
def foreign_reader(path: Path, whole: str) -> Iterator[None]:
    """Turn any error of another package's reader into one error for a damaged file."""
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


@contextlib.contextmanager
def whole_file(
    path: Path,
    errors: tuple[type[Exception], ...],
    whole: str = "a complete file",
    remedy: str = "Copy the log again.",
) -> Iterator[None]:
    """Turn some errors of another package's reader into one error for a damaged file."""
    try:
        yield
    except PamidError:
        raise
    except errors as error:
        said = (str(error).splitlines() or ["no detail"])[0][:160]
        raise TruncatedLogError(f"{path.name} is damaged or cut off: {said}.", whole, remedy) from None


def require_all(path: Path, read: int, said: int | None, whole: str) -> None:
    """Raise if a file states another number of messages than were read."""
    if said is not None and read != said:
        raise TruncatedLogError(
            f"{path.name} is damaged: it declares {said} messages, of which {read} can be read.",
            whole,
            "Copy the log again.",
        )
