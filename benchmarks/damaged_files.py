"""What becomes of damaged logs, simulators, model files and streams: refused, reported, or without effect.

Each damage is one step of a list, so that every run makes the same files. ``--out DIR`` keeps logs and simulators. What
is done to model files, streams, FMUs and MuJoCo files stands in ``damaged_models.py``, ``damaged_streams.py`` and
``damaged_foreign.py``.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import re
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np
import pandas as pd
import scipy.io

sys.path.append(str(Path(__file__).resolve().parents[1]))

from benchmarks import damaged_foreign, damaged_models, damaged_streams
from pamid.bench import BenchParameters, simulate, sine, step
from pamid.equations import evaluate_log
from pamid.errors import PamidError, PamidWarning
from pamid.signals import read_log, write_log

ALIKE = 0.25
"""Share by which an error over its floor may move before an answer counts as another one; a gap begins at 50 %."""

CELLS = (
    "",
    "nan",
    "inf",
    "-inf",
    "1e300",
    "-1e300",
    "1e400",
    "0",
    "-5e5",
    "9e6",
    "oops",
    "1,5",
    "--",
    "0x1F",
    "#",
    '"',
)
COLUMNS = ("time", "q", "P1", "F2", "mdot1", "u2")
TEXTS = {
    "no end of line": lambda t: t.rstrip("\n"),
    "carriage returns": lambda t: t.replace("\n", "\r\n"),
    "old ends of line": lambda t: t.replace("\n", "\r"),
    "byte order mark": lambda t: "\ufeff" + t,
    "semicolons": lambda t: t.replace(",", ";"),
    "semicolons and commas": lambda t: t.replace(",", ";").replace(".", ","),
    "tabs": lambda t: t.replace(",", "\t"),
    "bars": lambda t: t.replace(",", "|"),
    "quotes": lambda t: "\n".join(",".join(f'"{x}"' for x in line.split(",")) for line in t.splitlines()),
    "blanks behind delimiters": lambda t: t.replace(",", ", "),
    "delimiter behind each row": lambda t: t.replace("\n", ",\n"),
    "blank lines": lambda t: t.replace("\n", "\n\n"),
    "comments above": lambda t: '# made by hand\n# 5" hose\n' + t,
    "comment below": lambda t: t + "# end\n",
    "comment between": lambda t: insert(t, 300, "# lost"),
    "header again": lambda t: insert(t, 300, t.split("\n")[0]),
    "no header": lambda t: t.split("\n", 1)[1],
    "header only": lambda t: t.split("\n")[0] + "\n",
    "twice": lambda t: t + t.split("\n", 1)[1],
    "backwards": lambda t: "\n".join([t.split("\n")[0], *t.split("\n")[-2:0:-1]]),
    "a null": lambda t: t[:9000] + "\0" + t[9000:],
    "an open quote": lambda t: insert(t, 300, '"'),
    "a row of delimiters": lambda t: insert(t, 300, "," * 11),
    "a row of text": lambda t: insert(t, 300, ",".join(["error"] * 12)),
    "prose": lambda t: "Dear reader,\nthis is no table.\n",
}
UNITS = {
    "bar": ("P1", 1e-5, 0.0), "MPa": ("P2", 1e-6, 0.0), "kPa": ("P1", 1e-3, 0.0), "psi": ("P2", 1 / 6894.757, 0.0),
    "gauge": ("P1", 1.0, -2.5e5), "degrees": ("q", 180 / np.pi, 0.0), "milliseconds": ("time", 1e3, 0.0),
    "g/s": ("mdot1", 1e3, 0.0), "L/min": ("mdot2", 5e4, 0.0), "percent": ("u1", 100.0, 0.0), "mN": ("F1", 1e3, 0.0),
}  # fmt: skip


class Damaged(NamedTuple):
    """A damaged file: what was done to it, and its path."""

    damage: str
    path: Path


class Outcome(NamedTuple):
    """What became of a file: how it was taken, what was said, and whether the answer is that of the healthy file."""

    kind: str  # "refused", "same", "told", "silent"
    said: str


def healthy_log() -> pd.DataFrame:
    """Return two short runs of a bench with a leak; channels as wide as text files hold them."""
    log = simulate(healthy_simulator(), [sine(12, 10, 400), step(0, 10, 400)], effects=["leakage"], seed=0)
    return log.astype({name: float for name in log.columns if name != "trajectory"})


def healthy_simulator() -> BenchParameters:
    """Return the simulator of the log."""
    return BenchParameters.for_muscle("B")


def insert(text: str, line: int, more: str) -> str:
    """Return a text with a further line."""
    lines = text.split("\n")
    return "\n".join([*lines[:line], more, *lines[line:]])


# --- logs ---------------------------------------------------------------------------------------------------
def damaged_logs(folder: Path) -> Iterator[Damaged]:
    """Write the damaged logs, one after the other."""
    log = healthy_log()
    text = log.to_csv(index=False)
    number = 0

    def write(damage: str, content: str | bytes, ending: str = ".csv") -> Damaged:
        nonlocal number
        number += 1
        path = folder / f"log{number:03d}{ending}"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return Damaged(damage, path)

    for name, change in TEXTS.items():
        yield write(name, change(text))
    for encoding in ("utf-16", "latin-1"):
        yield write(encoding, text.replace("step", "stüp").encode(encoding))
    for name, content in _cells(log):
        yield write(name, content)
    for name, frame in _columns(log):
        yield write(name, frame.to_csv(index=False))
    rng = np.random.default_rng(0)
    for share in np.linspace(0.02, 0.98, 12):
        yield write(f"cut off at {share:.0%}", text[: int(share * len(text))])
    for name, content in _lines(text, rng):
        yield write(name, content)
    for k in range(30):
        yield write(f"bytes changed, {k}", _flipped(text.encode(), rng))
    for ending, whole in _binaries(log, folder):
        for k in range(12):
            yield write(f"{ending} with bytes changed, {k}", _flipped(whole, rng), ending)
        for share in (0.3, 0.9, 0.999):
            yield write(f"{ending} cut off at {share:.1%}", whole[: int(share * len(whole))], ending)


def _cells(log: pd.DataFrame) -> Iterator[tuple[str, str]]:
    for column in COLUMNS:
        for cell in CELLS:
            frame = log.astype({column: object})
            frame.loc[500, column] = cell
            yield f"{column} is {cell!r} once", frame.to_csv(index=False, quoting=3, escapechar="\\")
    for column in COLUMNS[1:]:
        for row, share in ((0, -0.9), (0, 0.2), (len(log) - 1, 0.9), (len(log) - 1, -0.2)):
            frame = log.copy()
            frame.loc[row, column] = log[column].mean() + share * np.ptp(log[column])
            yield f"{column} is off by {share:.0%} of its range in row {row + 1}", frame.to_csv(index=False)


def _columns(log: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    for name, (column, factor, offset) in UNITS.items():
        yield f"{column} in {name}", log.assign(**{column: (log[column] + offset) * factor})
    for column in log.columns:
        yield f"no {column}", log.drop(columns=column)
        yield f"{column} misspelt", log.rename(columns={column: column + "x"})
    for column in ("F1", "P1", "mdot2", "q", "u1"):
        for value in (0.0, float(log[column].iloc[0]), np.nan):
            yield f"{column} is {value:.3g} throughout", log.assign(**{column: value})
    yield "two columns of one name", log.rename(columns={"F2": "F1"})
    yield "an unknown unit", log.rename(columns={"F1": "F1 [furlong]"})
    yield "no name of a run", log.assign(trajectory=log["trajectory"].where(log.index != 500))
    yield "rows of runs mixed", log.sort_values("time", kind="stable")
    yield "a pause", log.assign(time=log["time"].where(log.index < 200, log["time"] + 60))


def _lines(text: str, rng: np.random.Generator) -> Iterator[tuple[str, str]]:
    lines = text.split("\n")
    for k in rng.integers(2, len(lines) - 2, 6).tolist():
        yield f"line {k} lost", "\n".join(lines[:k] + lines[k + 1 :])
        yield f"line {k} twice", "\n".join(lines[: k + 1] + lines[k:])
        yield f"lines at {k} exchanged", "\n".join([*lines[:k], lines[k + 1], lines[k], *lines[k + 2 :]])
        yield f"a field lost in line {k}", "\n".join([*lines[:k], lines[k].rsplit(",", 1)[0], *lines[k + 1 :]])
        yield f"a field more in line {k}", "\n".join([*lines[:k], lines[k] + ",7", *lines[k + 1 :]])
        half = lines[k][: len(lines[k]) // 2]
        yield f"line {k} cut in the middle", "\n".join([*lines[:k], half + lines[k + 1], *lines[k + 2 :]])


def _flipped(whole: bytes, rng: np.random.Generator) -> bytes:
    data = bytearray(whole)
    for at in rng.integers(0, len(data), rng.integers(1, 6)):
        data[at] = int(rng.integers(256))
    return bytes(data)


def _binaries(log: pd.DataFrame, folder: Path) -> Iterator[tuple[str, bytes]]:
    whole = folder / "whole"
    for ending in (".parquet", ".h5"):
        yield ending, write_log(log, whole.with_suffix(ending)).read_bytes()
    columns = {name: log[name].to_numpy() for name in log.columns if name != "trajectory"}
    names = log["trajectory"].to_numpy(dtype=object)
    scipy.io.savemat(whole.with_suffix(".mat"), {"trajectory": names, **columns}, do_compression=True)
    yield ".mat", whole.with_suffix(".mat").read_bytes()
    yield ".json", json.dumps(log.to_dict("list")).encode()
    with h5py.File(whole.with_suffix(".hdf5"), "w") as file:
        file["trajectory"] = names.astype("S")
        for name, values in columns.items():
            file.create_dataset(name, data=values, compression="gzip", fletcher32=True)
    yield ".hdf5", whole.with_suffix(".hdf5").read_bytes()
    for path in folder.glob("whole.*"):
        path.unlink()


# --- simulator files ----------------------------------------------------------------------------------------
def damaged_simulators(folder: Path) -> Iterator[Damaged]:
    """Write the damaged simulator files: none of them says another healthy simulator."""
    healthy_simulator().to_toml(folder / "whole.toml")
    text = (folder / "whole.toml").read_text(encoding="utf-8")
    (folder / "whole.toml").unlink()
    for number, (damage, content) in enumerate(_pages(text), start=1):
        path = folder / f"sim{number:02d}.toml"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        yield Damaged(damage, path)


def _pages(text: str) -> Iterator[tuple[str, str | bytes]]:
    lines = text.splitlines()
    needed = lines[: next(k for k, line in enumerate(lines) if line.startswith("[tolerance]"))]
    numbered = [k for k, line in enumerate(needed) if re.match(r"\w+ = [-\d.]", line)]
    for word in ("nan", "inf", "-1.0", "1e300", '"0.2"', "true", "[0.2]", "", "0.2 m", "9" * 5_000):
        for k in (numbered[0], numbered[len(numbered) // 3]):
            changed = re.sub(r"= \S+", lambda _, w=word: f"= {w}", lines[k], count=1)
            yield f"{lines[k].split()[0]} is {word[:9]!r}", "\n".join([*lines[:k], changed, *lines[k + 1 :]])
    for k in numbered[:: max(1, len(numbered) // 8)]:
        yield f"{lines[k].split()[0]} lost", "\n".join(lines[:k] + lines[k + 1 :])
        yield f"{lines[k].split()[0]} twice", "\n".join(lines[: k + 1] + lines[k:])
    yield "byte order mark", b"\xef\xbb\xbf" + text.encode()
    yield "carriage returns", text.replace("\n", "\r\n")
    yield "UTF-16", text.encode("utf-16")
    yield "empty", ""
    yield "a null", text[:200] + "\0" + text[200:]
    yield "nested keys", text + "\n" + ".".join(["a"] * 3_000) + " = 1\n"
    yield "nested lists", "x = " + "[" * 50_000
    yield "an unknown table", text + "\n[motor]\nx = 1\n"
    yield "an effect without a name", text + "\n[[effects]]\nx = 1.0\n"
    rng = np.random.default_rng(0)
    for k in range(20):
        data = bytearray(text.encode())
        for at in rng.integers(0, len(data), 3):
            data[at] = int(rng.choice(list(b'[]{}="#,;\x00\xff\n')))
        yield f"bytes changed, {k}", bytes(data)
    for share in (0.3, 0.6):
        yield f"cut off at {share:.0%}", text[: int(share * len(text))]


# --- outcomes -----------------------------------------------------------------------------------------------
def answer(path: Path, params: BenchParameters) -> tuple[dict[str, float], list[str]]:
    """Return the error of each equation over its noise floor, and what was said on the way."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = evaluate_log(read_log(path, nan="keep"), params)
    said = [str(w.message) for w in caught if issubclass(w.category, PamidWarning)]
    return {name: e.rmse / e.noise_floor for name, e in result.items()}, [*said, *result.skipped.values()]


