"""Several files of a folder as one: readers see the old set or the new one, and the user's other files stay."""

import contextlib
import ctypes
import json
import os
import re
import shutil
import sys
from collections.abc import Callable, Collection, Iterator
from functools import cache
from pathlib import Path
from typing import Any

from .errors import OutputError
from .files import PROBE, check_file, draft_name, flush, probe, signals_wait, unwritable

UNFINISHED = "UNFINISHED-pamid.json"
"""File that tells of a set whose move into its folder was cut off, and from which the next writer ends it."""

MOST_OTHERS = 1000
"""Other files of a folder up to which the folder is exchanged as a whole."""

_DRAFT = re.compile(r"\.pamid-[0-9a-f]{12}\.tmp")
_MESSAGE = "pamid was stopped while it moved these files here; the next pamid command that writes here ends it"


@contextlib.contextmanager
def replacing_together(folder: str | Path, names: Collection[str], *, parents: bool = False) -> Iterator[Path]:
    """Yield an empty folder; when the body ends, its files replace those in the folder as one set.

    A new folder comes by one rename, one of plain files by one exchange where the system has it; else files move one by
    one, and `UNFINISHED` lets the next writer complete what a kill interrupted.
    """
    folder = Path(folder)
    stage: Path | None = None
    try:
        if parents:
            folder.parent.mkdir(parents=True, exist_ok=True)
        stage = (folder.parent if _as_a_whole(folder) else folder) / draft_name()
        stage.mkdir()
        yield stage
        with signals_wait():
            _commit(stage, folder, names)
        stage = None
    except OutputError as error:
        if stage is None or str(stage) not in error.found:
            raise
        found = error.found.replace(str(stage), str(folder))  # nobody knows the draft by its name
        raise OutputError(found, error.expected, error.remedy) from None
    except OSError as error:
        raise unwritable(folder, error) from None
    finally:
        if stage is not None and not _is_unfinished(stage):
            with signals_wait():
                shutil.rmtree(stage, ignore_errors=True)


def check_folder(folder: str | Path, names: Collection[str] = (), *, parents: bool = False, size: int = PROBE) -> Path:
    """Return the path of a folder that can take a set of files, before anything expensive starts."""
    target = Path(folder)
    if target.is_dir():
        for name in names:
            if (target / name).exists() or (target / name).is_symlink():
                check_file(target / name, 0)
        where = target
    elif target.exists() or target.is_symlink():
        raise OutputError(f"{target} is a file.", "the name of a folder", "Choose another --out.")
    else:
        where = target.absolute().parent
        while parents and not where.exists():
            where = where.parent
        if not where.is_dir():
            raise OutputError(f"The folder {where} does not exist.", "an existing folder", "Create it first.")
    try:
        probe(where, size)
    except OSError as error:
        raise unwritable(target, error) from None
    return target


# --- the moment at which the files take their place ------------------------------------------------------------
def _commit(stage: Path, folder: Path, names: Collection[str]) -> None:
    written = [entry.name for entry in stage.iterdir()]
    for name in written:
        flush(stage / name)
    if not folder.exists():
        with contextlib.suppress(OSError):  # another writer has made it meanwhile
            stage.rename(folder)
            return
    if stage.parent != folder:
        if _as_a_whole(folder) and _exchanged(stage, folder, names):
            return
        stage = stage.rename(folder / stage.name)
    _move_in(stage, folder, written, names)


def _as_a_whole(folder: Path) -> bool:
    """Return whether nothing speaks against putting another folder in this one's place."""
    if not folder.exists():
        return True
    here, about = Path.cwd(), folder.stat()
    if folder.is_symlink() or folder.is_mount() or here.is_relative_to(folder.resolve()):
        return False
    if (about.st_uid, about.st_gid) != (os.geteuid(), folder.parent.stat().st_gid) or _system_exchange() is None:
        return False
    if not os.access(folder.parent, os.W_OK) or (folder / UNFINISHED).exists():
        return False
    with os.scandir(folder) as entries:
        return all(k < MOST_OTHERS and e.is_file(follow_symlinks=False) for k, e in enumerate(entries))


