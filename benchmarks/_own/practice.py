"""Six simulators of users' own with what was withheld from each, in a folder that is not part of this package."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks._answers import Record, lines_of, short

from .ask import ask, names_of


class Log(NamedTuple):
    """A folder of the practice logs.

    Parameters
    ----------
    page, logs : str
        The simulator's page or model, and the pattern of its logs.
    truth : str
        What was withheld, in words.
    wanted : tuple of str
        Patterns: each has to match a name of a cause of its own, and no cause may be left over.
    effects : tuple of str
        The effects that were withheld, which any library needs.
    """

    page: str
    logs: str
    truth: str
    wanted: tuple[str, ...]
    effects: tuple[str, ...]


_DRY = "(coulomb|stribeck|directional)\\w*friction"
LOGS = {
    "backlash": Log(
        "drive.toml", "drv*.csv", "play of 0.5° between motor and load", ("(backlash|play)\\w*@",), ("backlash",)
    ),
    "hydraulic": Log(
        "hyd.toml", "hyd*.csv", "leak between the chambers 6e-12 m³/s/Pa and Coulomb friction of 350 N",
        ("leak\\w*@\\w*p[AB]", f"{_DRY}@\\w*(pos|vel)"), ("leakage", "coulomb_friction"),
    ),
    "quartercar": Log(
        "car.toml", "run*.csv", "dry friction of 90 N in the strut, between wheel and body", (f"{_DRY}@",),
        ("coulomb_friction",),
    ),
    "control_pole": Log(
        "plant.toml", "step*.csv", "pole of 60 ms at the input or at the output, nobody can tell",
        ("(actuator_lag@u0.*sensor_lag@y0|sensor_lag@y0.*actuator_lag@u0)",), ("actuator_lag", "sensor_lag"),
    ),
    "go1_friction": Log(
        "sim.toml", "leg_*.csv", "thigh damping 2 to 3.2 N m s/rad, calf dry friction 0.2 to 0.7 N m",
        ("(viscous_friction|back_emf|parameter_deviation)@\\S*thigh", f"({_DRY}|deviation)@\\S*calf"),
        ("viscous_friction", "parameter_deviation", "coulomb_friction"),
    ),
    "mjdz": Log("arm.xml", "arm.csv", "dead zone of 0.9 N m", ("actuator_dead_zone@motor",), ("actuator_dead_zone",)),
}  # fmt: skip
FOLDER: list[Path] = []
"""Where the logs lie, set by the command."""


def read(folder: Path, log: Log) -> tuple[Any, Any]:
    """Return the log and the simulator, as ``pamid diagnose --trust`` reads them."""
    from pamid.signals import read_log
    from pamid.simulators import MujocoSimulator, read_simulator

    page = folder / log.page
    simulator = MujocoSimulator(page) if page.suffix == ".xml" else read_simulator(page, trust=True)
    columns = folder / "columns.toml"
    mapping = columns if columns.is_file() else None
    return read_log(sorted(folder.glob(log.logs)), mapping, simulator=simulator), simulator


def solve(name: str) -> Record:
    """Return what is said of one folder."""
    return judged(name, *read(FOLDER[0] / name, LOGS[name]))


def judged(name: str, log: Any, simulator: Any, effects: Any = "all") -> Record:
    """Return what is said of a log of one folder, and whether it is right."""
    wanted, answer = LOGS[name], ask(log, simulator, effects)
    left = [" ".join(sorted(names)) for names in names_of(answer)]
    missing = []
    for pattern in wanted.wanted:
        match = next((text for text in left if re.search(pattern, text)), None)
        if match is None:
            missing.append(pattern)
        else:
            left.remove(match)
    return answer | {
        "right": not missing and not left, "missing": missing, "foreign": left, "said": short(answer),
        "truth": wanted.truth, "rows": len(log),
    }  # fmt: skip


def jobs(cases: int, seed: int) -> list[tuple[str, Callable[[], Record]]]:
    """Return the cases, or none with a word why."""
    if not FOLDER or not FOLDER[0].is_dir():
        print("skipped practice: --practice FOLDER names the folder of the logs, which is not part of this package")
        return []
    there = [n for n in LOGS if (FOLDER[0] / n).is_dir()]
    for name in sorted(LOGS.keys() - set(there)):
        print(f"skipped practice {name}: not in {FOLDER[0].name}")
    return [(f"practice {n}", partial(solve, n)) for n in there[:cases]]


def line(record: Record) -> str:
    """Return a case in a few lines."""
    runs = f"{record['runs']:.0f} runs" if record["runs"] else f"rates {record['rates']:.0f} times over the log"
    found = [f"{'RIGHT' if record['right'] else 'WRONG'}, true is {record['truth']}", record["said"], *lines_of(record)]
    found.append(f"{record['took']:.0f} s, {record['rows']} rows, {runs}")
    if record["missing"] or record["foreign"]:
        found.append(f"missing: {len(record['missing'])}; foreign: {'; '.join(record['foreign']) or 'none'}")
    return "\n      ".join(found)


def summary(records: list[Record]) -> list[str]:
    """Return what they come to."""
    done = [r for r in records if "right" in r]
    return [f"truth named, alone: {sum(r['right'] for r in done)} of {len(done)}"]
