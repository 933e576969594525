"""Photograph the beginnings of reports for docs/diagnosis.md: ``python docs/report_pictures.py`` (needs chromium).

The logs of a class, of an unknown cause and of no gap are those of docs/reading.md.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from browser import BrowserPage

from pamid import BenchParameters, simulate
from pamid.bench import isometric, sine, step, triangle
from pamid.gap import diagnose
from pamid.report import write_report

IMAGES = Path(__file__).resolve().parent / "images"
WIDTH = 1180
FEW = [sine(4, 15, 1500), sine(6, 10, 1500)]
GAS = ["dead_volume", "gas_temperature", "polytropic_exponent", "leakage", "coulomb_friction"]
ELASTIC = ["coulomb_friction", "viscous_friction", "hysteresis", "leakage"]
REPORTS = {
    "cause": (
        [sine(2, 20, 2500), sine(10, 10, 2000), triangle(2, 15, 2500), step(0, 12, 2000), isometric(8, 9e4, 2000)],
        [("leakage", {"conductance": 1.5e-10})],
        "all",
    ),
    "class": (FEW, [("dead_volume", {"volume": 1e-5})], GAS),
    "unknown": ([sine(3, 12, 1200), sine(8, 8, 1200)], [("end_cap", {"factor": 1.02})], ELASTIC),
    "none": (FEW, [], GAS),
}
"""Runs, causes and library of each report."""


def main() -> int:
    """Diagnose, write the reports, photograph them."""
    simulator = BenchParameters.for_muscle("B")
    with tempfile.TemporaryDirectory() as folder:
        browser = BrowserPage(Path(folder) / "profile")
        try:
            for name, (runs, causes, library) in REPORTS.items():
                found = diagnose(simulate(simulator, runs, effects=causes, seed=0), simulator, library)
                browser.open(write_report(found, Path(folder) / f"{name}.html"), WIDTH)
                browser.ask("document.documentElement.style.overflow = 'hidden'")
                browser.picture(IMAGES / f"diagnosis-{name}.png")
                print(f"diagnosis-{name}.png: {found.verdict}")
        finally:
            browser.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
