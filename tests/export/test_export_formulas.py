"""Models that are formulas say in C and ONNX what they say in Python; a lift steps as ``simulate`` does."""

from __future__ import annotations

import math
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import (
    CylinderForce,
    ForwardModel,
    GeometricFlow,
    GeometricForce,
    HosovskyHybrid,
    InverseModel,
    JointDrive,
    LawRegressor,
    NonlinearElastic,
    PolynomialFlow,
    PolynomialForce,
    ResidualHybrid,
    SINDyRegressor,
    StaticForceMap,
    ThreeElement,
)

from pamid.errors import ExportError
from pamid.export import export
from pamid.export.expression import symbol
from pamid.export.formula import reference_rows
from pamid.export.write import any_plan_of
from pamid.volume.braided import BraidedVolume, chou_hannaford
from pamid.volume.functions import flow

pytestmark = pytest.mark.filterwarnings("ignore::pamid.errors.PamidWarning")
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2"]
COMPILER = shutil.which("gcc") or shutil.which("cc")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler (gcc or cc) on this machine")
STATE = ["eps", "deps", "P", "dP"]


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    rng = np.random.default_rng(0)
    n = 200
    X = pd.DataFrame(
        {
            "eps": rng.uniform(0.0, 0.2, n),
            "deps": rng.normal(0.0, 0.2, n),
            "P": rng.uniform(1.5e5, 6e5, n),
            "dP": rng.normal(0.0, 3e5, n),
            "load": rng.uniform(5.0, 50.0, n),
        }
    )
    pull = chou_hannaford(X.P, X.eps, rest_diameter=0.021, braid_angle=0.45)
    X["F"] = pull - 40.0 * np.tanh(8.0 * X.deps) - 200.0 * X.eps + rng.normal(0.0, 1.0, n)
    X["dx"], X["q"], X["dq"], X["ddq"] = 0.5 * X.deps, 5.0 * X.eps, 5.0 * X.deps, rng.normal(0.0, 3.0, n)
    X["drive"] = 0.1 * X.ddq + 0.5 * np.sin(X.q) + 0.2 * np.tanh(2.0 * X.dq)
    X["mdot"] = flow(BraidedVolume(0.2, 0.021, 0.45), X.P, X.dP, X.eps, X.deps)
    return X.assign(V=7e-5, V_eps=pull * 0.2 / (X.P - 101_325.0), V_P=0.0, trajectory=np.arange(n) // 50)


SMALL = {"hidden": 4, "n_starts": 1, "max_iter": 10, "random_state": 0}
CASES = {
    "GeometricForce": (GeometricForce(), ["eps", "P"], "F"),
    "GeometricForce, friction": (GeometricForce("tondu_lopez", friction=True), ["eps", "deps", "P"], "F"),
    "GeometricForce, bou_saba": (GeometricForce("bou_saba", max_iter=20), ["eps", "P"], "F"),
    "GeometricFlow": (GeometricFlow(), STATE, "mdot"),
    "PolynomialForce": (PolynomialForce(), ["eps", "P"], "F"),
    "PolynomialForce, surface": (PolynomialForce(5, "surface"), ["eps", "P"], "F"),
    "PolynomialFlow": (PolynomialFlow(2, 1), STATE, "mdot"),
    "StaticForceMap": (StaticForceMap(max_iter=20), ["eps", "P"], "F"),
    "NonlinearElastic": (NonlinearElastic(max_iter=20), ["eps", "P"], "F"),
    "HosovskyHybrid": (HosovskyHybrid(max_iter=20), ["eps", "deps", "P"], "F"),
    "ThreeElement": (ThreeElement(pieces=3), STATE, "F"),
    "ResidualHybrid": (ResidualHybrid(**SMALL), STATE, "F"),
    "ResidualHybrid, plain": (ResidualHybrid(PolynomialForce(2), vanishing=False, **SMALL), STATE, "F"),
    "InverseModel": (InverseModel(**SMALL), ["F", "eps"], "P"),
    "InverseModel, direction": (InverseModel(direction=True, **SMALL), ["F", "eps", "trajectory"], "P"),
    "ForwardModel": (ForwardModel(**SMALL), ["P", "load"], ["F", "eps"]),
    "SINDyRegressor": (SINDyRegressor(degree=2, sign_of=("deps",)), STATE, "F"),
    "CylinderForce": (CylinderForce(still=0.05), ["dx", "P"], "F"),
    "JointDrive": (JointDrive(still=0.5), ["q", "dq", "ddq"], "drive"),
    "LawRegressor": (LawRegressor(), [*STATE, "V", "V_eps", "V_P"], "F"),
}


@pytest.fixture(scope="module")
def fitted(table):
    return {name: model.fit(table[columns], table[target]) for name, (model, columns, target) in CASES.items()}


def test_every_estimator_with_a_formula_is_among_the_cases():
    from pamid.estimators import all_estimators

    names = {name for name, c in all_estimators() if hasattr(c, "formulas")}
    assert names == {case.split(",")[0] for case in CASES}


@needs_compiler
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("case", CASES)
def test_c_agrees_with_predict(fitted, case, dtype, tmp_path):
    export(fitted[case], tmp_path, "c", dtype=dtype)
    sources = ["muscle.c", "muscle_selftest.c"]
    subprocess.run([COMPILER, *STRICT, *sources, "-lm", "-o", "test"], cwd=tmp_path, check=True, timeout=60)
    done = subprocess.run([tmp_path / "test"], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout
    assert "passed, 64 rows" in done.stdout


@pytest.mark.parametrize("case", CASES)
def test_onnx_agrees_with_predict(fitted, case, tmp_path):
    runtime = pytest.importorskip("onnxruntime", reason="onnxruntime comes with pamid[export]")
    (file,) = export(fitted[case], tmp_path, "onnx")
    plan = any_plan_of(fitted[case])
    X, expected = reference_rows(plan)
    session = runtime.InferenceSession(str(file), providers=["CPUExecutionProvider"])
    found = np.hstack(session.run([o.name for o in plan.outputs], {"X": X}))
    assert np.allclose(found, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("case", CASES)
def test_reference_values_are_those_of_predict_and_spread(fitted, case, table):
    _, columns, _ = CASES[case]
    plan = any_plan_of(fitted[case])
    X, expected = reference_rows(plan)
    assert expected.shape == (64, len(plan.outputs))
    assert (np.ptp(expected, axis=0) > 0).all()
    if "direction" not in plan.inputs:
        given = pd.DataFrame(X, columns=list(plan.inputs))[columns]
        assert np.array_equal(expected, np.reshape(fitted[case].predict(given), expected.shape))


_LIFT = """
#include "muscle.h"
#include <stdio.h>
int main(void)
{
    muscle_lift lift = {%s, 0};
    muscle_drive from, to;
    int held = 0;
    printf("%%.17g %%.17g 0\\n", lift.eps, lift.deps);
    if (scanf("%%lf %%lf", &from.P, &from.dP) != 2)
        return 1;
    while (scanf("%%lf %%lf", &to.P, &to.dP) == 2) {
        held = muscle_step(&lift, &from, &to, 40.0, 1.0 / 128.0);
        printf("%%.17g %%.17g %%d\\n", lift.eps, lift.deps, held);
        from = to;
    }
    return 0;
}
"""


@needs_compiler
def test_a_lift_steps_as_it_is_simulated(table, tmp_path):
    rows = table.assign(F=1.2e-3 * (table.P - 101_325) - 900.0 * table.eps - 60.0 * table.deps)
    model = ThreeElement().fit(rows[STATE], rows["F"])
    t = np.arange(512) / 128.0  # exact steps, so that both take as many parts
    P = 3.8e5 + 3.5e5 * np.sin(2.0 * t)
    run = model.simulate(t, P, 40.0)
    assert run.held.any()
    assert (run.eps == 0.0).any()
    assert ((run.eps > 0.0) & ~run.held).any()
    export(model, tmp_path)
    (tmp_path / "lift.c").write_text(_LIFT % repr(float(run.eps[0])))
    subprocess.run([COMPILER, *STRICT, "muscle.c", "lift.c", "-lm", "-o", "lift"], cwd=tmp_path, check=True)
    text = "\n".join(f"{p!r} {d!r}" for p, d in zip(P.tolist(), np.gradient(P, t).tolist(), strict=True))
    done = subprocess.run([tmp_path / "lift"], input=text, capture_output=True, text=True, check=True)
    found = np.array([[float(v) for v in line.split()] for line in done.stdout.splitlines()])
    assert np.allclose(found[:, 0], run.eps, rtol=0, atol=1e-9)
    assert np.allclose(found[:, 1], run.deps, rtol=0, atol=1e-7)
    assert np.array_equal(found[:, 2] > 0, run.held)


def test_what_is_no_formula_is_named(table, tmp_path: Path):
    from pamid.estimators import StaticPIHM

    inner = StaticPIHM(hidden_layer_sizes=(4,), max_iter=2, random_state=0)
    hybrid = ResidualHybrid(inner, **SMALL).fit(table[STATE], table["F"])
    with pytest.raises(ExportError, match="ResidualHybrid"):
        export(hybrid, tmp_path)
    with pytest.raises(ExportError, match="FMU"):
        export(GeometricForce().fit(table[["eps", "P"]], table["F"]), tmp_path, "fmu")
    shared = PolynomialForce(1, signals={"eps": 0, "P": 0}).fit(table[["eps"]].to_numpy(), table["F"])
    with pytest.raises(ExportError, match="share one column"):
        export(shared, tmp_path)
    named = SINDyRegressor(("my eps",), degree=1).fit(table[["eps"]].rename(columns={"eps": "my eps"}), table["F"])
    with pytest.raises(ExportError, match="not a C identifier"):
        export(named, tmp_path)


def test_functions_of_angles_are_recorded_and_those_of_math_refused() -> None:
    x = symbol("x")
    assert {f(x).op for f in (np.cos, np.tan, np.cosh, np.sinh)} <= {"sin", "div", "mul"}
    with pytest.raises(ExportError, match=r"numpy\.cos for math\.cos"):
        math.cos(x)
