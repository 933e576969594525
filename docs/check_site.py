"""Check a built site without a network: ``python docs/check_site.py build/site``.

Every link and anchor within the site leads somewhere, and nothing that a page shows is loaded from outside of it. With
``--draw`` and chromium, pages are drawn at two widths, too: no error, nothing cut off or too wide, every picture there.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
from functools import cache
from html import unescape
from os.path import normpath
from pathlib import Path
from urllib.parse import unquote, urlsplit

_LOADING = {
    ("script", "src"),
    ("img", "src"),
    ("img", "srcset"),
    ("iframe", "src"),
    ("source", "src"),
    ("link", "href"),
}
_TAG = re.compile(r"<([a-zA-Z][\w-]*)((?:\s+[\w:@-]+(?:=(?:\"[^\"]*\"|'[^']*'|[^\s>\"']+))?)*)\s*/?>")
_ATTRIBUTE = re.compile(r"""([\w:-]+)=(?:"([^"]*)"|'([^']*)')""")
_SCRIPT = re.compile(r"(<script[^>]*>).*?</script>", re.DOTALL)  # what a script may write is no tag of the page
EVERY = 12
"""Pages of classes and functions of the reference that are drawn; they are alike."""
_NOT_LOADED = {"canonical", "next", "prev", "search", "index", "author", "copyright", "help"}
_CSS = re.compile(r"""(?:url\(\s*["']?|@import\s+["'])((?:https?:)?//[^"')]+)""")


class Page:
    """Anchors, links and loaded things of one page."""

    def __init__(self, text: str) -> None:
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loads: list[str] = []
        for tag, attributes in _TAG.findall(_SCRIPT.sub(r"\1</script>", text)):
            self._take(tag.lower(), {name: unescape(a or b) for name, a, b in _ATTRIBUTE.findall(attributes)})

    def _take(self, tag: str, given: dict[str, str]) -> None:
        """Take what a tag names, leads to and loads."""
        self.anchors |= {given[name] for name in ("id", "name") if given.get(name)}
        if tag == "a" and given.get("href"):
            self.links.append(given["href"])
        if tag == "link" and given.get("rel", "") in _NOT_LOADED:
            return
        for name, value in given.items():
            if (tag, name) in _LOADING:
                self.loads += [part.split()[0] for part in value.split(",") if part.strip()]
        self.loads += _CSS.findall(given.get("style", ""))


def html(site: Path) -> list[Path]:
    """Return the pages; files of the theme are not pages."""
    return sorted(file for file in site.rglob("*.html") if "_static" not in file.parts)


def faults(site: Path) -> list[str]:
    """Return a line for each dead link or anchor, and for each thing loaded from outside."""
    pages = {file: Page(file.read_text(encoding="utf-8")) for file in html(site)}
    found = []
    there = cache(Path.exists)
    for file, page in pages.items():
        where = file.relative_to(site)
        for link in [*page.links, *page.loads]:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                if link in page.loads and parts.scheme != "data":
                    found.append(f"{where} loads {link}")
                continue
            target = Path(normpath(file.parent / unquote(parts.path))) if parts.path else file
            if not there(target):
                found.append(f"{where}: no {link}")
            elif where.parts[0] == "_modules":
                continue  # viewcode names the module where a class lives, its page the package that shows it
            elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].anchors:
                found.append(f"{where}: no anchor {link}")
    for file in sorted(site.rglob("*.css")):
        found += [f"{file.relative_to(site)} loads {link}" for link in _CSS.findall(file.read_text(encoding="utf-8"))]
    return found


def drawn(site: Path) -> list[Path]:
    """Return the pages that are drawn: all that are written by hand or by the gallery, and some of the reference."""
    pages = [file for file in html(site) if not {"_modules", "latest"} & set(file.parts)]
    reference = [file for file in pages if file.parent.name == "api"]
    rooms = [file for file in reference if file.name.endswith(".room.html") or file.stem in ("index", "commands")]
    some = reference[:: max(1, len(reference) // EVERY)]
    return sorted({*pages} - {*reference} | {*rooms} | {*some})


def seen_faults(site: Path) -> tuple[int, list[str]]:
    """Return how many pages were drawn, and a line for each fault that only a browser sees."""
    import browser  # beside this file

    pages, found = drawn(site), []
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        page = browser.BrowserPage(Path(profile))
        try:
            for file in pages:
                for width in (browser.WIDE, browser.PHONE):
                    page.open(file, width)
                    found += [f"{file.relative_to(site)}: {fault}" for fault in page.faults(width)]
        finally:
            page.close()
    return len(pages), found


def main() -> int:
    """Check and tell."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("site", type=Path, help="folder that Sphinx wrote")
    parser.add_argument("--draw", action="store_true", help="draw pages in chromium, too, where it is installed")
    given = parser.parse_args()
    site = given.site.resolve()
    found = faults(site)
    print("\n".join(found) or f"{len(html(site))} pages: all links lead somewhere, nothing is loaded")
    if given.draw:
        import browser  # beside this file

        count, more = seen_faults(site) if browser.BROWSER else (0, [])
        print("\n".join(more) or f"{count} pages drawn at {browser.WIDE} and {browser.PHONE} px: no fault")
        found += more
        if not browser.BROWSER:
            print("no page was drawn: chromium is not installed")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
