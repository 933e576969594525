"""Links of the pages to files of the repository, which lie outside the site, become links within the site."""

from __future__ import annotations

import importlib
import os
import posixpath
import re
from pathlib import Path
from typing import Any

_ESTIMATOR = re.compile(r"\[`(\w+)`\]\(\.\./estimators/\w+\.py\)")
_EFFECT = re.compile(r"\[`(\w+)`\]\(\.\./pamid/effects/(\w+)\.py\)")
_PAPERS = {
    "contributing": "CONTRIBUTING.md",
    "changes": "CHANGELOG.md",
    "raw_logs": "tests/signals/raw_logs.md",
    "benchmarks": "benchmarks/figures.md",
    "adaptation-study": "benchmarks/adaptation.md",
    "measured-study": "benchmarks/measured.md",
    "papers": "benchmarks/papers.md",
    "withheld-benches": "benchmarks/withheld/README.md",
}
"""Pages of the site whose text is a paper outside the docs."""


def rewritten(text: str) -> str:
    """Return the source of a page with its links to code and papers turned to pages of the site."""
    known = importlib.import_module("pamid.estimators")
    text = _ESTIMATOR.sub(
        lambda found: f"{{py:obj}}`~pamid.estimators.{found[1]}`" if hasattr(known, found[1]) else found[0], text
    )
    if os.environ.get("PAMID_DOCS") != "short":  # there the reference lacks what lies behind the doors of the rooms
        effects = importlib.import_module("pamid.effects").all_effects()
        places = {name: f"{found.__module__}.{found.__name__}" for name, found in effects.items()}
        text = _EFFECT.sub(
            lambda found: f"{{py:obj}}`{found[1]} <{places[found[1]]}>`" if found[1] in places else found[0], text
        )
    text = text.replace("](../estimators)", "](api/pamid.estimators.room.rst)")
    text = text.replace("](../pamid/errors.py)", "](api/pamid.errors.room.rst)")
    text = re.sub(r"\]\(gallery/(plot_\w+)\.py\)", r"](auto_gallery/\1.rst)", text)
    for page, file in {**_PAPERS, "index": "README.md"}.items():
        text = text.replace(f"](../{file}", f"]({page}.md")
    return text


def from_docs(text: str, file: str) -> str:
    """Return a paper's text with its relative links as they are from the folder of the docs."""

    def moved(found: re.Match[str]) -> str:
        path = posixpath.normpath(posixpath.join("/", posixpath.dirname(file), found[1]))
        return f"]({posixpath.relpath(path, '/docs')}"

    return re.sub(r"\]\((?!https?:|#)([^)#\s]+)", moved, text)


def _read(app: Any, docname: str, source: list[str]) -> None:
    if docname in _PAPERS:
        text = (Path(app.srcdir).parent / _PAPERS[docname]).read_text(encoding="utf-8")
        source[0] = rewritten(from_docs(text, _PAPERS[docname]))
    elif docname.partition("/")[0] not in ("api", "auto_gallery"):
        source[0] = rewritten(source[0])


def setup(app: Any) -> dict[str, bool]:
    """Rewrite each page as it is read."""
    app.connect("source-read", _read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
