"""What another package declares as entry points is used, what is broken is a warning, and no torch is loaded."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = """
import numpy as np
import pandas as pd
from pamid.effects import Effect, Parameter
from pamid.signals.formats import Format, RawTable
from pamid.simulators import FunctionSimulator


class SleeveSpring(Effect):
    '''A sleeve that pulls back with the square of the contraction.'''

    name = "sleeve_spring"
    family = "elasticity"
    equations = ("force", "joint")
    roles = ("position",)
    parameters = (Parameter("square", "N", -1e5, 1e5, 300.0, "force per squared travel", linear=True, position=-2),)

    def force(self, s, x, plant):
        return -self.square * s.position**2


class StrangeFunction(FunctionSimulator):
    kinds = ("strange",)


def _read(path, mapping, most):
    return [RawTable(pd.read_csv(path, skiprows=1))], None


READER = Format("strange log", (".slog",), lambda head: head.startswith(b"STRANGE"), _read)
NOT_A_READER = 7
"""

PROJECT = """
[build-system]
requires = ["setuptools"]
build-backend = "setuptools.build_meta"
[project]
name = "stranger-package"
version = "1.0"
[tool.setuptools]
py-modules = ["stranger"]
[project.entry-points."pamid.effects"]
sleeve = "stranger:SleeveSpring"
gone = "stranger_that_is_not_there:Effect"
[project.entry-points."pamid.simulators"]
strange = "stranger:StrangeFunction"
[project.entry-points."pamid.readers"]
slog = "stranger:READER"
seven = "stranger:NOT_A_READER"
"""

PAGE = """
kind = "strange"
[strange]
function = "piston.py:force"
[ports]
P = { kind = "input", unit = "Pa" }
F = { kind = "output", unit = "N" }
[parameters]
area = { value = 5e-4, tolerance = 0.02, unit = "m^2" }
"""

EFFECT = """
import sys
from pamid.bench import BenchParameters, simulate, sine
from pamid.gap import diagnose

bench = BenchParameters.for_muscle("B")
actual = bench.replace(effects=[("sleeve_spring", {"square": 2000.0})])
log = simulate(actual, [sine(2, 10, 500), sine(6, 10, 500)], seed=0)
d = diagnose(log, bench, ["sleeve_spring", "viscous_friction", "leakage"])
print(*d.causes[0].effects, [m for m in ("torch", "pysindy") if m in sys.modules])
"""

SIMULATOR = """
import sys
import numpy as np
import pandas as pd
from pathlib import Path
import pamid
from pamid.gap import diagnose_simulator
from pamid.simulators import read_simulator

Path("piston.py").write_text("def force(u, p): return u.P * p.area")
sim = read_simulator("page.toml", trust=True)
print(type(sim).__name__, sim.outputs)
t = np.arange(0, 8, 0.01)
P = 3e5 + 1e5 * np.sin(2 * t)
F = 5e-4 * P + 12.0 + np.random.default_rng(0).normal(0, 0.1, t.size)
d = diagnose_simulator(pd.DataFrame({"time": t, "P": P, "F": F, "trajectory": 0}), sim, ["sensor_bias"])
print(len(d.causes), [m for m in ("torch", "pysindy") if m in sys.modules])
"""

READER = """
import numpy as np
from pathlib import Path
import pamid
from pamid.bench import BenchParameters, simulate, sine
log = simulate(BenchParameters.for_muscle("B"), [sine(2, 10, 200)], seed=0)
Path("run.slog").write_text("STRANGE 1\\n" + log.to_csv(index=False))
print(len(pamid.read_log("run.slog")) == len(log))
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder into which pip has installed the package of somebody else."""
    pytest.importorskip("setuptools")
    source, into = tmp_path_factory.mktemp("stranger"), tmp_path_factory.mktemp("site")
    (source / "pyproject.toml").write_text(PROJECT)
    (source / "stranger.py").write_text(PACKAGE)
    command = "-m pip install --quiet --no-deps --no-index --no-build-isolation --disable-pip-version-check --target"
    subprocess.run([sys.executable, *command.split(), str(into), str(source)], check=True, timeout=300)
    return into


@pytest.fixture
def run(installed: Path, tmp_path: Path):
    (tmp_path / "page.toml").write_text(PAGE)
    root = Path(__file__).resolve().parents[1]

    def in_a_process(code: str) -> tuple[str, str]:
        path = os.pathsep.join([str(installed), str(root)])
        done = subprocess.run(
            [sys.executable, "-c", code], cwd=tmp_path, env={**os.environ, "PYTHONPATH": path}, capture_output=True,
            text=True, timeout=300,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return done.stdout, done.stderr

    return in_a_process


def test_a_diagnosis_names_the_effect_of_another_package_and_loads_no_torch(run):
    out, warned = run(EFFECT)
    assert out.split() == ["sleeve_spring", "[]"]
    assert "gone of the package stranger-package is left out" in warned


def test_a_page_may_name_the_simulator_of_another_package_and_its_diagnosis_loads_no_torch(run):
    out, _ = run(SIMULATOR)
    assert out.splitlines() == ["StrangeFunction ('F',)", "1 []"]


def test_a_log_is_read_by_the_reader_of_another_package(run):
    out, warned = run(READER)
    assert out.split() == ["True"]
    assert "seven of the package stranger-package is left out (7)" in warned
