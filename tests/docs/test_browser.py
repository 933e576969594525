"""The report and the site in a real browser: no error, no request off the page, keyboard, and a narrow screen."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from pamid.cli import main

ROOT = Path(__file__).resolve().parents[2]
BROWSER = next(
    (found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), ""
)
needs_browser = pytest.mark.skipif(not BROWSER, reason="needs chromium, which is not installed here")
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--remote-debugging-pipe",
]
PHONE = 390
WIDE = 1400


class Page:
    """One page of a browser that is driven through its pipe by the DevTools protocol."""

    def __init__(self, profile: Path) -> None:
        to_browser, our_end = os.pipe()
        self._from, from_browser = os.pipe()
        # The protocol speaks through descriptors 3 and 4, whatever ours are called.
        wire = 'exec "$@" 3<&' + str(to_browser) + " 4>&" + str(from_browser)
        self._process = subprocess.Popen(
            ["bash", "-c", wire, "bash", BROWSER, *FLAGS, f"--user-data-dir={profile}", "about:blank"],
            pass_fds=(to_browser, from_browser),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(to_browser)
        os.close(from_browser)
        self._to = os.fdopen(our_end, "wb", buffering=0)
        self._rest, self._number, self._session = b"", 0, ""
        self.errors: list[str] = []
        self.requests: list[str] = []
        self.loaded = False
        target = self("Target.createTarget", url="about:blank")["targetId"]
        self._session = self("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self(f"{domain}.enable")

    def __call__(self, method: str, **params: Any) -> dict[str, Any]:
        """Send a command and return its result."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        self._to.write(json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._number:
                assert "error" not in answer, answer["error"]
                return answer["result"]

    def _next(self, seconds: float = 60.0) -> dict[str, Any]:
        end = time.monotonic() + seconds
        while b"\0" not in self._rest:
            assert time.monotonic() < end and self._process.poll() is None, "the browser does not answer"
            self._rest += os.read(self._from, 1 << 16)
        line, _, self._rest = self._rest.partition(b"\0")
        message = json.loads(line)
        self._note(message.get("method", ""), message.get("params", {}))
        return message

    def _note(self, method: str, said: dict[str, Any]) -> None:
        if method == "Runtime.exceptionThrown":
            self.errors.append(json.dumps(said["exceptionDetails"])[:500])
        elif method == "Runtime.consoleAPICalled" and said["type"] in ("error", "assert"):
            self.errors.append(json.dumps(said["args"])[:500])
        elif method == "Log.entryAdded" and said["entry"]["level"] == "error":
            self.errors.append(f"{said['entry']['text']} {said['entry'].get('url', '')}")
        elif method == "Network.requestWillBeSent":
            self.requests.append(said["request"]["url"])
        elif method == "Page.loadEventFired":
            self.loaded = True

    def open(self, path: Path, width: int = 1280) -> None:
        """Open a file and wait until it has loaded."""
        self.errors, self.requests, self.loaded = [], [], False
        self("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=False)
        self("Page.navigate", url=path.as_uri())
        while not self.loaded:
            self._next()
        self("Runtime.evaluate", expression="document.fonts.ready.then(() => 1)", awaitPromise=True)

    def ask(self, expression: str) -> Any:
        """Return the value of an expression."""
        return self("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    def press_tab(self) -> None:
        """Press the tabulator once."""
        for kind in ("rawKeyDown", "keyUp"):
            self("Input.dispatchKeyEvent", type=kind, key="Tab", code="Tab", windowsVirtualKeyCode=9)

    def close(self) -> None:
        """End the browser."""
        with contextlib.suppress(Exception):
            self._session = ""
            self("Browser.close")
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(10)
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
        self._to.close()
        os.close(self._from)


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    opened = Page(tmp_path_factory.mktemp("profile"))
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of a diagnosis of a small log."""
    folder = tmp_path_factory.mktemp("report")
    log = str(folder / "log.parquet")
    runs = ["sine:frequency=4,amplitude=15,seconds=0.8", "sine:frequency=8,amplitude=10,seconds=0.8"]
    words = [word for run in runs for word in ("--trajectory", run)]
    assert main(["simulate", "--muscle", "B", "--effect", "coulomb_friction", *words, "--out", log, "--quiet"]) == 0
    few = "coulomb_friction,viscous_friction,leakage"
    assert main(["diagnose", log, "--effects", few, "--out", str(folder / "diagnosis"), "--quiet"]) == 0
    return folder / "diagnosis" / "report.html"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site in short, examples not run, warnings being errors; ``PAMID_SITE`` names one that is built already."""
    if os.environ.get("PAMID_SITE"):
        return Path(os.environ["PAMID_SITE"]).resolve()
    pytest.importorskip("sphinx_gallery", reason="needs the extra docs")
    folder = tmp_path_factory.mktemp("site")
    for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "pamid", "estimators", "benchmarks", "tests"):
        (folder / name).symlink_to(ROOT / name)
    shutil.copytree(
        ROOT / "docs", folder / "docs", ignore=shutil.ignore_patterns("api", "auto_gallery", "_build", "__pycache__")
    )
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-D", "plot_gallery=0", "docs", "site"],
        capture_output=True,
        text=True,
        cwd=folder,
        env={**os.environ, "PAMID_DOCS": "short"},
        timeout=900,
    )
    assert done.returncode == 0, done.stderr[-6000:]
    return folder / "site"


def check_quiet(page: Page) -> None:
    """No error in the console, and nothing asked for that is not a file beside the page or within it."""
    assert page.errors == []
    assert [url for url in page.requests if not url.startswith(("file://", "data:", "blob:"))] == []


