"""What the rows of a log must satisfy: finite values, increasing time, contiguous runs, steady sampling."""

import itertools
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from pamid.errors import (
    InterleavedTrajectoryError,
    NonFiniteError,
    SamplingError,
    ShortTrajectoryError,
    TimeError,
    TimeOrderError,
)

from .joining import Joined
from .noise import median
from .reading_notes import Readings
from .stretches import equal_stretches

_MANY_DUPLICATES = 0.05
_GAP = 20.0


@dataclass
class Notes:
    """What was bridged or doubted while reading, for a warning."""

    duplicates: dict[str, int] = field(default_factory=dict)
    gaps: dict[str, float] = field(default_factory=dict)
    periods: dict[str, float] = field(default_factory=dict)
    readings: Readings = field(default_factory=Readings)
    joined: list[Joined] = field(default_factory=list)
    lost: dict[str, tuple[str, ...]] = field(default_factory=dict)

    def losses(self) -> list[str]:
        """Describe the losses, one clause per file."""
        return [f"{name}: {'; '.join(said)}" for name, said in self.lost.items()]

    def sentences(self) -> list[str]:
        """Return the notes as text."""
        said = []
        if self.duplicates:
            count, name = sum(self.duplicates.values()), next(iter(self.duplicates))
            said.append(
                f"{count} rows with the same time as the row before were merged into it, in {len(self.duplicates)} "
                f"runs such as '{name}'"
            )
        if self.gaps:
            worst = max(self.gaps, key=self.gaps.__getitem__)
            said.append(
                f"{len(self.gaps)} runs have gaps of more than {_GAP:g} sampling periods; the longest is "
                f"{self.gaps[worst]:.3g} s in '{worst}'"
            )
        if self.periods and max(self.periods.values()) > 1.5 * min(self.periods.values()):
            low, high = (f(self.periods, key=self.periods.__getitem__) for f in (min, max))
            said.append(
                f"the sampling is mixed: {self.periods[low]:.3g} s in '{low}', {self.periods[high]:.3g} s in '{high}' "
                "(pamid.signals.resample brings it to one rate)"
            )
        return said


def blocks(names: np.ndarray) -> Iterator[tuple[str, slice]]:
    """Iterate over the blocks of equal names."""
    for a, b in equal_stretches(names):
        yield names[a], slice(a, b)


def free_name(wanted: str, taken: Container[str]) -> str:
    """Return a name that no run has yet: the wanted one, with a number if necessary."""
    numbered = (f"{wanted}#{k}" for k in itertools.count(2))
    return next(name for name in itertools.chain([wanted], numbered) if name not in taken)


def with_names(frame: pd.DataFrame, new: Mapping[str, str]) -> pd.DataFrame:
    """Return a frame with its runs called otherwise."""
    if all(before == after for before, after in new.items()):
        return frame
    return frame.assign(trajectory=frame["trajectory"].map(new))


def handle_missing(frame: pd.DataFrame, nan: str, where: str) -> pd.DataFrame:
    """Apply the policy for NaN and infinite values to the signals."""
    signals = [c for c in frame.columns if c != "trajectory"]
    values = {c: frame[c].to_numpy(dtype=float) for c in signals}
    bad = {c: ~np.isfinite(v) for c, v in values.items()}
    any_bad = np.zeros(len(frame), dtype=bool)
    for mask in bad.values():
        any_bad |= mask
    if not any_bad.any():
        return frame
    if nan == "drop":
        return frame.loc[~any_bad].reset_index(drop=True)
    if nan == "keep":
        bad = {c: np.isinf(v) | (np.isnan(v) if c == "time" else False) for c, v in values.items()}
    counts = {c: int(m.sum()) for c, m in bad.items() if m.any()}
    if not counts:
        return frame
    column = next(iter(counts))
    row = int(bad[column].argmax())
    kinds = "NaN" if all(np.isnan(values[c][bad[c]]).all() for c in counts) else "NaN or infinite values"
    place = f"row {row + 1}"
    if "time" in values and np.isfinite(values["time"][row]):
        place += f", time {values['time'][row]:.6g} s"
    place += f" of run '{frame['trajectory'].iloc[row]}'"
    raise NonFiniteError(
        f"{where} has {kinds} in {', '.join(f'{n} rows of {c}' for c, n in counts.items())}; "
        f"the first in {column}, {place}.",
        "finite numbers",
        "Read with nan='drop' to leave these rows out, or nan='keep' to keep NaN (infinite values are never kept).",
    )


