"""Commands in a process of their own that are killed at a step, in a write, or find no room."""

from __future__ import annotations

import hashlib
import os
import resource
import signal
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from pamid.cli import main

# --- running and killing ------------------------------------------------------------------------------------------
TOUCHES = ("open", "os.rename", "os.remove", "os.mkdir", "os.link", "os.rmdir", "os.chmod", "os.listdir", "os.scandir")
"""Events of the interpreter that come before something happens to a file (PEP 578)."""


def forked(body: Callable[[], int]) -> int:
    """Run a function in a fork, silent; return its exit code, or minus the signal that ended it."""
    sys.stdout.flush()
    sys.stderr.flush()
    child = os.fork()
    if child == 0:
        code = 70
        try:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, 1)
            os.dup2(nowhere, 2)
            signal.alarm(200)
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            signal.signal(signal.SIGINT, signal.default_int_handler)
            code = body()
        except KeyboardInterrupt:
            code = 130
        finally:
            os._exit(code)
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status)


def run(argv: Sequence[str], before: Callable[[], None] = lambda: None) -> int:
    """Run a command in a fork, after something was prepared there."""

    def body() -> int:

        before()
        return main([str(a) for a in argv])

    return forked(body)


def killed_at(argv: Sequence[str], folder: Path, step: int, number: int, count: Path | None = None) -> int:
    """Run a command and send it a signal before its n-th touch of a folder, counted from one; or count them."""

    def prepare() -> None:
        came = 0
        inside = os.path.realpath(folder)

        def hook(event: str, args: tuple) -> None:
            nonlocal came
            if event not in TOUCHES:
                return
            paths = [os.fsdecode(a) for a in args[:2] if isinstance(a, (str, bytes, os.PathLike))]
            if not any(str(Path(p).absolute()).startswith(inside) for p in paths):
                return
            came += 1
            if came == step:
                os.kill(os.getpid(), number)
            if count is not None:
                count.write_text(str(came))

        sys.addaudithook(hook)

    return run(argv, prepare)


def killed_in_write(argv: Sequence[str], size: int) -> int:
    """Run a command that the system kills as soon as it writes past a size of any file."""

    def prepare() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    return run(argv, prepare)


def without_room(argv: Sequence[str], size: int) -> int:
    """Run a command that cannot write past a size of any file, as on a full disk."""
    return run(argv, lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)))


def remembered(compute: Callable[..., Any], whole: bool = False) -> Callable[..., Any]:
    """Return a function that computes once for the same first argument, before the forks."""
    kept: dict[str, Any] = {}

    def once(first: Any, *rest: Any, **options: Any) -> Any:
        text = first.to_csv() if whole else repr(first)
        key = hashlib.sha256(text.encode()).hexdigest()
        if key not in kept:
            kept[key] = compute(first, *rest, **options)
        return kept[key]

    return once