def _exchanged(stage: Path, folder: Path, names: Collection[str]) -> bool:
    """Exchange the two folders; False, with the stage as it was, where the file system cannot."""
    exchange = _system_exchange()
    assert exchange is not None
    links: dict[str, tuple[int, int]] = {}
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                if entry.name not in names and not (stage / entry.name).exists():
                    os.link(entry.path, stage / entry.name, follow_symlinks=False)
                    links[entry.name] = _identity(stage / entry.name)
        shutil.copystat(folder, stage)
        exchange(stage, folder)
    except OSError:
        for name in links:
            (stage / name).unlink(missing_ok=True)
        return False
    for old in list(stage.iterdir()):  # what somebody has put there or replaced since belongs to the new folder
        if old.name not in names and links.get(old.name) != _identity(old):
            old.replace(folder / old.name)
    shutil.rmtree(stage, ignore_errors=True)
    return True


def _identity(file: Path) -> tuple[int, int]:
    about = file.lstat()
    return about.st_dev, about.st_ino


@cache
def _system_exchange() -> Callable[[Path, Path], None] | None:
    """Return the system call that exchanges two paths, where the system has it."""
    if not sys.platform.startswith("linux"):
        return None
    function = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if function is None:
        return None
    here, exchange = -100, 2  # AT_FDCWD, RENAME_EXCHANGE

    def both(one: Path, other: Path) -> None:
        if function(here, os.fsencode(one), here, os.fsencode(other), exchange) != 0:
            raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))

    return both


def _move_in(stage: Path, folder: Path, written: list[str], names: Collection[str]) -> None:
    """Move files one by one; what a kill cuts off, the next writer ends."""
    with _alone_in(folder):
        _finish_others(folder, names)
        stale = [name for name in names if name not in written]
        record = {"what": _MESSAGE, "from": stage.name, "move": written, "remove": stale}
        draft = stage / UNFINISHED
        draft.write_text(json.dumps(record, indent=1), encoding="utf-8")
        flush(draft)
        draft.replace(folder / UNFINISHED)
        _redo(folder, record)
    shutil.rmtree(stage, ignore_errors=True)


def _redo(folder: Path, record: dict[str, Any]) -> None:
    """Complete the moves of a record."""
    for name in record["remove"]:
        (folder / name).unlink(missing_ok=True)
    for name in record["move"]:
        with contextlib.suppress(FileNotFoundError):  # moved before the kill
            (folder / record["from"] / name).replace(folder / name)
    (folder / UNFINISHED).unlink()


def _finish_others(folder: Path, names: Collection[str]) -> None:
    """End what a killed process has left; only of the set that is replaced now, since anybody may put a record here."""
    journal = folder / UNFINISHED
    if not journal.exists():
        return
    try:
        record = json.loads(journal.read_text(encoding="utf-8"))
        known = {*record["move"], *record["remove"]} <= set(names) and _DRAFT.fullmatch(record["from"])
    except (OSError, ValueError, KeyError, TypeError):
        known = None
    if not known:
        raise OutputError(
            f"{journal} tells of other files, which a killed command was moving here.",
            "a folder whose files belong together",
            f"Run that command again, or delete {UNFINISHED}; or choose another --out.",
        )
    _redo(folder, record)
    shutil.rmtree(folder / record["from"], ignore_errors=True)


def _is_unfinished(stage: Path) -> bool:
    """Return whether the record of a half-finished move needs the files in the stage."""
    try:
        return bool(json.loads((stage.parent / UNFINISHED).read_text(encoding="utf-8"))["from"] == stage.name)
    except (OSError, ValueError, KeyError, TypeError):
        return False


@contextlib.contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Wait until no other process moves files into a folder; the system gives way when a process dies."""
    try:
        import fcntl
    except ImportError:  # a system without such locks
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        with contextlib.suppress(OSError):  # some network file systems cannot lock
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)
