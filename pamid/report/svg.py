"""A figure as SVG that stands inside a page: it scales, asks for nothing off the page, and several do not collide."""

import io
import re
from html import escape

from matplotlib.figure import Figure

from ..plots.style import style

_DPI = 160  # of what is drawn as cells of colour
_ID = re.compile(r' id="([^"]*)"')
_REFERENCE = re.compile(r'(?:url\(#|href="#)([^")]*)')
_HEAD = re.compile(r"<svg[^>]*?viewBox=\"([^\"]*)\"[^>]*>", re.DOTALL)


def inline_svg(figure: Figure, name: str, words: str) -> str:
    """Return a figure as the text of an ``svg`` element."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    stream = io.StringIO()
    with style():
        FigureCanvasSVG(figure)
        if (layout := figure.get_layout_engine()) is not None:  # here once; savefig would draw everything twice for it
            layout.execute(figure)
            figure.set_layout_engine(None)
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None}, dpi=_DPI)
    text = stream.getvalue()
    text = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    head = _HEAD.search(text)
    if head is None:  # pragma: no cover - matplotlib always writes one
        raise ValueError("matplotlib wrote no svg element")
    body = _renamed(text[head.end() :], name)
    body = re.sub(r"\n\s*", "\n", body)
    label = escape(words, quote=True)
    return f'<svg viewBox="{head[1]}" role="img" aria-label="{label}">{body}'


def _renamed(body: str, name: str) -> str:
    """Keep only the names that something refers to, each once, and make them the figure's own."""
    asked = set(_REFERENCE.findall(body))
    given: set[str] = set()

    def kept(match: re.Match[str]) -> str:
        if match[1] not in asked or match[1] in given:
            return ""
        given.add(match[1])
        return f' id="{name}-{match[1]}"'

    body = _ID.sub(kept, body)
    return _REFERENCE.sub(lambda m: m[0].replace(f"#{m[1]}", f"#{name}-{m[1]}", 1), body)
