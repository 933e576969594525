"""Build the parser from the commands that there are, run one, and turn whatever it raises into one clear message."""

import argparse
import contextlib
import errno
import math
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Iterator, Sequence
from functools import cache
from types import ModuleType
from typing import Any

from .._discovery import modules
from ..errors import PamidError, PamidWarning
from ._style import marked, plain
from ._versions import ShowVersions
from .common import DONE, INTERRUPTED, OWN_ERROR, TERMINATED, WRONG_USE

_OUTPUT_LOST = (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EBADF)

_AT_ONCE = 1.0
"""Seconds in which further signals say the same as the first."""
_SAME_WARNINGS = 3
"""Warnings of one kind that are shown; the others are counted."""

_DESCRIPTION = """\
Find out why a simulator and a measured log disagree, and identify models of pneumatic artificial muscles.

A log is a table of samples (CSV, parquet, MATLAB, HDF5). A simulator is a MuJoCo model, an FMU, a function, equations,
or a file sim.toml with the parameters of a pneumatic bench. Units are SI, pressures absolute; --columns maps a log with
other names and units.
"""

_EPILOG = """\
examples:
  pamid init run1.csv                                           sim.toml and a mapping for your own log
  pamid check run1.csv --columns columns.toml --sim sim.toml    what it contains, and what it can tell you
  pamid simulate --muscle B --dataset D_B --out log.parquet     a simulated data set, with its sim.toml
  pamid evaluate log.parquet --sim log.sim.toml                 where simulator and log differ, and the noise floor
  pamid diagnose run1.csv --columns columns.toml --sim sim.toml --out diagnosis
  pamid fit log.parquet --estimator StaticPIHM --sim log.sim.toml --out model.pamid
  pamid evaluate log.parquet --sim log.sim.toml --model model.pamid

exit codes: 0 done, 1 a bug in pamid, 2 wrong usage or input, 3 nothing could be tested,
130 interrupted, 143 terminated

'pamid COMMAND --help' explains one command.
"""


def commands() -> list[ModuleType]:
    """Return the modules of all commands: every module of `pamid.cli.commands` is one."""
    return modules("pamid.cli.commands")


def build_parser() -> argparse.ArgumentParser:
    """Return the parser with all commands."""
    return _parser(*commands())


@cache
def _parser(*known: ModuleType) -> argparse.ArgumentParser:
    """Return the parser of some commands, which parses any number of times."""
    parser = argparse.ArgumentParser(
        prog="pamid",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--version", action=ShowVersions, nargs=0, help="show the versions of pamid, Python and the dependencies"
    )
    subparsers = parser.add_subparsers(title="commands", dest="command", metavar="COMMAND")
    for module in known:
        before = set(subparsers.choices)
        module.add_parser(subparsers)
        for name in set(subparsers.choices) - before:
            subparsers.choices[name].set_defaults(command_module=module)
    return parser


def run(argv: Sequence[str] | None = None) -> int:
    """Parse arguments and run the command; see `pamid.cli.main`."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    debug, outer = "--debug" in arguments, signal.getsignal(signal.SIGTERM)
    stop = outer if isinstance(outer, _Stop) else _Stop()  # of the command that runs this one
    _replace_closed_streams()
    try:
        with _terminable(stop), _plain_warnings("--quiet" in arguments):
            parser = build_parser()
            args = parser.parse_args(arguments)
            if args.command is None:
                parser.print_help()
                return WRONG_USE
            code = int(args.command_module.run(args))
            sys.stdout.flush()
            return code
    except SystemExit as said:  # argparse has said what it had to
        return said.code if isinstance(said.code, int) else DONE if said.code is None else WRONG_USE
    except KeyboardInterrupt:
        _say("interrupted; no file is left incomplete")
        return TERMINATED if signal.SIGTERM in stop.came else INTERRUPTED
    except BrokenPipeError:
        _close_stdout()  # the reader of the output has seen enough
        return DONE
    except PamidError as error:
        if debug:
            raise
        _say(f"{plain(str(error))} See {marked(error.page, 'page', sys.stderr)}.", "error")
        return WRONG_USE
    except OSError as error:
        if debug or error.errno not in _OUTPUT_LOST:
            return _own_error(error, debug)
        _close_stdout()
        _say(
            f"The output cannot be written: {error.strerror}. Expected free space. Free some, or write elsewhere.",
            "error",
        )
        return WRONG_USE
    except MemoryError:
        _say("There is not enough memory for this. Expected a smaller table. Thin the log, or split it.", "error")
        return WRONG_USE
    except Exception as error:
        return _own_error(error, debug)


def _own_error(error: Exception, debug: bool) -> int:
    if debug:
        raise error
    text = " ".join(str(error).split())[:300]
    _say(
        f"error inside pamid: {type(error).__name__}: {text}\n"
        "This should not happen. Please report it; --debug shows the traceback to send along."
    )
    return OWN_ERROR


class _Stop:
    """Stops on SIGTERM as on Ctrl-C, so that drafts of files are removed on the way out, and notes what came.

    What sends a signal to a process and to its group, as ``timeout`` does, means it once.
    """

    def __init__(self) -> None:
        self.came, self._last = list[int](), -math.inf

    def __call__(self, number: int, *_: Any) -> None:
        self.came.append(number)
        if (now := time.monotonic()) - self._last > _AT_ONCE:
            self._last = now
            raise KeyboardInterrupt


@contextlib.contextmanager
def _terminable(stop: _Stop) -> Iterator[None]:
    """Handle signals that nobody else handles."""
    usual = {signal.SIGTERM: signal.SIG_DFL, signal.SIGINT: signal.default_int_handler}
    main = threading.current_thread() is threading.main_thread()
    own = {number: was for number, was in usual.items() if main and signal.getsignal(number) == was}
    for number in own:
        signal.signal(number, stop)
    try:
        yield
    finally:
        for number, was in own.items():
            signal.signal(number, was)


def _say(text: str, kind: str = "") -> None:
    with contextlib.suppress(OSError, ValueError):
        mark = f"{marked(f'{kind}:', kind, sys.stderr)} " if kind else ""
        print(f"pamid: {mark}{text}", file=sys.stderr, flush=True)


def _replace_closed_streams() -> None:
    """Give a process that was started without output or errors a place for them, so that no file takes it."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: PTH123, SIM115 - open until the end


def _close_stdout() -> None:
    """Send what is still buffered nowhere, so that the interpreter does not stumble over the closed pipe at exit."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


@contextlib.contextmanager
def _plain_warnings(quiet: bool) -> Iterator[None]:
    """Show warnings as one line without file and line number, and only the first few of a kind."""
    said: dict[type[Warning], int] = {}

    def show(message: Any, category: type[Warning], *_: Any, **__: Any) -> None:
        if quiet or not issubclass(category, (PamidWarning, UserWarning, RuntimeWarning)):
            return
        said[category] = said.get(category, 0) + 1
        if said[category] <= _SAME_WARNINGS:
            _say(plain(" ".join(str(message).split())), "warning")

    with warnings.catch_warnings():
        warnings.showwarning = show
        try:
            yield
        finally:
            for category, count in said.items():
                if count > _SAME_WARNINGS:
                    _say(f"{count - _SAME_WARNINGS} more of the kind {category.__name__}", "warning")
