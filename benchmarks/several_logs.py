"""Held-out error of all models on several logs of benches: a table each for force, flow, inverse and dynamic problem.

``--data`` is a folder of folders, each with a log ``data.parquet`` and its simulator ``sim.toml``. Each log goes
through ``pamid compare LOG --problem PROBLEM --json`` without any setting of its own. What that prints is kept in
``--out``, and an interrupted run goes on where it was. A * marks an error that differs from the log's best by more than
chance. Run with ``python benchmarks/several_logs.py --data DIR``; takes about four minutes a log and problem, less with
fewer rows (``--rows``, ``--score-rows``) or models (``--estimators``).
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

COMMAND = "import sys; from pamid.cli import main; sys.exit(main(sys.argv[1:]))"
UNITS = {"force": (1.0, "N"), "flow": (1e-6, "1e-6 kg/s"), "inverse": (1e3, "kPa"), "dynamic": (1e3, "kPa")}


def compared(log: Path, equation: str, options: list[str], out: Path) -> dict | None:
    """Return what the command says of a log, from its file if there is one; None if it failed."""
    kept = out / f"{log.parent.name}-{equation}.json"
    if not kept.exists():
        words = ["compare", str(log), "--problem", equation, *options, "--json", "--quiet"]
        done = subprocess.run([sys.executable, "-c", COMMAND, *words], capture_output=True, text=True)
        if done.returncode:
            print(f"{log}: {done.stderr.strip()}", file=sys.stderr)
            return None
        kept.write_text(done.stdout)
    return json.loads(kept.read_text())


def table(results: dict[str, dict], equation: str) -> str:
    """Lay out errors, a line an estimator that ran on every log, best geometric mean first."""
    factor, unit = UNITS[equation]
    found = {log: {e["estimator"]: e for e in r["estimators"] if not e["error"]} for log, r in results.items()}
    names = set.intersection(*(set(f) for f in found.values()))

    def product(name: str) -> float:
        value = 1.0
        for f in found.values():
            value *= f[name]["rmse"] / factor
        return value

    width = max(map(len, names)) + 1
    lines = [f"{f'{equation}, RMSE / {unit}':{width}s}" + "".join(f"{log[-9:]:>10s} " for log in results)]
    for name in sorted(names, key=product):
        cells = (f"{f[name]['rmse'] / factor:10.3g}{'*' if f[name]['differs'] else ' '}" for f in found.values())
        lines.append(f"{name:{width}s}" + "".join(cells))
    floors = [r["noise_floor"] for r in results.values()]
    if all(floors):
        lines.append(f"{'noise floor':{width}s}" + "".join(f"{floor / factor:10.3g} " for floor in floors))
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, help="folder of folders with data.parquet and sim.toml")
    parser.add_argument(
        "--equations", nargs="+", choices=tuple(UNITS), default=["force", "flow"], help="default: force flow"
    )
    parser.add_argument("--logs", nargs="+", help="names of the folders to read (default: all)")
    parser.add_argument("--estimators", default="all", help="names, comma-separated (default: all)")
    for name in ("folds", "rows", "score-rows"):
        parser.add_argument(f"--{name}", type=int, metavar="N", help="as of pamid compare")
    parser.add_argument(
        "--out", type=Path, default=Path("results"), help="folder for what was printed (default: results)"
    )
    args = parser.parse_args()
    logs = sorted(args.data.glob("*/data.parquet")) if args.data else []
    logs = [log for log in logs if args.logs is None or log.parent.name in args.logs]
    if not logs:
        print(f"No folder with data.parquet in {args.data}; give one by --data. Nothing was measured.")
        return 0
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    args.out.mkdir(parents=True, exist_ok=True)
    options = ["--estimators", args.estimators]
    for name in ("folds", "rows", "score_rows"):
        if (value := getattr(args, name)) is not None:
            options += [f"--{name.replace('_', '-')}", str(value)]
    for equation in args.equations:
        results = {log.parent.name: compared(log, equation, options, args.out) for log in logs}
        if kept := {name: r for name, r in results.items() if r}:
            print(table(kept, equation) + "\n", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