CUT_OFF = """[...document.querySelectorAll('main *')].filter(e => {
  if (!e.innerText || e.closest('table, pre, nav, dialog, .table, .formula, .highlight, .bd-sidebar')) return false;
  const r = e.getBoundingClientRect();
  return r.width > 0 && getComputedStyle(e).visibility != 'hidden' && r.right > innerWidth + 1;
}).slice(0, 3).map(e => e.tagName + '.' + e.className + ': ' + e.innerText.slice(0, 30)).join(' | ')"""
"""Text that ends beyond the screen, but for tables, code and formulas, which scroll within themselves."""


def check_narrow(page: Page, width: int = PHONE) -> None:
    """Nothing is wider than the screen, and no text is cut off."""
    assert page.ask(CUT_OFF) == "", "cut off"
    wide = page.ask(
        "[...document.querySelectorAll('body *')].filter(e => e.getBoundingClientRect().right > innerWidth + 1)"
        ".slice(0, 3).map(e => e.tagName + '.' + e.className).join(' ')"
    )
    assert page.ask("document.documentElement.scrollWidth") <= width, f"wider than the screen: {wide}"


FOCUSED = """(() => {
  const e = document.activeElement, s = getComputedStyle(e), r = e.getBoundingClientRect();
  const ring = (s.outlineStyle !== 'none' && parseFloat(s.outlineWidth) > 0) || s.boxShadow !== 'none';
  return e === document.body ? null : [e.tagName + ' ' + (e.href || e.id || e.className), ring && r.width > 0];
})()"""


def check_keyboard(page: Page, steps: int) -> None:
    """The tabulator moves on from one thing to the next, and each shows that it has the focus."""
    seen = []
    for _ in range(steps):
        page.press_tab()
        focused = page.ask(FOCUSED)
        if focused is None:
            break
        assert focused[1], f"no visible focus: {focused[0]}"
        seen.append(focused[0])
    assert len(seen) >= 2
    assert len(set(seen)) > len(seen) / 2, "the focus is caught"


@needs_browser
def test_report(page: Page, report: Path) -> None:
    page.open(report, WIDE)
    check_quiet(page)
    check_narrow(page, WIDE)
    assert page.ask("document.title")
    assert page.ask("document.querySelectorAll('#course svg').length") >= 1
    empty = "[...document.querySelectorAll('.gallery')].map(g => g.lastElementChild.getBoundingClientRect().right"
    assert min(page.ask(f"{empty} / innerWidth)")) > 0.4, "more than half of the page is empty beside a picture"
    assert page.ask("document.documentElement.lang")
    assert page.ask("document.querySelectorAll('h1').length") == 1
    assert page.ask(
        "[...document.querySelectorAll('svg')].every(s => s.getAttribute('aria-label') || s.querySelector('title'))"
    )
    if page.ask("document.querySelectorAll('a[href], summary, button, [tabindex=\"0\"]').length") >= 2:
        check_keyboard(page, 6)
    page.open(report, PHONE)
    check_narrow(page)
    check_quiet(page)


@needs_browser
def test_what_is_in_a_log(page: Page, tmp_path: Path) -> None:
    runs = ["--trajectory", "sine:frequency=4,amplitude=15,seconds=1"]
    assert main(["simulate", "--muscle", "B", *runs, "--out", str(tmp_path / "log.parquet"), "--quiet"]) == 0
    assert main(["check", str(tmp_path / "log.parquet"), "--html", str(tmp_path / "check.html"), "--quiet"]) == 0
    page.open(tmp_path / "check.html", WIDE)
    check_quiet(page)
    check_narrow(page, WIDE)
    first = "[...document.querySelectorAll('main section')].map(s => s.id).slice(0, 2)"
    assert page.ask(first) == ["answer", "pictures"], "the pictures come first"
    assert page.ask("document.querySelectorAll('h1').length") == 1
    check_keyboard(page, 6)
    page.open(tmp_path / "check.html", PHONE)
    check_narrow(page)


@needs_browser
def test_the_checks_find_what_they_look_for(page: Page, tmp_path: Path) -> None:
    bad = tmp_path / "bad.html"
    bad.write_text("<body><p style='width:900px'>wide</p><img src='http://127.0.0.1:9/x.png'><script>none()</script>")
    page.open(bad, PHONE)
    assert page.errors
    with pytest.raises(AssertionError):
        check_quiet(page)
    with pytest.raises(AssertionError, match="wider"):
        check_narrow(page)
    bad.write_text("<style>a:focus { outline: none }</style><a href='#a'>a</a> <a href='#b'>b</a>")
    page.open(bad)
    with pytest.raises(AssertionError, match="no visible focus"):
        check_keyboard(page, 2)


def test_site(site: Path, request: pytest.FixtureRequest) -> None:
    """Every link leads somewhere; a page of each kind, wide and narrow. One test, so that the site is built once."""
    check = [sys.executable, str(ROOT / "docs" / "check_site.py"), str(site)]
    done = subprocess.run(check, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    if not BROWSER:
        pytest.skip("the links are right; the rest needs chromium, which is not installed here")
    page = request.getfixturevalue("page")
    for name in (
        "index",
        "theory-laws",
        "models",
        "auto_gallery/index",
        "auto_gallery/plot_10_cause",
        "api/pamid.estimators.StaticPIHM",
    ):
        for width in (WIDE, PHONE):
            page.open(site / f"{name}.html", width)
            check_quiet(page)
            check_narrow(page, width)
    page.open(site / "index.html")
    check_keyboard(page, 12)
    assert page.ask("document.querySelectorAll('a[href=\"#main-content\"]').length") == 1, "a way past the navigation"