def handle_time(frame: pd.DataFrame, order: str, duplicates: str, where: str, notes: Notes) -> pd.DataFrame:
    """Make time increase within contiguous runs, according to the policies, or raise."""
    names = frame["trajectory"].to_numpy(dtype=object)
    if order == "sort":
        codes = frame["trajectory"].factorize()[0]
        frame = frame.iloc[np.lexsort((frame["time"].to_numpy(), codes))].reset_index(drop=True)
        names = frame["trajectory"].to_numpy(dtype=object)
    _require_contiguous(names, where)
    time = frame["time"].to_numpy(dtype=float)
    if order == "split":
        names = _split_at_resets(names, time)
        frame = frame.assign(trajectory=names.astype(str))
    keep = np.ones(len(frame), dtype=bool)
    merged = False
    for name, rows in blocks(names):
        steps = np.diff(time[rows])
        if len(steps) and (steps > 0).all():
            continue
        _require_forward(steps, time[rows], name, where)
        same = np.flatnonzero(steps == 0) + 1
        if same.size and duplicates != "keep":
            if duplicates == "raise" or same.size > max(1, _MANY_DUPLICATES * len(time[rows])):
                raise TimeOrderError(
                    f"{where}: {same.size} of {len(time[rows])} rows of run '{name}' have the same time as the row "
                    f"before, the first at {time[rows][same[0]]:.6g} s.",
                    "time to increase from row to row",
                    "Set duplicates = 'keep' and a sampling_period if the clock is too coarse, or 'drop' or 'mean' for "
                    "a few repeated rows.",
                )
            keep[rows.start + same] = False
            merged = True
            notes.duplicates[name] = int(same.size)
    if merged:
        frame = _mean_of_duplicates(frame, keep) if duplicates == "mean" else frame.loc[keep]
        frame = frame.reset_index(drop=True)
    return frame


def _require_contiguous(names: np.ndarray, where: str) -> None:
    order = [name for name, _ in blocks(names)]
    if len(order) != len(set(order)):
        seen: set[str] = set()
        again = next(n for n in order if n in seen or seen.add(n))  # type: ignore[func-returns-value]
        raise InterleavedTrajectoryError(
            f"{where} has {len(set(order))} runs in {len(order)} blocks of rows; '{again}' comes back after "
            "another one.",
            "the rows of each run to be contiguous",
            "Read with time_order='sort' to sort by run and time.",
        )


def _split_at_resets(names: np.ndarray, time: np.ndarray) -> np.ndarray:
    names = names.copy()
    taken = set(names)
    for name, rows in list(blocks(names)):
        resets = np.flatnonzero(np.diff(time[rows]) < 0) + 1
        bounds = [rows.start, *(rows.start + resets).tolist(), rows.stop]
        if len(bounds) > 2:
            for number, (a, b) in enumerate(itertools.pairwise(bounds), start=1):
                names[a:b] = free_name(f"{name}.{number}", taken)
                taken.add(names[a])
    return names


def _require_forward(steps: np.ndarray, time: np.ndarray, name: str, where: str) -> None:
    if len(time) < 2:
        raise ShortTrajectoryError(
            f"{where}: run '{name}' has {len(time)} row.",
            "at least 2 rows in every run",
            "Leave this run out, or record it again.",
        )
    if not steps.any():
        raise TimeError(
            f"{where}: time is {time[0]:.6g} s in all {len(time)} rows of run '{name}'.",
            "time that increases",
            "Map another column to time, or give sampling_period.",
        )
    back = np.flatnonzero(steps < 0)
    if back.size:
        row = int(back[0]) + 1
        raise TimeOrderError(
            f"{where}: time goes backwards {back.size} times in run '{name}', first from {time[row - 1]:.6g} s to "
            f"{time[row]:.6g} s in its row {row + 1}.",
            "time to increase within a run",
            "Read with time_order='sort' if rows are shuffled, or 'split' if the clock restarts with each run.",
        )


def _mean_of_duplicates(frame: pd.DataFrame, keep: np.ndarray) -> pd.DataFrame:
    group = np.cumsum(keep) - 1
    signals = [c for c in frame.columns if c != "trajectory"]
    means = frame[signals].groupby(group).mean()
    means.insert(0, "trajectory", frame["trajectory"].to_numpy()[keep])
    return means[list(frame.columns)]


def note_sampling(frame: pd.DataFrame, notes: Notes) -> None:
    """Note the sampling period of each run and its gaps."""
    time = frame["time"].to_numpy(dtype=float)
    for name, rows in blocks(frame["trajectory"].to_numpy(dtype=object)):
        steps = np.diff(time[rows])
        if not (steps > 0).all():
            steps = steps[steps > 0]
        if not steps.size:
            continue
        period = median(steps)
        notes.periods[name] = period
        if steps.max() > _GAP * period:
            notes.gaps[name] = float(steps.max())


def sampling_error(sentences: list[str]) -> SamplingError:
    """Return the error for sampling that the caller does not accept."""
    return SamplingError(
        "; ".join(sentences) + ".", "steady sampling at one rate", "Read with sampling='warn', or resample the log."
    )
