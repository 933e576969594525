"""Memory and time of evaluating a log in pieces, from parquet and HDF5, against reading it as a whole.

Each way runs in a process of its own; ``peak`` is what it needs beyond a process that has evaluated a small log.
Memory is read from Linux's ``/proc``.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from scaling import MB, TILED, log_of, measure

COLUMNS = 12
FIXED = 150.0
"""What the bound counts for the readers themselves, MB."""


def write(path: Path, rows: int) -> None:
    """Write a long log part by part, so that writing needs no more memory than reading."""
    one = log_of(50 * TILED).assign(trajectory=lambda t: t["trajectory"].astype(str))
    numeric = [c for c in one.columns if pd.api.types.is_numeric_dtype(one[c]) and c != "time"]
    rng = np.random.default_rng(0)

    def part(k: int) -> pd.DataFrame:
        noise = {
            c: one[c] * (1 + 1e-9 * rng.standard_normal(len(one))) for c in numeric
        }  # as a bench's, incompressible
        return one.assign(trajectory=one["trajectory"] + f"-{k}", **noise)[: rows - k * len(one)]

    parts = -(-rows // len(one))
    if path.suffix == ".parquet":
        import pyarrow as pa
        import pyarrow.parquet as pq

        first = pa.Table.from_pandas(part(0), preserve_index=False)
        with pq.ParquetWriter(path, first.schema) as writer:
            writer.write_table(first)
            for k in range(1, parts):
                writer.write_table(pa.Table.from_pandas(part(k), schema=first.schema, preserve_index=False))
        return
    import h5py

    with h5py.File(path, "w") as file:
        group = file.create_group("log", track_order=True)
        for k in range(parts):
            table = part(k)
            for name in table.columns:
                text = not pd.api.types.is_numeric_dtype(table[name])
                values = table[name].to_numpy(dtype=object if text else float)
                if k == 0:
                    kind = h5py.string_dtype() if text else float
                    group.create_dataset(name, data=values, dtype=kind, maxshape=(None,), chunks=True)
                else:
                    item = group[name]
                    item.resize(len(item) + len(values), axis=0)
                    item[-len(values) :] = values


def one(path: Path, rows: int) -> dict[str, float]:
    """Evaluate a log in pieces of some rows, or as a whole for 0."""
    from pamid.bench import BenchParameters
    from pamid.equations import evaluate_log
    from pamid.signals import read_log, read_log_pieces

    bench = BenchParameters.for_muscle("B")
    with tempfile.TemporaryDirectory() as folder:  # imports and first calls are not counted
        write(Path(folder) / path.name, 4 * TILED)
        evaluate_log(read_log_pieces(Path(folder) / path.name), bench)
    found = {}

    def work() -> None:
        found["result"] = evaluate_log(read_log_pieces(path, rows=rows) if rows else read_log(path), bench)

    seconds, peak = measure(work)
    return {"seconds": seconds, "peak": peak, "rmse": found["result"]["force"].rmse}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=int, default=1_000_000, help="rows of the log (default: 1000000)")
    parser.add_argument("--full", action="store_true", help="ten million rows")
    parser.add_argument("--pieces", default="100000,1000000", help="rows of a piece (default: 100000,1000000)")
    parser.add_argument("--one", nargs=2, metavar=("FILE", "ROWS"), help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one:
        print(json.dumps(one(Path(args.one[0]), int(args.one[1]))))
        return 0
    rows = 10_000_000 if args.full else args.rows
    print("log                       pieces of        s   peak / MB   bound / MB      rmse of force / N")
    for ending in ("parquet", "h5"):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"log.{ending}"
            write(path, rows)
            size = path.stat().st_size / MB
            for piece in (*map(int, args.pieces.split(",")), 0):
                if piece == 0 and rows > 2_000_000:
                    continue  # as a whole it might not fit
                command = [sys.executable, __file__, "--one", str(path), str(piece)]
                out = json.loads(
                    subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()[-1]
                )
                bound = f"{FIXED + 60 * COLUMNS * piece / MB:12.0f}" if piece else f"{'-':>12}"
                print(
                    f"{rows:,} rows {ending:8} {size:5.0f} MB {piece or 'all':>9} {out['seconds']:8.1f} "
                    f"{out['peak']:11.0f} {bound} {out['rmse']:22.12g}",
                    flush=True,
                )
    return 0


if __name__ == "__main__":
    sys.exit(main())
