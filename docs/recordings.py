"""Record ``pamid watch`` on the twin as a picture: ``python docs/recordings.py`` writes docs/images/watch.svg."""

from __future__ import annotations

import io
import json
import sys
import tempfile
from contextlib import redirect_stdout
from pathlib import Path

from rich.console import Console

from pamid.bench import BenchParameters, simulate, sine
from pamid.cli import main

ROOT = Path(__file__).resolve().parent


def recorded(folder: Path) -> str:
    """Simulate a run in which a leak appears, write it as a stream, and return what the command prints."""
    sys.path.insert(0, str(ROOT.parent / "benchmarks"))
    from streaming import LateLeak

    bench = BenchParameters.for_muscle("B")
    leak = LateLeak(conductance=5e-11, onset=20.6)  # the lead-in of 0.6 s counts
    log = simulate(bench, [sine(5, 15, samples=26_000)], effects=[leak])
    with (folder / "samples.jsonl").open("w", encoding="utf-8") as stream:
        for row in log[["time", "q", "P1", "F1", "mdot1"]].to_dict("records"):
            stream.write(json.dumps(row) + "\n")
    bench.to_toml(folder / "sim.toml")
    said = io.StringIO()
    with redirect_stdout(said):
        main(["watch", str(folder / "samples.jsonl"), "--sim", str(folder / "sim.toml"), "--learn", "15"])
    return said.getvalue()


def write() -> int:
    """Write the picture."""
    with tempfile.TemporaryDirectory() as folder:
        text = recorded(Path(folder))
    console = Console(record=True, width=118, file=io.StringIO())
    console.print("$ logger | pamid watch - --sim sim.toml --learn 15", highlight=False)
    console.print(text.rstrip(), highlight=False)
    (ROOT / "images").mkdir(exist_ok=True)
    console.save_svg(str(ROOT / "images" / "watch.svg"), title="pamid watch")
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(write())
