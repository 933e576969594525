"""Import time of `import pamid` and of the help of the command line, and which heavy libraries an import loads.

Every figure is the median over fresh processes, taken in turns. ``bare`` is Python itself, doing nothing. The last
column names which of the heavy libraries a process of that kind has loaded at its end. Run with
``python benchmarks/import_time.py``; takes a quarter of a minute.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time

import numpy as np

HEAVY = ("numpy", "scipy", "pandas", "matplotlib", "sklearn", "torch")
KINDS = {
    "bare": "",
    "import pamid": "import pamid",
    "pamid --help": "from pamid.cli import main; main(['--help'])",
    "pamid compare --help": "from pamid.cli import main; main(['compare', '--help'])",
    "pamid.read_log": "from pamid import read_log",
    "pamid.estimators": "from pamid.estimators import StaticPIHM",
}
REPORT = f"import sys; sys.stderr.write(' '.join(m for m in {HEAVY!r} if m in sys.modules))"


def run(code: str) -> tuple[float, str]:
    """Return the time of a fresh process, s, and the heavy libraries that it has loaded."""
    # The command line ends by raising SystemExit.
    lines = ["try:", f"    {code or 'pass'}", "except SystemExit:", "    pass", REPORT]
    start = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", "\n".join(lines)], check=True, capture_output=True, text=True)
    return time.perf_counter() - start, done.stderr


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=15, help="processes of each kind (default: 15)")
    args = parser.parse_args()
    for code in KINDS.values():
        run(code)  # files come from the disk once
    times: dict[str, list[float]] = {kind: [] for kind in KINDS}
    loaded: dict[str, str] = {}
    for _ in range(args.repeats):
        for kind, code in KINDS.items():
            seconds, loaded[kind] = run(code)
            times[kind].append(seconds)
    bare = np.array(times["bare"])
    print(f"medians of {args.repeats} fresh processes, s")
    print(f"{'':22s} whole process   beyond bare Python   slowest   heavy libraries loaded")
    for kind, seconds in times.items():
        t = np.array(seconds)
        names = loaded[kind] or "none"
        print(f"{kind:22s} {np.median(t):13.3f} {np.median(t - bare):20.3f} {t.max():9.3f}   {names}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
