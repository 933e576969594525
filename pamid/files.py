"""Write a file whole or not at all."""

from __future__ import annotations

import contextlib
import os
import tempfile
from pathlib import Path

from .errors import OutputError


def write_whole(path: str | Path, data: bytes | str) -> Path:
    """Write a file beside its destination, flush it to disk and move it into place.

    A crash at any moment leaves either the old file or the new one, and of two processes that write one file the later
    one wins; neither leaves half a file.

    Parameters
    ----------
    path : path-like
        The file; an existing one is replaced.
    data : bytes or str
        Its content; text is written as UTF-8.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    OutputError
        The file cannot be written, for instance because the disk is full.
    """
    path = Path(path)
    content = data.encode("utf-8") if isinstance(data, str) else data
    temporary: str | None = None
    try:
        descriptor, temporary = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".tmp", dir=path.parent)
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        umask = os.umask(0)
        os.umask(umask)
        Path(temporary).chmod(0o666 & ~umask)  # mkstemp keeps the file to its owner
        Path(temporary).replace(path)
        temporary = None
    except OSError as error:
        raise OutputError(
            f"{path} cannot be written: {error.strerror or error}.",
            "a file name in a folder that can be written to",
            "Create the folder, free some space, or choose another path.",
        ) from None
    finally:
        if temporary is not None:
            with contextlib.suppress(OSError):
                Path(temporary).unlink()
    with contextlib.suppress(OSError):  # the rename itself is durable only once the folder is flushed
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
    return path
