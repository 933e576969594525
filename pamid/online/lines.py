"""Lines as they come, from a pipe or a growing file that may be replaced, cut short or gone for a while."""

import os
import select
import stat
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from ..errors import LogNotFoundError, StreamError

LONGEST_LINE = 1 << 20
"""Most bytes of a line; a longer one is not a sample, and is cut there."""

_PIECE = 1 << 16


class _Cutter:
    """Cut what comes into lines; of an endless one no more is kept than is needed to tell that it is not one."""

    def __init__(self) -> None:
        self.rest = b""
        self.skipping = False

    def take(self, news: bytes) -> Iterator[bytes]:
        *whole, rest = (self.rest + news).split(b"\n")
        if whole and self.skipping:
            whole, self.skipping = whole[1:], False
        yield from whole
        self.rest = b"" if self.skipping else rest
        if len(rest) > LONGEST_LINE:
            if not self.skipping:
                yield rest[:LONGEST_LINE]
            self.rest, self.skipping = b"", True

    def forget(self) -> None:
        self.rest, self.skipping = b"", False


def lines(
    path: str | Path, *, follow: bool = False, poll: float = 0.1, patience: float | None = None
) -> Iterator[bytes | None]:
    """Yield the complete lines of a growing file, also after it was replaced or cut."""
    path = Path(path)
    if not path.is_file():
        raise LogNotFoundError(f"There is no file {path}.", "a file of JSON lines", "Correct the path; '-' is a pipe.")
    cutter, quiet = _Cutter(), 0.0
    stream = _opened(path)
    try:
        while True:
            if stream is not None and (news := _read(stream, cutter)):
                quiet = 0.0
                yield from cutter.take(news)
                continue
            if not follow:
                if cutter.rest:
                    yield cutter.rest
                return
            if stream is None or _replaced(path, stream):
                later = _opened(path) if path.is_file() else None
                if later is not None:
                    cutter.forget()  # the last line will not be completed
                    if stream is not None:
                        stream.close()
                    stream = later
                    continue
            if patience is not None and quiet >= patience:
                return
            yield None
            time.sleep(poll)
            quiet += poll
    finally:
        if stream is not None:
            stream.close()


def _opened(path: Path) -> IO[bytes] | None:
    try:
        stream = path.open("rb", buffering=0)
    except FileNotFoundError:
        return None  # deleted between two reads
    except OSError as error:
        raise StreamError(f"{path} cannot be read: {error.strerror}.", "a readable file", "Check its rights.") from None
    if stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
        return stream
    stream.close()
    return None


def _read(stream: IO[bytes], cutter: _Cutter) -> bytes:
    if os.fstat(stream.fileno()).st_size < stream.tell():
        stream.seek(0)
        cutter.forget()
    return stream.read(_PIECE)


def _replaced(path: Path, stream: IO[bytes]) -> bool:
    try:
        now = path.stat()
    except OSError:
        return False  # deleted; the open file may still grow
    before = os.fstat(stream.fileno())
    return (now.st_dev, now.st_ino) != (before.st_dev, before.st_ino)


def pipe_lines(stream: IO[bytes], *, poll: float = 0.1) -> Iterator[bytes | None]:
    """Yield the lines of a pipe as they come, and None where nothing came for a while."""
    cutter = _Cutter()
    try:
        handle: int | None = stream.fileno()
    except (OSError, AttributeError, TypeError):
        handle = None  # not a pipe of the system
    while True:
        if handle is not None and not select.select([handle], [], [], poll)[0]:
            yield None
            continue
        news = os.read(handle, _PIECE) if handle is not None else stream.read(_PIECE)
        if not news:
            break
        yield from cutter.take(news)
    if cutter.rest:
        yield cutter.rest
