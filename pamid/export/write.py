"""Export a fitted model to a folder: C99, ONNX or an FMU."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..effects.base import Effect
from ..effects.plant import Plant
from ..errors import ExportError
from ..file_sets import replacing_together
from ..files import write_whole
from ..names import require_one_of
from .c_source import REALS, c_sources
from .formula import FormulaPlan, formula_of, formula_sources
from .plan import ExportPlan, check_name, last_step, plan_of
from .reference import reference_of

TARGETS = ("c", "onnx", "fmu")
"""What a model can be exported to."""


def export(
    model: Any,
    folder: str | Path,
    to: str = "c",
    *,
    name: str = "muscle",
    dtype: str = "float64",
    effects: Sequence[Effect] = (),
    plant: Plant | None = None,
) -> list[Path]:
    """Write a fitted model in another language.

    Parameters
    ----------
    model : estimator or Pipeline
        A fitted hybrid model, its effects with it, or one that is a formula of its signals: `GeometricForce`,
        `GeometricFlow`, `PolynomialForce`, `PolynomialFlow`, `SINDyRegressor`, `LawRegressor`, `StaticForceMap`,
        `NonlinearElastic`, `HosovskyHybrid`, `ThreeElement`, `ResidualHybrid`, `InverseModel`, `ForwardModel`; also as
        the last step of a pipeline with rates.
    folder : path-like
        Where to write; made if it does not exist.
    to : {"c", "onnx", "fmu"}, default="c"
        Dependency-free C99 with a self-test, an ONNX graph, or an FMU (FMI 3.0) built from the C code.
    name : str, default="muscle"
        Name of the files and prefix of all names in the code, a C identifier.
    dtype : {"float64", "float32"}, default="float64"
        Floating type of the exported model. Reference values of the self-test hold to 1e-11 of the largest value of
        each output with float64, to 2e-5 with float32.
    effects : sequence of Effect, optional
        Effects without memory that are added to the predictions of a model that has none of its own, such as leakage
        or viscous friction.
    plant : Plant, optional
        The bench that the effects refer to, ``BenchParameters.plant()``.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    ExportError
        A part of the model has no form outside Python; the message names the part and why.
    OutputError
        A file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from pamid.estimators import StaticPIHM
    >>> from pamid.export import export
    >>> X = np.random.default_rng(0).uniform([0, -1, 2e5, -1e6], [0.2, 1, 5e5, 1e6], (60, 4))
    >>> F = (X[:, 2] - 101325) * 5e-4 * (1 - 3 * X[:, 0])
    >>> model = StaticPIHM(hidden_layer_sizes=(4,), max_iter=5, random_state=0).fit(X, F)
    >>> [file.name for file in export(model, tempfile.mkdtemp(), name="force")]
    ['force.h', 'force.c', 'force_selftest.c', 'force_parameters.h']
    """
    require_one_of(to, TARGETS, f"to={to!r} is not known.", "Choose one of them.")
    require_one_of(dtype, REALS, f"dtype={dtype!r} is not known.", "Choose one of them.")
    plan = any_plan_of(model, name, effects, plant)
    finest = plan.memory.finest if isinstance(plan, ExportPlan) and plan.memory else None
    if finest and finest.least_difference < (step := float(np.finfo(dtype).eps)):
        raise ExportError(
            f"The effect {finest.name} distinguishes what differs by {finest.least_difference:g} of its size, and "
            f"{dtype} resolves {step:.1g}.",
            "a finer floating type",
            "Pass --dtype float64.",
        )
    files = _formula_files(plan, to, dtype) if isinstance(plan, FormulaPlan) else _hybrid_files(plan, to, dtype)
    target = Path(folder)
    with replacing_together(target, files, parents=True) as stage:
        for file, content in files.items():
            write_whole(stage / file, content)
    return [target / file for file in files]


def any_plan_of(
    model: Any, name: str = "muscle", effects: Sequence[Effect] = (), plant: Plant | None = None
) -> ExportPlan | FormulaPlan:
    """Take a fitted model apart, a formula or a hybrid model; parameters as in `export`."""
    check_name(name)
    last, notes = last_step(model)
    plan = None if effects else formula_of(last, name, tuple(notes))
    return plan or plan_of(model, name, effects, plant)


def _hybrid_files(plan: ExportPlan, to: str, dtype: str) -> dict[str, str | bytes]:
    if to == "onnx":
        from .onnx_graph import onnx_memory, onnx_model

        models = {"": onnx_model(plan, dtype)} if plan.memory is None else onnx_memory(plan, dtype)
        return {f"{plan.name}{end}.onnx": model.SerializeToString() for end, model in models.items()}
    sources = c_sources(plan, reference_of(plan), dtype)
    if to == "c":
        return dict(sources)
    from .fmu import fmu

    return {f"{plan.name}.fmu": fmu(plan, sources)}


def _formula_files(plan: FormulaPlan, to: str, dtype: str) -> dict[str, str | bytes]:
    if to == "fmu":
        raise ExportError(
            f"A {plan.estimator} is a formula, and an FMU is made of hybrid models alone.", "c or onnx", "Pass --to c."
        )
    if to == "c":
        return dict(formula_sources(plan, dtype))
    from .onnx_graph import onnx_formula

    return {f"{plan.name}.onnx": onnx_formula(plan, dtype).SerializeToString()}


__all__ = ["TARGETS", "ExportError", "export"]
