"""The look of the gallery's pictures, and how those reach their page that pyplot does not know of."""

from __future__ import annotations

from typing import Any


def reset(gallery_conf: dict[str, Any], fname: str) -> None:
    """Begin each example in pamid's style."""
    import matplotlib as mpl

    from pamid.plots import style

    mpl.rcParams.update(style._STYLE)
    mpl.rcParams["figure.dpi"] = 110


def displays(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Write what a display has drawn in this block in a figure of its own."""
    from sphinx_gallery.scrapers import figure_rst

    names = []
    for value in block_vars["example_globals"].values():
        figure = getattr(value, "figure_", None)
        if figure is None or hasattr(figure, "number") or getattr(figure, "shown_before", False):
            continue  # pyplot knows those with a number
        figure.shown_before = True
        names.append(next(block_vars["image_path_iterator"]))
        figure.savefig(names[-1], dpi=200)
    return figure_rst(names, gallery_conf["src_dir"])
