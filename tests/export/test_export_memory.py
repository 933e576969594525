"""An exported model with effects remembers as the model does: in C, in ONNX, as an FMU; what looks ahead is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import JointPIHM, StaticPIHM, ThermodynamicPIHM

from pamid.effects import all_effects
from pamid.effects.plant import Plant
from pamid.errors import ExportError
from pamid.export import export
from pamid.export.memory import Tracer
from pamid.export.plan import STEP, plan_of
from pamid.export.reference import TOLERANCES, reference_of

from .test_export import needs_compiler, run_self_test, targets

COLUMNS = ["trajectory", "time", "eps", "deps", "P", "dP"]
CASES = {
    "force": (StaticPIHM, ["tube", "pressure_hysteresis", "pressure_relaxation", "coulomb_friction"], {}),
    "force, forms": (StaticPIHM, ["hysteresis", "pressure_gain", "stribeck_friction"], {"volume_model": "neural"}),
    "flow": (ThermodynamicPIHM, ["heat_transfer", "pressure_bias", "leakage"], {}),
    "flow, thin contact": (ThermodynamicPIHM, ["pressure_bias"], {}),
    "both": (JointPIHM, ["tube", "backlash", "heat_transfer", "creep"], {}),
}


def path(n: int = 80) -> pd.DataFrame:
    t = 0.02 * np.arange(n)
    moved = {"eps": 0.11 + 0.05 * np.sin(4 * t), "deps": 0.2 * np.cos(4 * t)}
    return pd.DataFrame(
        {"trajectory": 0, "time": t, **moved, "P": 3e5 + 1e5 * np.sin(7 * t), "dP": 7e5 * np.cos(7 * t)}
    )


@pytest.fixture(scope="module")
def models() -> dict[str, object]:
    X = path()
    Y, found = targets(X), {}
    for name, (kind, effects, params) in CASES.items():
        y = {StaticPIHM: Y[:, 0], ThermodynamicPIHM: Y[:, 1], JointPIHM: Y}[kind]
        model = kind(0.2, 0.02, effects=effects, hidden_layer_sizes=(6,), max_iter=3, random_state=0, **params)
        found[name] = model.fit(X[COLUMNS], y)
    return found


# Single precision keeps its digits where terms do not cancel. The hysteresis of "force", fitted to a target without
# any, takes terms of thousands of N that do; by how much depends on the machine.
SINGLE = ("force, forms", "flow, thin contact")


@needs_compiler
@pytest.mark.parametrize(("case", "dtype"), [*((c, "float64") for c in CASES), *((c, "float32") for c in SINGLE)])
def test_c_remembers_as_predict_does(models, case, dtype, tmp_path):
    export(models[case], tmp_path, "c", dtype=dtype)
    done = run_self_test(tmp_path)
    assert done.returncode == 0, done.stdout
    assert "passed, 64 rows" in done.stdout


@needs_compiler
def test_the_self_test_hears_of_a_memory_that_is_lost(models, tmp_path):
    export(models["force"], tmp_path)
    source = tmp_path / "muscle_selftest.c"
    text = source.read_text()
    assert "if (row)" in text
    source.write_text(text.replace("if (row)", "if (row % 2)"))
    assert run_self_test(tmp_path).returncode == 1


@pytest.mark.parametrize("case", ["force", "both"])
def test_onnx_hands_its_memory_on(models, case, tmp_path):
    runtime = pytest.importorskip("onnxruntime", reason="onnxruntime comes with pamid[export]")
    pytest.importorskip("onnx", reason="onnx comes with pamid[export]")
    files = export(models[case], tmp_path, "onnx")
    assert [f.name for f in files] == ["muscle_begin.onnx", "muscle.onnx"]
    begin, follow = (runtime.InferenceSession(str(f), providers=["CPUExecutionProvider"]) for f in files)
    reference = reference_of(plan_of(models[case]))
    twice = np.repeat(reference.inputs[:, None], 2, axis=1)  # two muscles at once
    *first, memory = begin.run(None, {"X": twice[0]})
    rows = [np.column_stack(first)]
    for x in twice[1:]:
        *now, memory = follow.run(None, {"X": x, "memory": memory, "dt": np.array([STEP])})
        rows.append(np.column_stack(now))
    limit = TOLERANCES["float64"] * np.abs(reference.expected).max(axis=0)
    for k in range(2):
        assert (np.abs(np.array(rows)[:, k] - reference.expected).max(axis=0) <= limit).all()


@needs_compiler
def test_the_fmu_takes_each_step_as_a_reading(models, tmp_path):
    fmpy = pytest.importorskip("fmpy", reason="FMPy comes with pamid[export]")
    from fmpy.validation import validate_fmu

    (file,) = export(models["both"], tmp_path, "fmu", name="arm")
    assert validate_fmu(str(file)) == []
    reference = reference_of(plan_of(models["both"]))
    inputs = np.empty(64, dtype=[("time", float), *((n, float) for n in COLUMNS[2:])])
    inputs["time"] = STEP * np.arange(64)
    for name, values in zip(COLUMNS[2:], reference.inputs.T, strict=True):
        inputs[name] = values
    outputs = ["force", "flow", "V"]
    done = fmpy.simulate_fmu(
        str(file), input=inputs, output=outputs, step_size=STEP, output_interval=STEP, stop_time=63 * STEP
    )
    for k, name in enumerate(outputs):
        expected = reference.expected[:63, k]
        assert np.allclose(done[name][1:], expected, rtol=0, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize(
    "name", [n for n, e in all_effects().items() if e.n_states and {"force", "flow"} & {*e.hooks()}]
)
def test_every_memory_of_the_library_can_be_written(name):
    effect, plant = all_effects()[name](), Plant.of_muscle(0.2, 0.02)
    equations = [e for e in ("force", "flow") if e in effect.hooks()]
    memory = Tracer([effect], equations, plant).memory()
    assert len(memory.begin) == len(memory.follow) == 4 + effect.n_states


@pytest.mark.parametrize("name", ["tube", "pressure_gain", "pressure_bias"])
def test_a_step_of_restoring_is_restoring(name):
    effect, dt = all_effects()[name](), 0.01
    reading = 3e5 + 1e5 * np.sin(0.3 * np.arange(50))
    whole = effect.restore(reading, dt, np.array([0]))
    stepped = [effect.restore_next(reading[0], reading[0], dt)]
    for value in reading[1:]:
        stepped.append(effect.restore_next(stepped[-1], value, dt))
    np.testing.assert_allclose(stepped, whole, rtol=1e-12)


def test_what_looks_ahead_and_what_is_added_besides_are_named(models, tmp_path):
    ahead = all_effects()["pressure_lag"]()
    with pytest.raises(ExportError, match="pressure_lag is undone with the readings before and after"):
        Tracer([ahead], ["force"], Plant.of_muscle(0.2, 0.02))
    leak = all_effects()["leakage"]()
    with pytest.raises(ExportError, match="effects of its own"):
        export(models["force"], tmp_path, effects=[leak], plant=Plant.of_muscle(0.2, 0.02))
    with pytest.raises(ExportError, match="float64"):
        export(models["both"], tmp_path, dtype="float32")
    assert not list(Path(tmp_path).iterdir())
