"""Formulas as MathML, which browsers draw themselves: no script, no font, nothing fetched."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from docutils.utils.math import MathError, latex2mathml
from sphinx.util import logging

_UNKNOWN = re.compile(r"\\!|\\[bB]igg?[lr]?(?![a-zA-Z])")  # finer points of setting that docutils does not know
_log = logging.getLogger(__name__)


def _rendered(node: nodes.Element, block: bool) -> str:
    tex = _UNKNOWN.sub("", node.astext()).replace(r"\dots", r"\ldots")
    if block and ("\\\\" in tex or "&" in tex) and "\\begin" not in tex:
        tex = rf"\begin{{aligned}}{tex}\end{{aligned}}"
    try:
        return latex2mathml.tex2mathml(tex, as_block=block)
    except MathError as error:
        _log.warning("formula %r: %s", tex, error, location=node)
        return f"<code>{nodes.unescape(tex)}</code>"


def inline(self: Any, node: nodes.Element) -> None:
    """Write a formula within a line."""
    self.body.append(_rendered(node, False))
    raise nodes.SkipNode


def display(self: Any, node: nodes.Element) -> None:
    """Write a formula on a line of its own; it scrolls where the page is narrower."""
    self.body.append(f'<div class="formula" tabindex="0">{_rendered(node, True)}</div>\n')
    raise nodes.SkipNode


def setup(app: Any) -> dict[str, bool]:
    """Make this the way in which Sphinx writes formulas."""
    app.add_html_math_renderer("mathml", inline_renderers=(inline, None), block_renderers=(display, None))
    app.config.html_math_renderer = "mathml"
    return {"parallel_read_safe": True, "parallel_write_safe": True}
