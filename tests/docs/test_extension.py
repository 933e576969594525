"""A stranger's test: each thing that docs/architecture.md says is one new file works once that one file is there.

The package is copied to a scratch folder, the templates of docs/templates are put where they belong, and no other line
is changed.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
if not (ROOT / "pyproject.toml").is_file():
    pytest.skip("needs the repository", allow_module_level=True)

PLACES = {
    "law": "pamid/laws/my_law.py",
    "effect": "pamid/effects/my_effect.py",
    "residual": "pamid/equations/my_residual.py",
    "estimator": "pamid/estimators/my_estimator.py",
    "log_format": "pamid/signals/formats/my_format.py",
    "trainer": "pamid/training/my_trainer.py",
    "section": "pamid/report/sections/my_section.py",
}
"""Where each template goes."""

# What a stranger does with each; the first line that fails is what went wrong.
USES = r"""
import json, sys, traceback, warnings
from pathlib import Path
import numpy as np, pandas as pd
warnings.simplefilter("ignore")
import pamid
from pamid.bench import BenchParameters, simulate, sine
assert Path(pamid.__file__).is_relative_to(Path.cwd()), pamid.__file__

bench = BenchParameters.for_muscle("B")
runs = [sine(2, 10, 500), sine(6, 10, 500)]
log = simulate(bench, runs, seed=0)
rng = np.random.default_rng(0)
X = pd.DataFrame({"eps": rng.uniform(0.02, 0.2, 300), "P": rng.uniform(2e5, 6e5, 300)})

def law():
    from pamid.estimators import LawRegressor
    from pamid.laws.my_law import MyLaw
    from pamid.signals import State
    state = State(0.1, 0.5, 3e5, 2e5)
    flow = MyLaw().predict(1e-4, 2e-4, 0.0, state)
    assert np.isclose(flow, (2e5 * 1e-4 + 3e5 * 2e-4 * 0.5) / (287 * 293), rtol=1e-3), flow
    table = pd.DataFrame([{"eps": 0.1, "deps": 0.5, "P": 3e5, "dP": 2e5, "V": 1e-4, "V_eps": 2e-4, "V_P": 0.0}])
    assert np.isclose(LawRegressor(MyLaw()).fit(table, [0.0]).predict(table)[0], flow)

def effect():
    from pamid.effects import all_effects, make_effect
    assert "my_effect" in all_effects()
    dragged = simulate(bench, runs, seed=0, effects=[make_effect("my_effect", drag=40)])
    assert not np.allclose(dragged["F1"], log["F1"])
    from pamid.gap import diagnose
    found = diagnose(dragged, bench, ["my_effect", "leakage"])
    assert [c.effects[0] for c in found.causes] == ["my_effect"], found.verdict

def residual():
    from pamid.equations import all_equations, evaluate_log
    assert "my_residual" in all_equations()
    found = evaluate_log(log, bench, ["my_residual"])
    assert "my_residual" in str(found)

def estimator():
    from sklearn.utils.estimator_checks import check_estimator
    from pamid.estimators import MyEstimator, all_estimators, checked_instances
    assert MyEstimator in dict(all_estimators()).values()
    y = 3.0 + 1e-3 * X["P"] * (1 - 3 * X["eps"])
    model = MyEstimator().fit(X, y)
    assert np.allclose(model.predict(X), y)
    for one in (e for e in checked_instances() if isinstance(e, MyEstimator)):
        check_estimator(one)
    pamid.save(model, "mine.pamid")
    assert np.array_equal(pamid.load("mine.pamid").predict(X), model.predict(X))

def log_format():
    Path("run.mylog").write_text("MYLOG\ntime;eps;P\n" + "".join(f"{k / 100};0.1;{300000 + k}\n" for k in range(200)))
    table = pamid.read_log("run.mylog")
    assert len(table) == 200 and np.isclose(table["P"].iloc[-1], 300199), table

def trainer():
    from pamid.estimators import StaticPIHM
    from pamid.training import TRAINERS
    assert "my_trainer" in TRAINERS
    y = (X["P"] - 101325) * 5e-4 * (1 - 3 * X["eps"])
    size = {"rest_length": 0.2, "rest_diameter": 0.02, "volume_model": "neural", "random_state": 0}
    from pamid.training.my_trainer import MyTrainer
    table = X.assign(deps=0.0, dP=0.0)
    few, many = (np.std(StaticPIHM(trainer=MyTrainer(n), **size).fit(table, y).predict(table) - y) for n in (1, 60))
    assert many < 0.7 * few, (few, many)

def section():
    from pamid.gap import diagnose
    from pamid.report import report_html
    from pamid.report.sections.base import Source
    page = report_html(diagnose(log, bench, ["leakage"]), Source(rows=len(log), runs=2))
    assert f"<p>{len(log)} rows in 2 runs.</p>" in page

told = {}
for name in sys.argv[1:]:
    try:
        globals()[name]()
        told[name] = ""
    except BaseException as error:
        told[name] = "".join(traceback.format_exception(error))
print("TOLD" + json.dumps(told))
"""


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What went wrong with each template, empty where it works."""
    scratch = tmp_path_factory.mktemp("scratch")
    unwanted = shutil.ignore_patterns("__pycache__", "estimators")
    shutil.copytree(ROOT / "pamid", scratch / "pamid", ignore=unwanted)
    shutil.copytree(ROOT / "estimators", scratch / "pamid" / "estimators", ignore=unwanted)
    for name, place in PLACES.items():
        shutil.copy(ROOT / "docs" / "templates" / f"{name}.py", scratch / place)
    done = subprocess.run(
        [sys.executable, "-c", USES, *PLACES],
        cwd=scratch,
        env={**os.environ, "PYTHONPATH": str(scratch)},
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert "TOLD" in done.stdout, done.stderr[-2000:]
    found: dict[str, Any] = json.loads(done.stdout.partition("TOLD")[2])
    return found


@pytest.mark.parametrize("name", PLACES)
def test_one_file_is_enough(name: str, told: dict[str, str]) -> None:
    assert not told[name]


def test_the_page_for_strangers_names_every_template() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    table = page.partition("## Where something new goes")[2]
    named = set(re.findall(r"templates/(\w+)\.py", table))
    assert named == set(PLACES) == {file.stem for file in (ROOT / "docs" / "templates").glob("*.py")}