def log_outcome(path: Path, params: BenchParameters, healthy: dict[str, float]) -> Outcome:
    """Read and evaluate a log, and hold the answer against that of the healthy one."""
    try:
        found, said = answer(path, params)
    except PamidError as error:
        return Outcome("refused", str(error))
    same = found.keys() == healthy.keys() and all(abs(found[k] / healthy[k] - 1) < ALIKE for k in healthy)
    return Outcome("same" if same else "told" if said else "silent", "; ".join(said) or str(found))


def simulator_outcome(path: Path) -> Outcome:
    """Read a simulator file, and hold it against the healthy one."""
    try:
        found = BenchParameters.from_toml(path)
    except PamidError as error:
        return Outcome("refused", str(error))
    same = found.values() == healthy_simulator().values() and found.tolerance == healthy_simulator().tolerance
    return Outcome("same" if same else "silent", str(found))


def main() -> None:
    """Print how many files came to which end."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, help="folder that keeps the files (default: none)")
    args = parser.parse_args()
    with contextlib.ExitStack() as stack:
        folder = args.out or Path(stack.enter_context(tempfile.TemporaryDirectory()))
        folder.mkdir(parents=True, exist_ok=True)
        params = healthy_simulator()
        healthy = answer(write_log(healthy_log(), folder / "healthy.csv"), params)[0]
        logs = [(d, log_outcome(d.path, params, healthy)) for d in damaged_logs(folder)]
        pages = [(d, simulator_outcome(d.path)) for d in damaged_simulators(folder)]
    for what, found in (("logs", logs), ("simulator files", pages)):
        counts = Counter(outcome.kind for _, outcome in found)
        print(
            f"{len(found)} damaged {what}: "
            + ", ".join(f"{counts[k]} {k}" for k in ("refused", "told", "same", "silent"))
        )
        for damage, outcome in found:
            if outcome.kind == "silent":
                print(f"  silent: {damage.damage}: {outcome.said[:100]}")
    damaged_models.main()
    damaged_streams.main()
    damaged_foreign.main([])


if __name__ == "__main__":
    main()
