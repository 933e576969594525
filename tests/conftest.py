"""Settings of the test run: which tests are slow, and how that is measured."""

from __future__ import annotations

import gc
import hashlib
import os
import resource
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    import pandas as pd

# scipy reads it when it is first imported; without it scikit-learn skips its check of array API inputs.
os.environ.setdefault("SCIPY_ARRAY_API", "1")

SLOW = Path(__file__).with_name("slow.txt")
"""Tests that take more than `SECONDS`, by name; `pytest --renew-slow` lists those that it runs anew."""
SECONDS = 1.0
"""CPU seconds of a test, without its fixtures, above which it is slow."""
FIXTURE_SECONDS = 5.0
"""CPU seconds of a fixture above which all tests that need it are slow."""


DRAWN = (
    "report", "test_browser", "test_check", "test_commands_by_kind", "test_commands_at_ports", "test_plots",
    "test_resid",
)  # fmt: skip
"""Rooms and modules whose tests look at pictures, or draw them for every kind of simulator."""


@pytest.fixture(scope="session")
def log() -> pd.DataFrame:
    """The log of the usual runs of the bench, which no test may change; a module with a log of its own overrides it."""
    from support.bench_logs import NOMINAL, RUNS

    from pamid.bench import simulate

    return simulate(NOMINAL, RUNS, seed=3)


@pytest.fixture(autouse=True, scope="module")
def _quick_pictures(request: pytest.FixtureRequest) -> Iterator[None]:
    """Leave the drawing of pictures, which takes most of a small diagnosis, to the tests that look at them."""
    with pytest.MonkeyPatch.context() as patch:
        if not {request.path.parent.name, request.path.stem} & set(DRAWN):
            from support.pictures import leave_out

            leave_out(patch)
        yield


def slow_tests() -> set[str]:
    """Return the names of the list."""
    lines = SLOW.read_text(encoding="utf-8").splitlines()
    return {line for line in lines if line and not line.startswith("#")}


def _short(item: pytest.Item) -> str:
    """Return the name of a test with its file, without the folder, which it may leave for another."""
    folder, _, name = item.nodeid.partition("::")
    return f"{folder.rpartition('/')[2]}::{name}"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--renew-slow", action="store_true", help="measure the tests that run, and list the slow ones anew"
    )
    parser.addoption(
        "--quarter",
        metavar="KEY",
        help="run a quarter of the slow tests, drawn by a key such as the commit; the others as always",
    )


def is_drawn(name: str, key: str) -> bool:
    """Return whether a slow test belongs to the quarter that a key draws; all cases of a test stay together."""
    return hashlib.sha256(f"{key} {name.partition('[')[0]}".encode()).digest()[0] % 4 == 0


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark the tests of the list, which stands apart so that it can be measured anew; leave three quarters out."""
    known, key = slow_tests(), config.getoption("--quarter")
    for item in items:
        if _short(item) in known:
            item.add_marker(pytest.mark.slow)
    if key:
        left_out = [i for i in items if i.get_closest_marker("slow") and not is_drawn(_short(i), key)]
        config.hook.pytest_deselected(items=left_out)
        gone = set(left_out)
        items[:] = [i for i in items if i not in gone]


def pytest_collection_finish() -> None:
    """Spare each full collection of garbage the modules and thousands of tests, which stay to the end."""
    gc.collect()
    gc.freeze()


def _cpu_seconds() -> float:
    """CPU time of this process and of those that it has started and seen end."""
    own, others = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return own.ru_utime + own.ru_stime + others.ru_utime + others.ru_stime


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    start = _cpu_seconds()
    result = yield
    item.config.stash.setdefault(_TIMES, {})[_short(item)] = _cpu_seconds() - start
    return result


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef: pytest.FixtureDef[Any], request: pytest.FixtureRequest) -> Iterator[None]:
    start = _cpu_seconds()
    result = yield
    times = request.config.stash.setdefault(_FIXTURES, {})
    times[fixturedef.argname, fixturedef.baseid] = _cpu_seconds() - start
    return result


_TIMES = pytest.StashKey[dict[str, float]]()
_FIXTURES = pytest.StashKey[dict[tuple[str, str], float]]()


def _waits(item: pytest.Item, slow: set[tuple[str, str]]) -> bool:
    """Return whether a test needs a slow fixture."""
    names = getattr(item, "fixturenames", ())
    return any(fixture in names and item.nodeid.startswith(base) for fixture, base in slow)


def pytest_sessionfinish(session: pytest.Session) -> None:
    if not session.config.getoption("--renew-slow"):
        return
    times = session.config.stash.get(_TIMES, {})
    kept = {name for name in slow_tests() if name not in times}
    found = {name for name, seconds in times.items() if seconds > SECONDS and "\n" not in name}
    fixtures = session.config.stash.get(_FIXTURES, {})
    slow = {fixture for fixture, seconds in fixtures.items() if seconds > FIXTURE_SECONDS}
    found |= {_short(item) for item in session.items if _short(item) in times and _waits(item, slow)}
    head = (
        f"# Tests that take more than {SECONDS:g} CPU s, or need a fixture that takes more than {FIXTURE_SECONDS:g}. "
        "Measured anew, for the tests that run, by pytest --renew-slow."
    )
    SLOW.write_text("\n".join([head, *sorted(kept | found)]) + "\n", encoding="utf-8")
