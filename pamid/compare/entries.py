"""What takes part in a comparison: every estimator that says it can learn the equation, in the settings it names."""

import fnmatch
import inspect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from ..errors import IncompatibleError, ParameterError, UnknownOptionError, among
from ..explained import explained_fields
from ..requirements import is_sequential, reads_of

EQUATIONS = {"force": ("F", "N"), "flow": ("mdot", "kg/s")}
"""Equations that can be compared: column and unit of their measured side."""

PROBLEMS = (*EQUATIONS, "inverse", "dynamic")
"""What can be compared: an equation, the pressure for a force and contraction, an output in free run."""

OUTPUTS = {"eps": ("-", ("P", "load")), "P": ("Pa", ("u", "eps", "deps"))}
"""Outputs of the dynamic problem: unit, and what drives them."""

START = "initial"
"""Column of the dynamic problem: the output measured in the first row of the run."""

SIGNALS = ("eps", "deps", "P", "dP")
"""Columns that an estimator is offered which does not say what it reads."""


@explained_fields
@dataclass(frozen=True)
class CandidateModel:
    """One estimator in one setting.

    Examples
    --------
    >>> from pamid.compare.entries import CandidateModel
    >>> from pamid.estimators import GeometricForce
    >>> CandidateModel("Chou", GeometricForce(), columns=("eps", "P"), targets=("F",)).label
    'Chou'
    """

    label: Annotated[str, 'Name in tables, such as ``"GeometricForce(tondu_lopez)"``.']
    estimator: Annotated[Any, "Unfitted instance."]
    columns: Annotated[tuple[str, ...], "Columns of the table that it is given."]
    targets: Annotated[tuple[str, ...], "Columns of its target."]
    sequential: Annotated[bool, "Whether it learns from the sequence of samples, and must see them evenly spaced."] = (
        False
    )


def candidates(
    equation: str,
    estimators: str | Sequence[str] | Mapping[str, Any] = "all",
    *,
    parameters: Mapping[str, Any] | None = None,
    targets: Sequence[str] | None = None,
    random_state: int = 0,
    output: str = "eps",
) -> list[CandidateModel]:
    """Collect what can learn an equation, the inverse, or an output in free run.

    An estimator of `pamid.estimators` takes part if its class attribute ``equations`` names the equation; a new one
    takes part without an entry anywhere.

    Parameters
    ----------
    equation : {"force", "flow", "inverse", "dynamic"}
        The equation or problem.
    estimators : "all", sequence of str, or mapping of str to estimator, default="all"
        Labels (``"StaticPIHM"``, ``"GeometricForce(tondu_lopez)"``), classes (``"GeometricForce"``, with all its
        settings) or patterns (``"StaticPIHM*"``); or estimators of your own by label. Those read the columns ``eps``,
        ``deps``, ``P``, ``dP``.
    parameters : mapping of str to float, optional
        Values for parameters of this name in any constructor: ``rest_length`` (m), ``rest_diameter`` (m),
        ``braid_angle`` (rad), ``atmospheric_pressure`` (Pa), ...; ``BenchParameters.values()`` will do. With ambient
        pressure and ``supply_pressure`` (Pa) inverse models answer between the two, else within those of their fit.
    targets : sequence of str, optional
        Measured columns at hand; an estimator that learns force and flow together takes part only if both are
        measured. By default that of the equation alone.
    random_state : int, default=0
        Seed of every estimator that takes one.
    output : {"eps", "P"}, default="eps"
        Output of the dynamic problem.

    Returns
    -------
    list of CandidateModel
        In alphabetical order of the classes.

    Raises
    ------
    UnknownOptionError
        If a name is not known.
    IncompatibleError
        If a named estimator does not learn this equation.

    Examples
    --------
    >>> from pamid.compare import candidates
    >>> [c.label for c in candidates("flow", ["PolynomialFlow"])]
    ['PolynomialFlow(contraction)', 'PolynomialFlow(contraction, pressure)']
    """
    column = target_of(equation, output)[0]
    driven = (*OUTPUTS[output][1], START) if equation == "dynamic" else SIGNALS
    offered_columns = ("F", "eps", "deps") if equation == "inverse" else driven
    if isinstance(estimators, Mapping):
        return [_own(label, model, column, offered_columns) for label, model in estimators.items()]
    measured = tuple(targets or (column,))
    shared = {"random_state": random_state, **(parameters or {})}
    run: dict[str, Any] = {"inputs": OUTPUTS[output][1], "start": START} if equation == "dynamic" else {}
    if equation == "inverse" and {"atmospheric_pressure", "supply_pressure"} <= shared.keys():
        # the range of a fit is no limit to a pressure that the supply can give
        run["pressure_limits"] = (shared["atmospheric_pressure"], shared["supply_pressure"])
    found = _registered(equation, column, measured, shared, run)
    if isinstance(estimators, str):
        if estimators != "all":
            raise ParameterError(
                f"estimators is {estimators!r}.", "'all' or a list of names", f"Pass [{estimators!r}]."
            )
        return [c for group in found.values() for c in group]
    chosen: list[CandidateModel] = []
    for name in estimators:
        offered = [c for group in found.values() for c in group]
        matches = [c for c in offered if c.label == name]  # one setting first, then all of a class, then a pattern
        matches = matches or found.get(name) or [c for c in offered if fnmatch.fnmatchcase(c.label, name)]
        if not matches:
            raise _not_offered(name, equation, found)
        chosen += [c for c in matches if c not in chosen]
    return chosen


