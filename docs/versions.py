"""Keep the versions of the site beside each other: ``python docs/versions.py build/site``.

Sphinx writes each version into a folder of its own; those that stand there stay. The files beside them are written
again: ``versions.json`` for programs, ``versions.js`` with the same for pages (which load a script from a disk as
from a server, but JSON from a server alone), ``index.html`` and ``latest/``, which lead to the newest version.
"""

from __future__ import annotations

import argparse
import json
import shutil
from html import escape
from pathlib import Path
from urllib.parse import quote

from packaging.version import InvalidVersion, Version

LATEST = "latest"
_LEADS_ON = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="robots" content="noindex">
<title>pamid {version}</title>
<script>location.replace("{url}" + location.search + location.hash)</script>
<noscript><meta http-equiv="refresh" content="0; url={url}"></noscript>
<p>This page is at <a href="{url}">{url}</a>.</p>
</html>
"""


def _version(name: str) -> Version | None:
    """Return the version that a folder is called after, if any."""
    try:
        return Version(name)
    except InvalidVersion:
        return None


def versions(site: Path) -> list[str]:
    """Return the versions whose pages stand in a folder, the newest first."""
    names = [p.name for p in site.iterdir() if p.is_dir() and (p / "index.html").is_file() and _version(p.name)]
    return sorted(names, key=Version, reverse=True)


def newest(names: list[str]) -> str:
    """Return the newest release; what comes before a release counts only where there is none."""
    return next((name for name in names if not Version(name).is_prerelease), names[0])


def pages(folder: Path) -> list[str]:
    """Return the pages of a version, as paths within it."""
    found = (file.relative_to(folder) for file in folder.rglob("*.html"))
    return sorted(file.as_posix() for file in found if not {"_static", "_modules"} & set(file.parts))


def _leading_to(version: str, page: str, up: str) -> str:
    return _LEADS_ON.format(version=escape(version), url=escape(f"{up}{quote(version)}/{quote(page)}"))


def bind(site: Path) -> list[str]:
    """Write the files beside the versions; return the versions, the newest first."""
    names = versions(site)
    if not names:
        raise SystemExit(f"{site} holds no version: a folder such as 0.1.0 with an index.html is expected.")
    first = newest(names)
    listed = [{"version": n, "url": f"{quote(n)}/index.html", "preferred": n == first} for n in names]
    text = json.dumps(listed, indent=1)
    (site / "versions.json").write_text(text + "\n", encoding="utf-8")
    (site / "versions.js").write_text(f"window.PAMID_VERSIONS = {text};\n", encoding="utf-8")
    for name in names:
        code = f"(window.PAMID_PAGES ||= {{}})[{json.dumps(name)}] = {json.dumps(pages(site / name))};\n"
        (site / name / "pages.js").write_text(code, encoding="utf-8")
    (site / "index.html").write_text(_leading_to(first, "index.html", ""), encoding="utf-8")
    shutil.rmtree(site / LATEST, ignore_errors=True)
    for page in pages(site / first):
        target = site / LATEST / page
        target.parent.mkdir(parents=True, exist_ok=True)
        up = "../" * (1 + page.count("/"))
        target.write_text(_leading_to(first, page, up), encoding="utf-8")
    return names


def main() -> None:
    """Bind the versions of a folder and name them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("site", type=Path, help="folder of the versions")
    site = parser.parse_args().site
    print(f"{site}: {', '.join(bind(site))}")


if __name__ == "__main__":
    main()
