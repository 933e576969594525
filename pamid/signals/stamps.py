"""Dates and times of day, as people and programs write them, converted to seconds."""

import numpy as np
import pandas as pd

from .thinning import spaced

_DATES = ("%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%Y/%m/%d", "%d-%m-%Y", "%d.%m.%y", "%d-%b-%Y", "%d %b %Y", "%b %d, %Y")
_TIMES = ("%H:%M:%S.%f", "%H:%M:%S", "%I:%M:%S.%f %p", "%I:%M:%S %p")
_FORMATS = (*_TIMES, *(f"{date} {time}" for date in _DATES for time in _TIMES))


def seconds_of_stamps(column: pd.Series) -> np.ndarray | None:
    """Convert stamps of date and time (ISO 8601, local forms, times of day) to seconds from the first."""
    if pd.api.types.is_datetime64_any_dtype(column):
        return _seconds(column)
    stamps = pd.to_datetime(column, format="ISO8601", errors="coerce", utc=True)
    if stamps.notna().any():
        return _seconds(stamps)
    text = column.astype("string").str.strip().str.replace(r"(?<=:\d\d),(?=\d)", ".", regex=True)
    known = text.notna() & (text != "")
    sample = text[known].iloc[spaced(int(known.sum()), 50)]
    best: np.ndarray | None = None
    for form in _FORMATS:
        if not len(sample) or pd.to_datetime(sample, format=form, errors="coerce").isna().any():
            continue
        stamps = pd.to_datetime(text, format=form, errors="coerce")
        if stamps[known].isna().any():
            continue
        found = _seconds(stamps)
        if form in _TIMES:
            found = found + 86_400.0 * np.cumsum(np.diff(found, prepend=found[:1]) < -43_200.0)  # past midnight
        if best is None or _span(found) < _span(best):
            best = found
    return best


def _seconds(stamps: pd.Series) -> np.ndarray:
    return ((stamps - stamps.min()) / pd.Timedelta(seconds=1)).to_numpy(dtype=float, na_value=float("nan"))


def _span(seconds: np.ndarray) -> float:
    return float(np.nanmax(seconds) - np.nanmin(seconds))
