"""Write a file whole or not at all, and see beforehand whether it can be written."""

import contextlib
import os
import secrets
import signal
import stat
import threading
from collections.abc import Iterator
from pathlib import Path

from .errors import OutputError, PamidError

PROBE = 1 << 16
"""Bytes that are written to see whether there is room, unless the caller knows better."""


@contextlib.contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Yield a draft beside a file; when the body ends, flush it and move it into place in one step."""
    path = Path(path)
    draft: Path | None = None
    try:
        target = _regular(path)
        draft = target.parent / draft_name()
        _create(draft)
        yield draft
        flush(draft)
        if target.exists():
            draft.chmod(stat.S_IMODE(target.stat().st_mode))
        draft.replace(target)
        draft = None
        _flush_folder(target.parent)
    except OSError as error:
        raise unwritable(path, error) from None
    finally:
        if draft is not None:
            _remove(draft)


def write_whole(path: str | Path, data: bytes | str) -> Path:
    """Write a file beside its destination, flush it to disk and move it into place, see `replacing`."""
    path = Path(path)
    with replacing(path) as draft:
        # Half of a surrogate pair in a log's names is written as a question mark.
        draft.write_bytes(data.encode("utf-8", errors="replace") if isinstance(data, str) else data)
    return path


def check_file(path: str | Path, size: int = PROBE) -> Path:
    """Return the path of a file that can be written, before anything expensive starts."""
    target = Path(path)
    folder = target.parent
    if not folder.is_dir():
        raise OutputError(f"The folder {folder} does not exist.", "an existing folder", "Create it first.")
    if target.is_dir():
        raise OutputError(f"{target} is a folder.", "the name of a file", "Add a file name.")
    try:
        probe(_regular(target).parent, size)
    except OSError as error:
        raise unwritable(target, error) from None
    return target


def probe(folder: Path, size: int = PROBE) -> None:
    """Write and remove a draft of some bytes in a folder; errors of the system pass."""
    draft = folder / draft_name()
    try:
        _create(draft)
        with draft.open("r+b") as stream:
            stream.write(b"\1" * size)  # zeros may be kept as a hole, which takes no room
            stream.flush()
            os.fsync(stream.fileno())
    finally:
        _remove(draft)


def draft_name() -> str:
    """Return a hidden name that nothing else has."""
    return f".pamid-{secrets.token_hex(6)}.tmp"


def flush(file: Path) -> None:
    """Wait until the content of a file is on disk."""
    with file.open("rb") as stream:
        os.fsync(stream.fileno())


def _flush_folder(folder: Path) -> None:
    """Make a rename durable; some file systems cannot flush a folder, and lose no content by it."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def unwritable(path: Path, error: OSError) -> Exception:
    """Word an error of the system for whoever wants to write there."""
    if isinstance(error, PamidError):
        return error
    return OutputError(
        f"{path} cannot be written: {error.strerror or error}.",
        "a file or folder that can be written to, with room on its disk",
        "Create the folder, free some space, or choose another path.",
    )


def _create(draft: Path) -> None:
    os.close(os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))  # the user's umask decides on its mode


def _remove(draft: Path) -> None:
    with signals_wait(), contextlib.suppress(OSError):
        draft.unlink()


@contextlib.contextmanager
def signals_wait() -> Iterator[None]:
    """Defer Ctrl-C and termination to the end of the body."""
    if threading.current_thread() is not threading.main_thread():
        yield  # signals are handled in the main thread alone
        return
    came: list[int] = []
    before = {
        number: signal.signal(number, lambda number, _frame: came.append(number))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler if handler is not None else signal.SIG_DFL)
        for received in came:
            signal.raise_signal(received)


def _regular(path: Path) -> Path:
    """Return the file itself that a path leads to; a device, pipe or protected file is not replaced."""
    target = Path(os.path.realpath(path)) if path.is_symlink() else path
    if not target.exists() or target.is_dir():  # the system says best what is wrong with a folder
        return target
    if not target.is_file():
        raise OutputError(f"{path} is a device or a pipe.", "the name of a file", "Choose another path.")
    if not os.access(target, os.W_OK):
        raise OutputError(f"{path} is protected against writing.", "a file that may be replaced", "Choose another one.")
    return target


def named_from(path: Path, folder: Path) -> str:
    """Return the name of a file as a simulator file in a folder calls it."""
    return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()
