"""Try the wheel of dist/ in an environment of its own, away from the checkout: ``python .ci/wheel.py``.

The environment holds nothing but the wheel; its dependencies are those of the environment that runs this script, so
that it takes seconds. With ``--complete`` they are installed anew, as a user has them, and the demo runs (minutes, and
torch). With ``--tests`` the tests of less than a second run against the wheel, too; what follows is for pytest, such
as a folder.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SINE = "sine:frequency=4,amplitude=15,seconds=1"
COMMANDS = (
    "--version",
    f"simulate --muscle B --effect coulomb_friction --trajectory {SINE} --out log.parquet",
    "evaluate log.parquet --sim log.sim.toml",
    "fit log.parquet --estimator GeometricForce --sim log.sim.toml --folds 0 --out model.pamid",
    "present model.pamid",
    "diagnose log.parquet --sim log.sim.toml --effects coulomb_friction,leakage --out diagnosis",
)
"""What is run: simulate, evaluate, fit, load, diagnose, and a report with its templates."""


def environment(folder: Path, complete: bool, tests: bool) -> Path:
    """Make an environment with the wheel, and return its folder of programs."""
    (wheel,) = (ROOT / "dist").glob("*.whl")
    venv.create(folder, with_pip=True)
    programs = folder / ("Scripts" if os.name == "nt" else "bin")
    python = str(programs / "python")
    install = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    install += ["-c", str(ROOT / "constraints.txt")] if complete else ["--no-deps"]
    subprocess.run([*install, f"{wheel}[test]" if complete and tests else str(wheel)], check=True)
    if not complete:
        ask = "import sysconfig; print(sysconfig.get_path('purelib'))"
        found = subprocess.run([python, "-c", ask], check=True, capture_output=True, text=True).stdout.strip()
        # A path in a .pth file is only appended: the checkout that may be installed there does not come along.
        (Path(found) / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    return programs


def main() -> int:
    """Install the wheel and run the commands."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--complete", action="store_true", help="install the dependencies, too")
    parser.add_argument("--tests", nargs=argparse.REMAINDER, help="run the tests, too; arguments of pytest may follow")
    given = parser.parse_args()
    complete, tests = given.complete, given.tests
    clean = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON") and k != "VIRTUAL_ENV"}
    clean |= {"OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    with tempfile.TemporaryDirectory() as scratch:
        programs = environment(Path(scratch) / "env", complete, tests is not None)
        place = Path(scratch) / "work"
        place.mkdir()
        ask = "import pamid, pamid.estimators as e; print(pamid.__file__); e.all_estimators()"
        found = subprocess.run(
            [programs / "python", "-c", ask], cwd=place, env=clean, check=True, capture_output=True, text=True
        ).stdout.strip()
        if not Path(found).is_relative_to(Path(scratch).resolve()):
            print(f"pamid was found at {found}, not in the new environment", file=sys.stderr)
            return 1
        for command in (*COMMANDS, "demo") if complete else COMMANDS:
            print(f"pamid {command}", flush=True)
            subprocess.run([programs / "pamid", *command.split(), *quiet(command)], cwd=place, env=clean, check=True)
        written = {p.name for p in (place / "diagnosis").iterdir()}
        if lacking := {"report.html", "corrected.toml", "diagnosis.json"} - written:
            print(f"diagnose did not write {', '.join(sorted(lacking))}", file=sys.stderr)
            return 1
        if tests is not None and run_tests(programs / "python", Path(scratch) / "checked", clean, tests):
            print("tests fail against the wheel", file=sys.stderr)
            return 1
    print("the wheel works in an environment of its own")
    return 0


def run_tests(python: Path, place: Path, clean: dict[str, str], given: list[str]) -> int:
    """Run the tests of less than a second from a folder that holds them alone; those of the repository skip."""
    shutil.copytree(ROOT / "tests", place / "tests", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", place)
    command = [python, "-m", "pytest", "-p", "no:cacheprovider", "-m", "not slow and not long", *given]
    return subprocess.run(command, cwd=place, env=clean).returncode


def quiet(command: str) -> list[str]:
    """Return the option that keeps progress out of the log, where a command has it."""
    return [] if command.startswith("--") else ["--quiet"]


if __name__ == "__main__":
    sys.exit(main())
