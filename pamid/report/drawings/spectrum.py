"""The residual by frequency, before and after, and the noise."""

import warnings
from collections.abc import Iterator

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ...errors import ShortTrajectoryError
from ...gap.diagnosis.result import Diagnosis
from ...plots.style import BLUE, FAINT, GREY, ORANGE, new_figure, style
from ...signals.thinning import spaced
from ..quantities import typeset
from ..words import Words
from .windows import chosen_equation, states, unit_of

_SEGMENT = 128  # windows of one periodogram
_SHORTEST = 16
_RUNS = 60  # runs that a spectrum looks at


def spectrum_figure(d: Diagnosis, equation: str | None = None) -> Figure:
    """Draw the amplitude spectrum of an equation's residual."""
    from matplotlib.ticker import LogLocator, NullFormatter

    equation = chosen_equation(d, equation)
    frequency, before, after, noise = spectra(d.windows[d.windows["equation"] == equation])
    quantity = Words.of(d).error(equation, unit_of(d, equation))
    own = [b for b in d.bands if b.equation == equation]
    with style():
        figure, axes = new_figure(4.3, 2.7)
        ax = axes[0, 0]
        if own:
            band = max(own, key=lambda b: b.share)
            if band.share >= 0.4:
                low = max(band.from_hz, frequency[0])
                ax.axvspan(low, min(band.to_hz, frequency[-1]), color=FAINT, alpha=0.5, linewidth=0)
                ax.annotate(
                    f"{100 * band.share:.0f} % of the gap",
                    (low, 0.0),
                    xycoords=("data", "axes fraction"),
                    xytext=(3, 4),
                    textcoords="offset points",
                    fontsize=8,
                )
        for power, colour, label, dash in (
            (before, ORANGE, "before" if d.added else "error", "-"),
            (after, BLUE, "after", "-"),
            (noise, GREY, "noise", (0, (4, 3))),
        ):
            if label == "after" and label not in states(d):
                continue
            width = 1.8 if label == "after" else 1.0
            values = quantity.factor * np.sqrt(power)
            ax.loglog(frequency, values, color=colour, label=label, linestyle=dash, linewidth=width)
        low, high = ax.get_ylim()
        ax.set_ylim(low / 2.5, high * 2.5)  # so that a flat spectrum looks flat
        ax.set_xlabel("frequency / Hz")
        ax.set_ylabel(f"{quantity.words} / ({typeset(quantity.unit)}/√Hz)")
        ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.xaxis.set_major_formatter("{x:g}")
        ax.xaxis.set_minor_formatter(NullFormatter())
        handles, labels = ax.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=3)
    return figure


def spectra(part: pd.DataFrame) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return frequencies in Hz and the power densities before, after and of the noise, averaged over runs."""
    from matplotlib.mlab import psd

    runs = part["trajectory"].unique()
    if len(runs) > _RUNS:
        part = part[part["trajectory"].isin(runs[spaced(len(runs), _RUNS, at_most=True)])]
    stretches = list(_stretches(part))
    if not stretches:
        raise ShortTrajectoryError(
            "No run holds windows enough for a spectrum.", f"at least {_SHORTEST} in a row", "Record longer runs."
        )
    lengths = [len(s) for s in stretches]
    segment = min(_SEGMENT, int(np.median(lengths)))
    stretches = [s for s in stretches if len(s) >= segment]
    total: list[np.ndarray] = [np.zeros(0)] * 3
    weight, frequency = 0.0, np.zeros(0)
    for s in stretches:
        rate = 1.0 / float(np.median(np.diff(s["time"].to_numpy(dtype=float))))
        found = []
        for name in ("before", "after"):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                pair = psd(s[name].to_numpy(dtype=float), segment, rate, noverlap=segment // 2)
            power, f = (np.asarray(v, dtype=float) for v in pair)
            found.append(power)
        # Windows overlap by little, so their noise is nearly white.
        found.append(np.full_like(f, 2.0 / rate * float(np.mean(s["noise"].to_numpy(dtype=float) ** 2))))
        if not weight:
            frequency, total = f, [np.zeros_like(f) for _ in found]
        if len(f) == len(frequency):
            total = [t + len(s) * p for t, p in zip(total, found, strict=True)]
            weight += len(s)
    inside = slice(1, None)
    return frequency[inside], *(t[inside] / weight for t in total)  # type: ignore[return-value]


def _stretches(part: pd.DataFrame) -> Iterator[pd.DataFrame]:
    """Go through what is evenly sampled within one run and side."""
    for _, run in part.groupby(["trajectory", "side"], sort=False, observed=True):
        run = run.sort_values("time", kind="stable")
        steps = np.diff(run["time"].to_numpy(dtype=float))
        if not len(steps):
            continue
        cuts = np.flatnonzero(steps > 1.5 * np.median(steps)) + 1
        for rows in np.split(np.arange(len(run)), cuts):
            if len(rows) >= _SHORTEST:
                yield run.iloc[rows]


def worse_bands(d: Diagnosis, equation: str) -> list[tuple[float, float, float]]:
    """Return the bands (from, to in Hz, factor) in which the causes raise the power by over two standard deviations."""
    part = d.windows[d.windows["equation"] == equation]
    frequency, before, after, noise = spectra(part)
    averaged = max(1.0, len(part) / (len(frequency) + 1))  # overlapping halves of twice as many windows
    found = []
    for band in (b for b in d.bands if b.equation == equation):
        rows = (frequency > band.from_hz) & (frequency <= band.to_hz)
        if not rows.any():
            continue
        old, new, floor = (float(np.mean(x[rows])) for x in (before, after, noise))
        if new > max(old, floor) * (1.0 + 2.0 / np.sqrt(averaged * int(rows.sum()))):
            found.append((band.from_hz, band.to_hz, float(np.sqrt(new / old)) if old > 0 else np.inf))
    return found
