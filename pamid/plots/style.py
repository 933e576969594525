"""How pamid's plots look, and how they reach a file."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import ParameterError
from ..files import replacing, unwritable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's colours, distinguishable with every kind of colour vision, and by their grey values.
BLUE, ORANGE, GREEN, PURPLE, SKY = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9"
INK, GREY, FAINT = "#222222", "#7F7F7F", "#CFCFCF"

SHOWN = {"N": (1.0, "N"), "kg/s": (1e6, "mg/s"), "Pa": (1e-3, "kPa"), "-": (100.0, "%")}
"""Factor and unit in which a plot shows a quantity of an SI unit."""

NAMES = {"force": "force", "flow": "mass flow", "inverse": "pressure", "dynamic": "free run"}
"""What is predicted is called in each problem."""

_STYLE: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": False,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "text.color": INK,
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "figure.dpi": 150,
    "savefig.dpi": 150,
    "figure.facecolor": "white",
    "svg.fonttype": "none",
    "svg.hashsalt": "pamid",  # the same plot gives the same file
}

ENDINGS = (".png", ".svg")


@contextlib.contextmanager
def style() -> Iterator[None]:
    """Draw in pamid's style inside the block, and leave the user's settings as they were."""
    import matplotlib as mpl

    with mpl.rc_context(_STYLE):
        yield


def new_figure(width: float, height: float, rows: int = 1, columns: int = 1, **options: Any) -> tuple[Figure, Any]:
    """Return a figure of a size in inches, and its axes as an array, without touching pyplot."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def drawn_on(ax: Axes | None) -> tuple[Figure, Axes]:
    """Return the given axes with their figure, or new ones of pyplot, which a notebook shows."""
    if ax is not None:
        return ax.figure.canvas.figure, ax  # of a subfigure, too, the whole one; matplotlib 3.9 has no other way
    import matplotlib.pyplot as plt

    figure, new = plt.subplots(figsize=(5.0, 3.6), layout="constrained")
    return figure, new


def checked_ending(path: str | Path) -> Path:
    """Return the path of a plot to be written, before anything is drawn for it."""
    target = Path(path)
    if target.suffix.lower() not in ENDINGS:
        raise ParameterError(f"{target.name} ends in '{target.suffix}'.", " or ".join(ENDINGS), "Choose one of them.")
    return target


def save_figure(figure: Figure, path: str | Path) -> Path:
    """Write a figure as PNG or SVG, whole or not at all.

    Parameters
    ----------
    figure : Figure
        What to write.
    path : path-like
        File that ends in ``.png`` or ``.svg``.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ParameterError
        If the name has another ending.
    OutputError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from matplotlib.figure import Figure
    >>> from pamid.plots import save_figure
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     print(save_figure(Figure(), Path(folder) / "empty.svg").name)
    empty.svg
    """
    target = checked_ending(path)
    kind = target.suffix.lower()[1:]
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(target, error) from None
    with replacing(target) as draft, draft.open("wb") as stream, style():
        figure.savefig(stream, format=kind, metadata={"Date": None} if kind == "svg" else None)
    return target
