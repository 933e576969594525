"""An exported model says what the model says: in C, in ONNX, as an FMU; and what cannot be exported is named."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import (
    JointPIHM,
    OnlineAdapter,
    PolynomialForce,
    PolynomialNARX,
    RateTransformer,
    StaticPIHM,
    ThermodynamicPIHM,
)
from sklearn.ensemble import RandomForestRegressor
from sklearn.frozen import FrozenEstimator
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from pamid import save
from pamid.bench import BenchParameters
from pamid.cli import main
from pamid.effects import make_effect
from pamid.errors import ExportError, OutputError, UnknownOptionError
from pamid.export import export
from pamid.export.expression import symbol
from pamid.export.plan import plan_of
from pamid.export.reference import TOLERANCES, reference_of
from pamid.laws.base import Coefficients
from pamid.laws.quasi_static import QuasiStaticForce
from pamid.laws.valve import flow_function
from pamid.signals.state import State
from pamid.volume.scaled import ScaledVolume

STRICT = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2"]
COMPILER = shutil.which("gcc") or shutil.which("cc")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler (gcc or cc) on this machine")


def signals(n: int = 400) -> pd.DataFrame:
    t = np.linspace(0, 12, n)
    return pd.DataFrame(
        {
            "eps": 0.11 + 0.07 * np.sin(2 * t),
            "deps": 0.14 * np.cos(2 * t),
            "P": 3e5 + 1.2e5 * np.cos(3 * t),
            "dP": -3.6e5 * np.sin(3 * t),
        }
    )


def targets(X: pd.DataFrame) -> np.ndarray:
    V, V_eps = 7e-5 * (1 + 2 * X.eps - 3 * X.eps**2), 7e-5 * (2 - 6 * X.eps)
    force = (X.P - 101_325) / 0.2 * V_eps + 4 * np.tanh(X.deps / 0.05)
    return np.column_stack([force, X.dP * V / (1.4 * 287 * 293) + X.P * V_eps * X.deps / (287 * 293)])


QUICK = {"max_iter": 12, "random_state": 0}
CASES = {
    "anchored force": (StaticPIHM, {"hidden_layer_sizes": (20, 12)}),
    "neural force, tanh": (
        StaticPIHM,
        {"volume_model": "neural", "activation": "tanh", "hidden_layer_sizes": (9, 17, 4)},
    ),
    "anchored flow, silu": (ThermodynamicPIHM, {"activation": "silu", "hidden_layer_sizes": (16,)}),
    "neural flow, no layer": (ThermodynamicPIHM, {"volume_model": "neural", "hidden_layer_sizes": ()}),
    "both": (JointPIHM, {"hidden_layer_sizes": (21,)}),
}


@pytest.fixture(scope="module")
def models() -> dict[str, object]:
    X = signals()
    Y = targets(X)
    fitted = {}
    for name, (kind, params) in CASES.items():
        y = {StaticPIHM: Y[:, 0], ThermodynamicPIHM: Y[:, 1], JointPIHM: Y}[kind]
        fitted[name] = kind(validation_fraction=0, **QUICK, **params).fit(X.to_numpy(), y)
    return fitted


def run_self_test(folder: Path, name: str = "muscle", *flags: str) -> subprocess.CompletedProcess[str]:
    sources = [f"{name}.c", f"{name}_selftest.c"]
    subprocess.run([COMPILER, *STRICT, *flags, *sources, "-lm", "-o", "test"], cwd=folder, check=True, timeout=120)
    return subprocess.run([folder / "test"], capture_output=True, text=True, timeout=60, check=False)


# --- C ------------------------------------------------------------------------------------------------------
@needs_compiler
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("case", CASES)
def test_c_compiles_without_a_warning_and_agrees_with_predict(models, case, dtype, tmp_path):
    export(models[case], tmp_path, "c", dtype=dtype)
    done = run_self_test(tmp_path)
    assert done.returncode == 0, done.stdout
    assert "passed, 64 rows" in done.stdout


_ROWS = """
#include "muscle.h"
#include <stdio.h>
int main(void)
{
    static muscle_state s[9];
    static muscle_real y[9][MUSCLE_OUTPUTS], one[MUSCLE_OUTPUTS];
    static muscle_jet jet[9], j;
    int n, k, quiet;
    double worst = 0;
    for (n = 0; n < 9; n++)
        for (k = 0; k < 9; k++)
            for (quiet = 0; quiet < 2; quiet++) {
                const muscle_state now = {(muscle_real)(0.02 * k), (muscle_real)(0.1 * k), (muscle_real)(2e5 + 3e4 * k),
                                          (muscle_real)(1e5 * k)};
                s[k] = now;
                y[k][0] = -1;
                muscle_predict_rows(n, s, y, quiet ? 0 : jet);
                muscle_predict(s + k, one, &j);
                if (k < n && !quiet) {
                    const double share = ((double)jet[k].V_eps - (double)j.V_eps) / (double)j.V_eps;
                    worst = share > worst ? share : -share > worst ? -share : worst;
                }
                if (k < n) {
                    const double share = ((double)y[k][0] - (double)one[0]) / 100.0;
                    worst = share > worst ? share : -share > worst ? -share : worst;
                } else if (!(y[k][0] == (muscle_real)-1))
                    return 1;
            }
    printf("%g\\n", worst);
    return 0;
}
"""


@needs_compiler
@pytest.mark.parametrize("flags", [["-O3"], ["-O2", "-DMUSCLE_ONE_VERSION"]], ids=["AVX2 where it is", "without AVX2"])
@pytest.mark.parametrize(("dtype", "tolerance"), [("float64", 1e-12), ("float32", 2e-5)])
def test_several_states_at_once_are_each_alone(models, dtype, tolerance, flags, tmp_path):
    """Widths of 20 and 12 are no whole blocks; n runs over whole and broken fours; what is not asked for stays."""
    export(models["anchored force"], tmp_path, dtype=dtype)
    (tmp_path / "rows.c").write_text(_ROWS)
    subprocess.run([COMPILER, *STRICT, *flags, "muscle.c", "rows.c", "-lm", "-o", "rows"], cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "rows"], capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert float(done.stdout) < tolerance
    assert "passed" in run_self_test(tmp_path, "muscle", *flags).stdout


@needs_compiler
def test_the_self_test_can_fail(models, tmp_path):
    export(models["anchored force"], tmp_path)
    tables = tmp_path / "muscle_parameters.h"
    text = tables.read_text()
    rest = next(line for line in text.splitlines() if "ANCHOR_REST_VOLUME" in line)
    tables.write_text(text.replace(rest, "#define ANCHOR_REST_VOLUME 7.0001e-5"))
    done = run_self_test(tmp_path)
    assert done.returncode == 1
    assert "V is" in done.stdout


_WILD = """
#include "muscle.h"
#include <stdio.h>
int main(void)
{
    double x[4];
    while (scanf("%lf %lf %lf %lf", x, x + 1, x + 2, x + 3) == 4) {
        const muscle_state s = {x[0], x[1], x[2], x[3]};
        muscle_jet jet;
        double y[MUSCLE_OUTPUTS];
        muscle_predict(&s, y, &jet);
        printf("%.17g %.17g %.17g %.17g\\n", y[0], jet.V, jet.V_eps, jet.V_P);
    }
    return 0;
}
"""


@needs_compiler
@pytest.mark.parametrize("case", ["anchored force", "neural force, tanh"])
def test_nan_stays_and_wild_inputs_agree(models, case, tmp_path):
    export(models[case], tmp_path)
    (tmp_path / "wild.c").write_text(_WILD)
    subprocess.run([COMPILER, *STRICT, "muscle.c", "wild.c", "-lm", "-o", "wild"], cwd=tmp_path, check=True)
    plan = plan_of(models[case])
    state = plan.centre.copy()
    rows = [state, *(np.where(np.arange(4) == k, value, state) for k in range(4) for value in (np.nan, 1e12, -1e12))]
    text = "\n".join(" ".join(repr(float(v)) for v in row) for row in rows)
    done = subprocess.run([tmp_path / "wild"], input=text, capture_output=True, text=True, check=True)
    found = np.array([[float(v) for v in line.split()] for line in done.stdout.splitlines()])
    rows = np.array(rows)
    with np.errstate(all="ignore"):
        expected = np.column_stack([plan.predict(rows)[:, 0], *plan.volume(rows)])
    missing = np.isnan(rows).any(axis=1)
    assert np.isnan(found[missing][:, 0]).all()
    same = ~missing & np.isfinite(expected).all(axis=1)
    assert same.sum() >= 7
    assert np.allclose(found[same], expected[same], rtol=1e-9, atol=1e-11 * np.abs(expected[0]).max())


@needs_compiler
def test_fast_math_is_refused(models, tmp_path):
    export(models["both"], tmp_path)
    command = [COMPILER, "-std=c99", "-ffast-math", "-c", "muscle.c"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "without -ffast-math" in done.stderr


@needs_compiler
def test_the_code_keeps_to_fixed_memory_and_its_own_names(models, tmp_path):
    export(models["both"], tmp_path, name="left_arm")
    subprocess.run([COMPILER, *STRICT, "-c", "left_arm.c", "-o", "code.o"], cwd=tmp_path, check=True)
    if shutil.which("nm") is None:
        pytest.skip("no nm on this machine")
    lines = subprocess.run(["nm", "code.o"], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    symbols = [line.split()[-2:] for line in lines.splitlines()]
    from_compiler = {"_GLOBAL_OFFSET_TABLE_", "memset", "memcpy", "__cpu_model", "__cpu_indicator_init"}
    assert {n for kind, n in symbols if kind == "U"} <= {"sqrt"} | from_compiler
    public = {n for kind, n in symbols if kind == "T"}
    assert public == {f"left_arm_{n}" for n in ("volume", "predict", "predict_rows", "force", "flow")}
    assert not [n for kind, n in symbols if kind in "dDbB"], "memory that changes"
    header = (tmp_path / "left_arm.h").read_text()
    for text in ("Pa, absolute", "m^3/Pa", "force (N)", "flow (kg/s)"):
        assert text in header


@needs_compiler
def test_the_reference_values_are_those_of_predict(models):
    model = models["both"]
    plan = plan_of(model)
    reference = reference_of(plan)
    assert np.allclose(reference.expected[:, :2], model.predict(reference.inputs), rtol=1e-13, atol=0)
    assert (reference.inputs[:, 2] == 101_325.0).any(), "ambient pressure, where the anchor is 0/0"
    assert (reference.inputs[:, 0] > model.input_scale_.mean[0] + 10 * model.input_scale_.spread[0]).any()


@needs_compiler
@pytest.mark.parametrize("to", ["c", "onnx"])
def test_effects_without_memory_come_along(models, to, tmp_path):
    plant = BenchParameters.for_muscle("B").plant()
    model = models["anchored flow, silu"]
    leak = make_effect("leakage", conductance=3e-10)
    stretch = make_effect("thread_extensibility")
    files = export(model, tmp_path, to, effects=[leak, stretch], plant=plant)
    plan = plan_of(model, effects=[leak, stretch], plant=plant)
    X = reference_of(plan).inputs
    assert np.max(np.abs(plan.predict(X)[:, 0] - model.predict(X))) > 1e-6
    if to == "c":
        assert run_self_test(tmp_path).returncode == 0
        assert "leakage" in (tmp_path / "muscle.h").read_text()
    else:
        runtime = pytest.importorskip("onnxruntime", reason="onnxruntime comes with pamid[export]")
        session = runtime.InferenceSession(str(files[0]), providers=["CPUExecutionProvider"])
        (flow,) = session.run(["flow"], {"X": X})
        assert np.allclose(flow, plan.predict(X), rtol=0, atol=1e-11 * np.abs(flow).max())


@needs_compiler
def test_a_volume_scaled_to_another_muscle_comes_along(models, tmp_path):
    fitted = models["both"]
    scaled = ScaledVolume(fitted.volume_, factor=1.3, dead_volume=2e-6)
    model = SimpleNamespace(laws=fitted.laws, volume_=scaled)
    export(model, tmp_path)
    assert run_self_test(tmp_path).returncode == 0
    (file,) = export(model, tmp_path, "onnx")
    runtime = pytest.importorskip("onnxruntime", reason="onnxruntime comes with pamid[export]")
    X = reference_of(plan_of(model)).inputs
    (V,) = runtime.InferenceSession(str(file), providers=["CPUExecutionProvider"]).run(["V"], {"X": X})
    assert np.allclose(V[:, 0], 1.3 * fitted.volume_.jet(State(*X.T)).V + 2e-6, rtol=1e-11)


@needs_compiler
def test_an_online_adapter_is_exported_as_it_stands(models, tmp_path):
    plant = BenchParameters.for_muscle("B").plant()
    X = signals(3000)
    y = 1.1 * models["anchored force"].predict(X.to_numpy()) - 20.0 * X["deps"]
    source = FrozenEstimator(models["anchored force"])
    online = OnlineAdapter(source, ["viscous_friction"], plant=plant, signals=dict(zip(X, range(4), strict=True)))
    online.fit(X.to_numpy(), y.to_numpy())
    assert online.values_[0] == pytest.approx(1.1, rel=1e-3)
    plan = plan_of(online)
    states = reference_of(plan).inputs
    assert np.allclose(plan.predict(states)[:, 0], online.predict(states), rtol=1e-9)
    assert any("at the time of the export" in note for note in plan.notes)
    export(online, tmp_path)
    assert run_self_test(tmp_path).returncode == 0
    remembers = OnlineAdapter(source, ["coulomb_friction"], plant=plant, signals=online.signals)
    with pytest.raises(ExportError, match="effect coulomb_friction remembers"):
        export(remembers.fit(X.to_numpy(), y.to_numpy()), tmp_path)


# --- ONNX ---------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("case", CASES)
def test_onnx_agrees_with_predict(models, case, dtype, tmp_path):
    runtime = pytest.importorskip("onnxruntime", reason="onnxruntime comes with pamid[export]")
    pytest.importorskip("onnx", reason="onnx comes with pamid[export]")
    (file,) = export(models[case], tmp_path, "onnx", dtype=dtype)
    session = runtime.InferenceSession(str(file), providers=["CPUExecutionProvider"])
    plan = plan_of(models[case])
    reference = reference_of(plan)
    found = np.column_stack(session.run(None, {"X": reference.inputs.astype(dtype)}))
    largest = np.abs(reference.expected).max(axis=0)
    assert (np.abs(found - reference.expected).max(axis=0) <= TOLERANCES[dtype] * largest).all()
    assert [o.name for o in session.get_outputs()] == [*(o.name for o in plan.outputs), "V", "V_eps", "V_P"]
    (one,) = session.run([plan.outputs[0].name], {"X": reference.inputs[:1].astype(dtype)})
    assert one.shape == (1, 1)


# --- FMU ----------------------------------------------------------------------------------------------------
@needs_compiler
@pytest.mark.parametrize("case", ["anchored force", "both"])
def test_the_fmu_simulates_as_predict_says(models, case, tmp_path):
    fmpy = pytest.importorskip("fmpy", reason="FMPy comes with pamid[export]")
    from fmpy.validation import validate_fmu

    model = models[case]
    (file,) = export(model, tmp_path, "fmu", name="arm")
    assert validate_fmu(str(file)) == []
    X = signals(60)
    inputs = np.empty(60, dtype=[("time", float), *((n, float) for n in X.columns)])
    inputs["time"] = np.arange(60) * 1e-3
    for name in X.columns:
        inputs[name] = X[name]
    outputs = [o.name for o in plan_of(model).outputs]
    done = fmpy.simulate_fmu(
        str(file), input=inputs, output=[*X.columns, *outputs, "V"], step_size=1e-3, stop_time=0.059
    )
    fed = np.column_stack([done[n] for n in X.columns])
    assert np.ptp(fed[:, 0]) > 0.1
    expected = model.predict(fed).reshape(len(fed), -1)
    for k, name in enumerate(outputs):
        assert np.allclose(done[name], expected[:, k], rtol=0, atol=1e-11 * np.abs(expected[:, k]).max())
    assert np.allclose(done["V"], plan_of(model).volume(fed)[0], rtol=1e-11)


def test_an_fmu_without_a_compiler_is_refused(models, tmp_path):
    with mock.patch("shutil.which", return_value=None), pytest.raises(ExportError, match="no C compiler"):
        export(models["anchored force"], tmp_path, "fmu")
    assert not list(tmp_path.iterdir())


# --- what cannot be exported ----------------------------------------------------------------------------------
def test_what_is_no_hybrid_model_is_named(tmp_path):
    X = signals(40).to_numpy()
    with pytest.raises(ExportError, match="RandomForestRegressor has no gas volume"):
        export(RandomForestRegressor(2).fit(X, X[:, 0]), tmp_path)
    remembers = PolynomialNARX(("P",), signals={"P": 2}, one_trajectory=True)
    with pytest.raises(ExportError, match="PolynomialNARX has no gas volume"):
        export(remembers.fit(X, targets(signals(40))[:, 0]), tmp_path)
    with pytest.raises(ExportError, match="A PolynomialForce is a formula, and an FMU"):
        export(PolynomialForce().fit(X[:, [0, 2]], targets(signals(40))[:, 0]), tmp_path, to="fmu")
    with pytest.raises(ExportError, match="not fitted"):
        export(StaticPIHM(), tmp_path)


def test_the_step_of_a_pipeline_is_named(models, tmp_path):
    model = models["anchored force"]
    with pytest.raises(ExportError, match="'standardscaler' \\(StandardScaler\\)"):
        export(make_pipeline(StandardScaler(), model), tmp_path)
    plan = plan_of(make_pipeline(RateTransformer(), model))
    assert any("Rates are inputs" in note for note in plan.notes)


def test_the_effect_is_named(models, tmp_path):
    model = models["anchored force"]
    plant = BenchParameters.for_muscle("B").plant()
    with pytest.raises(ExportError, match="effect hysteresis remembers"):
        export(model, tmp_path, effects=[make_effect("hysteresis")], plant=plant)
    with pytest.raises(ExportError, match="effect viscous_friction needs the numbers of the bench"):
        export(model, tmp_path, effects=[make_effect("viscous_friction")])
    with pytest.raises(ExportError, match="effect force_bias changes more than a prediction"):
        export(model, tmp_path, effects=[make_effect("force_bias")], plant=plant)


class _Odd(QuasiStaticForce):
    def coefficients(self, state):
        return Coefficients(np.sort(state.P), state.P, state.P)


class _Branch(QuasiStaticForce):
    def coefficients(self, state):
        return Coefficients(0.0, state.P if state.P > 1e5 else 0.0, 0.0)


@pytest.mark.parametrize(("law", "why"), [(_Odd(0.2), "numpy.sort"), (_Branch(0.2), "decides by the value")])
def test_a_law_that_cannot_be_written_is_named(models, law, why, tmp_path):
    volume = models["anchored force"].volume_
    model = SimpleNamespace(laws=lambda: (law,), volume_=volume)
    with pytest.raises(ExportError, match=f"force law {type(law).__name__} .*{why}"):
        export(model, tmp_path)


def test_options_and_names_are_checked(models, tmp_path):
    for bad, error in (
        ({"to": "rust"}, UnknownOptionError),
        ({"dtype": "float16"}, UnknownOptionError),
        ({"name": "my muscle"}, ExportError),
        ({"name": "3d"}, ExportError),
    ):
        with pytest.raises(error):
            export(models["both"], tmp_path, **bad)


def test_a_full_disk_leaves_no_half_file(models, tmp_path):
    full = mock.patch("os.fsync", side_effect=OSError(28, "No space left on device"))
    with full, pytest.raises(OutputError, match="No space left"):
        export(models["both"], tmp_path)
    assert not list(tmp_path.iterdir())


def test_formulas_are_recorded_as_they_are():
    x = symbol("x")
    assert (0.0 * x + 1.0 * x - 0.0) is x
    ratio = flow_function(101_325.0 / x, 0.3)
    assert {"sqrt", "min", "max"} <= {s.op for s in _nodes(ratio)}


def _nodes(root):
    from pamid.export.expression import in_order

    return in_order([root])


# --- command ------------------------------------------------------------------------------------------------
def test_the_command(models, tmp_path, capsys):
    model = save(models["both"], tmp_path / "both.pamid")
    out = tmp_path / "code"
    assert main(["export", str(model), "--out", str(out), "--name", "arm", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["outputs"] == {"force": "N", "flow": "kg/s"}
    assert sorted(Path(f).name for f in report["files"]) == ["arm.c", "arm.h", "arm_parameters.h", "arm_selftest.c"]
    assert main(["export", str(model), "--to", "c", "--out", str(out), "--effect", "hysteresis"]) == 2
    assert "hysteresis remembers" in capsys.readouterr().err
