"""The report and the site in a real browser: no error, no request off the page, keyboard, and a narrow screen."""

from __future__ import annotations

import functools
import http.server
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

import pamid
from pamid.cli import main

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
if not (DOCS / "browser.py").is_file():
    pytest.skip("needs the repository", allow_module_level=True)


def module(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"docs_{name}", DOCS / f"{name}.py")
    assert spec is not None and spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


browser = module("browser")
BROWSER, PHONE, WIDE, Page = browser.BROWSER, browser.PHONE, browser.WIDE, browser.BrowserPage
needs_browser = pytest.mark.skipif(not BROWSER, reason="needs chromium, which is not installed here")


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator:
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
    version = pamid.__version__
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-D", "plot_gallery=0", "docs"]
    done = subprocess.run(
        [*command, f"site/{version}"],
        capture_output=True,
        text=True,
        cwd=folder,
        env={**os.environ, "PAMID_DOCS": "short"},
        timeout=900,
    )
    assert done.returncode == 0, done.stderr[-6000:]
    old = folder / "site" / "0.0.1"
    old.mkdir()
    for name in ("index", "models"):
        (old / f"{name}.html").write_text(f"<!doctype html><title>old {name}</title>")
    module("versions").bind(folder / "site")
    return folder / "site" / version


def check_page(page, width: int = PHONE) -> None:
    """No error in the console, no request that is not of a file, nothing cut off or too wide, every picture drawn."""
    assert page.faults(width) == []


FOCUSED = """(() => {
  const e = document.activeElement, s = getComputedStyle(e), r = e.getBoundingClientRect();
  const ring = (s.outlineStyle !== 'none' && parseFloat(s.outlineWidth) > 0) || s.boxShadow !== 'none';
  return e === document.body ? null : [e.tagName + ' ' + (e.href || e.id || e.className), ring && r.width > 0];
})()"""


def check_keyboard(page, steps: int) -> None:
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
def test_report(page, report: Path) -> None:
    page.open(report, WIDE)
    check_page(page, WIDE)
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
    check_page(page)


@needs_browser
def test_what_is_in_a_log(page, tmp_path: Path) -> None:
    runs = ["--trajectory", "sine:frequency=4,amplitude=15,seconds=1"]
    assert main(["simulate", "--muscle", "B", *runs, "--out", str(tmp_path / "log.parquet"), "--quiet"]) == 0
    assert main(["check", str(tmp_path / "log.parquet"), "--html", str(tmp_path / "check.html"), "--quiet"]) == 0
    page.open(tmp_path / "check.html", WIDE)
    check_page(page, WIDE)
    first = "[...document.querySelectorAll('main section')].map(s => s.id).slice(0, 2)"
    assert page.ask(first) == ["answer", "pictures"], "the pictures come first"
    assert page.ask("document.querySelectorAll('h1').length") == 1
    check_keyboard(page, 6)
    page.open(tmp_path / "check.html", PHONE)
    check_page(page)


@needs_browser
def test_the_checks_find_what_they_look_for(page, tmp_path: Path) -> None:
    bad = tmp_path / "bad.html"
    bad.write_text(
        "<main><p style='width:900px'>wide</p></main><img src='http://127.0.0.1:9/x.png'><script>none()</script>"
    )
    page.open(bad, PHONE)
    found = page.faults(PHONE)
    for what in ("none is not defined", "asks for http://127.0.0.1:9/x.png", "cut off", "wider than", "pictures"):
        assert [fault for fault in found if what in fault], what
    bad.write_text("<style>a:focus { outline: none }</style><a href='#a'>a</a> <a href='#b'>b</a>")
    page.open(bad)
    with pytest.raises(AssertionError, match="no visible focus"):
        check_keyboard(page, 2)


def check_versions(page, site: Path, address: str) -> None:
    """The switch names every version and leads to the same page of it, or else to its first page."""
    listed = [entry["version"] for entry in json.loads((site.parent / "versions.json").read_text())]
    links = "[...document.querySelectorAll('.bd-header .version-switcher__menu a')]"
    for name in ("models", "theory-laws"):
        page.open(f"{address}/{site.name}/{name}.html", WIDE)
        assert page.becomes(f"{links}.length") == len(listed)
        page.ask("document.querySelector('.bd-header .version-switcher__button').click()")
        page.becomes("document.documentElement.dataset.versions")
        led = dict(page.ask(f"{links}.map(a => [a.dataset.version, a.href])"))
        ends = {v: name if (site.parent / v / f"{name}.html").is_file() else "index" for v in listed}
        assert led == {v: f"{address}/{v}/{end}.html" for v, end in ends.items()}
        assert page.ask(f"{links}.filter(a => a.classList.contains('active'))[0].textContent") == site.name
        assert page.ask("document.querySelector('.bd-header .version-switcher__button').innerText").strip() == site.name
    assert page.follow(f"{links}.slice(-1)[0].click()") == led[listed[-1]]
    page.open(f"{address}/latest/models.html#choosing", WIDE)
    assert page.becomes("location.href.includes('/latest/') ? '' : location.href").endswith("/models.html#choosing")


def check_search(page, site: Path, address: str) -> None:
    """The search finds a word without a network, from its form on; its results lead to pages that hold the word."""
    page.open(f"{address}/{site.name}/search.html?q=hysteresis", WIDE)
    links = "[...document.querySelectorAll('#search-results li a')]"
    assert page.becomes("document.body.innerText.includes('Search finished, found')")
    found = page.ask(f"{links}.map(a => a.href)")
    assert len(found) >= 5
    files = [site.parent / url.removeprefix(f"{address}/").partition("#")[0].partition("?")[0] for url in found]
    assert all("hysteresis" in file.read_text(encoding="utf-8").lower() for file in files[:5])
    page.open(f"{address}/{site.name}/search.html?q=xyzzyplugh", WIDE)
    assert page.becomes("document.body.innerText.includes('did not match any')")
    assert page.ask(f"{links}.length") == 0


def check_from_a_server(page, site: Path) -> None:
    """The same from a server of this machine."""
    quiet = type("Quiet", (http.server.SimpleHTTPRequestHandler,), {"log_message": lambda *_: None})
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(quiet, directory=site.parent)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}"
        check_versions(page, site, address)
        check_search(page, site, address)
        page.open(f"{address}/", WIDE)
        assert page.becomes(f"location.href.endsWith('/{site.name}/index.html')")
        assert [url for url in page.requests if not url.startswith((address, "data:"))] == []
        server.shutdown()


def test_site(site: Path, request: pytest.FixtureRequest) -> None:
    """Links, notebooks, versions, search, a page of each kind in two widths. One test, as the site is built once."""
    check = [sys.executable, str(ROOT / "docs" / "check_site.py"), str(site)]
    done = subprocess.run(check, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    notebooks = sorted((site / "_downloads").rglob("plot_*.ipynb"))
    assert len(notebooks) == len(list((DOCS / "gallery").glob("plot_*.py")))
    for notebook in notebooks:
        assert str(ROOT) not in notebook.read_text(encoding="utf-8") and str(site) not in notebook.read_text("utf-8")
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
            check_page(page, width)
    page.open(site / "index.html")
    check_keyboard(page, 12)
    assert page.ask("document.querySelectorAll('a[href=\"#main-content\"]').length") == 1, "a way past the navigation"
    for check in (check_versions, check_search):
        check(page, site, site.parent.as_uri())
        assert page.errors == []
    check_from_a_server(page, site)