def target_of(equation: str, output: str = "eps") -> tuple[str, str]:
    """Return column and unit of the predicted target."""
    if equation == "inverse":
        return "P", "Pa"
    if equation == "dynamic":
        if output not in OUTPUTS:
            raise UnknownOptionError(f"output is {output!r}.", f"one of {', '.join(OUTPUTS)}", "Correct the name.")
        return output, OUTPUTS[output][0]
    if equation not in EQUATIONS:
        raise UnknownOptionError(f"equation is {equation!r}.", f"one of {', '.join(PROBLEMS)}", "Correct the name.")
    return EQUATIONS[equation]


def _registered(
    equation: str, column: str, measured: Sequence[str], shared: Mapping[str, Any], run: Mapping[str, Any]
) -> dict[str, list[CandidateModel]]:
    from pamid.estimators import all_estimators

    found: dict[str, list[CandidateModel]] = {}
    for name, cls in all_estimators():
        offered: Any = cls
        equations = getattr(offered, "equations", ())
        if equation not in equations or (equation == "dynamic" and column not in offered.outputs):
            continue
        wanted = tuple(EQUATIONS[e][0] for e in equations) if offered.joint else (column,)
        if any(w not in measured for w in wanted):
            continue
        accepted = inspect.signature(offered).parameters
        common = {k: v for k, v in {**shared, **run}.items() if k in accepted}
        group = []
        for setting, own in offered.settings(equation).items():
            model = offered(**(common | own))
            inner = {f"model__{k}": v for k, v in shared.items() if f"model__{k}" in model.get_params()}
            model.set_params(**inner)  # what is built around another estimator hands its geometry on
            group.append(_candidate(f"{name}({setting})" if setting else name, model, wanted))
        found[name] = group
    return found


def _candidate(label: str, model: Any, targets: tuple[str, ...]) -> CandidateModel:
    sequential = is_sequential(model)
    columns = reads_of(model)
    return CandidateModel(label, model, ("trajectory", *columns) if sequential else columns, targets, sequential)


def _own(label: str, model: Any, column: str, columns: tuple[str, ...] = SIGNALS) -> CandidateModel:
    if not (hasattr(model, "fit") and hasattr(model, "predict")):
        raise IncompatibleError(
            f"{label} is a {type(model).__name__}.", "an estimator with fit and predict", "Pass an instance of one."
        )
    if reads_of(model):
        return _candidate(label, model, (column,))
    return CandidateModel(label, model, columns, (column,))


def _not_offered(name: str, equation: str, found: Mapping[str, list[CandidateModel]]) -> Exception:
    from pamid.estimators import all_estimators

    labels = [*found, *(c.label for group in found.values() for c in group)]
    if name in (others := {n: getattr(c, "equations", ()) for n, c in all_estimators()}):
        learns = " and ".join(others[name]) or "none of the problems"
        together = " together, and the log has not both" if equation in others[name] else ""
        return IncompatibleError(
            f"{name} learns {learns}{together}.", f"an estimator of {equation}", f"Choose among {', '.join(found)}."
        )
    return UnknownOptionError(f"There is no estimator {name!r}.", *among(name, labels if "(" in name else found))
