"""A second opinion: which fitted numbers hold, which took up physics that is missing, which this log cannot tell."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd

from ..explained import explained_by, explained_fields
from ..gap.diagnosis.result import Diagnosis
from ..gap.several.logs import diagnose
from ..signals.frames import as_pandas
from ..simulators import Simulator
from .estimates import Open, estimates, freed
from .fits import FittedNumber, FittedParameters, read_fit

LEVEL = 0.01
"""Probability of reporting, over all numbers of a fit, that one moved when it did so by chance."""
CERTAIN = 1e-6
"""Probability below which its size means nothing: noise is not so exactly normal."""
NEGLIGIBLE = 0.01
"""Negligible relative change: the difference between time steps and integrators."""
ENDLESS = 3.0
"""Relative error above which a combination of numbers has no effect on a log."""
MOST = 0.5
"""Share of the gap that causes must close on held-out runs, for a number to have absorbed them."""
POSITIVE = ("body_mass.", "dof_armature.", "dof_damping.", "dof_frictionloss.", "jnt_stiffness.")
"""Numbers that cannot be negative."""


@explained_fields
@dataclass(frozen=True)
class Judgement:
    """The verdict on one fitted number.

    Examples
    --------
    >>> from pamid.opinion import Judgement
    >>> Judgement("damping", "absorbed", 4.4, 3.0, (2.95, 3.05), "N m s/rad", "4.4 as fitted").status
    'absorbed'
    """

    name: Annotated[str, "Its name in the simulator."]
    status: Annotated[
        str,
        '``"holds"``, ``"absorbed"`` (it took up missing physics), ``"open"`` (this log does not determine it), '
        '``"off"`` (the log gives another value, without a cause) or ``"not tested"``.',
    ]
    fitted: Annotated[float, "As the tool fitted it."]
    value: Annotated[float, "As this log gives it once the missing effects are added."]
    ci90: Annotated[tuple[float, float], "Its 90 % interval; infinite where the log does not determine it."]
    unit: Annotated[str, "Its unit."] = "-"
    why: Annotated[str, "Reason for the status."] = ""


@explained_fields
@dataclass(frozen=True)
class Opinion:
    """The second opinion on a fit.

    ranges : dict of str to (float, float)
        Range of each signal of the log.

    Examples
    --------
    >>> from pamid.opinion import Opinion, second_opinion  # whose example makes one
    >>> Opinion.absorbed.__doc__
    'Names of the numbers that took up missing physics.'
    """

    numbers: Annotated[list[Judgement], "One for each fitted number."]
    missing: Annotated[list[str], "Effects that the simulator lacks, with the port: what was absorbed."]
    flat: Annotated[list[Open], "Combinations that this log leaves open."]
    diagnosis: Annotated[Diagnosis, "What the log says with the fitted numbers free to move."]
    next_run: Annotated[str, "What another run would have to do; empty where none is needed."]
    agreement: Annotated[
        float, "Probability that the numbers differ as much between runs by chance; NaN of a single run."
    ]
    unmatched: Annotated[tuple[str, ...], "Fitted numbers without a counterpart in the simulator."] = ()
    source: Annotated[str, "Where the fit comes from."] = ""
    ranges: Annotated[dict[str, tuple[float, float]], "Range of each signal of the log."] = field(default_factory=dict)

    @property
    def absorbed(self) -> list[str]:
        """Names of the numbers that took up missing physics."""
        return [j.name for j in self.numbers if j.status == "absorbed"]

    def sentences(self) -> list[str]:
        """Return it in sentences, the most important first."""
        words = {"absorbed": "absorbed the missing physics", "off": "is off"}
        said = [f"{j.name} {words[j.status]}: {j.why}." for j in self.numbers if j.status in words]
        if self.missing and _closes(self.diagnosis):
            said.append(f"Missing in the simulator: {', '.join(self.missing)}.")
        elif self.missing:
            said.append(f"{', '.join(self.missing)} would explain the rest, but closes no gap on held-out runs.")
        elif self.diagnosis.gap:
            said.append("Something is missing in the simulator that the library does not hold.")
        else:
            said.append("Nothing is missing in the simulator that this log shows.")
        said += [f"This log does not determine {direction}." for direction in self.flat]
        if holds := [j.name for j in self.numbers if j.status == "holds"]:
            said.append(f"Hold on this log: {', '.join(holds)}.")
        if self.unmatched:
            said.append(f"Not tested, since the simulator has no such number: {', '.join(self.unmatched)}.")
        if self.agreement < LEVEL:
            chance = f"= {self.agreement:.1g}" if self.agreement >= CERTAIN else f"< {CERTAIN:g}"
            said.append(f"Runs of this log disagree about the numbers (p {chance}).")
        said.append(f"Another run is needed: {self.next_run}" if self.next_run else "No further run is needed.")
        return said

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain numbers and text."""
        return {
            "source": self.source,
            "numbers": [vars(j) for j in self.numbers],
            "missing": self.missing,
            "flat": [{"weights": f.weights, "spread": f.spread} for f in self.flat],
            "next_run": self.next_run,
            "agreement": None if np.isnan(self.agreement) else self.agreement,
            "unmatched": list(self.unmatched),
            "sentences": self.sentences(),
        }


@explained_by(diagnose)
def second_opinion(
    log: pd.DataFrame,
    simulator: Simulator,
    after: str | Path | Mapping[str, Any] | FittedParameters | Sequence[str | Path],
    effects: str | Sequence[str] = "all",
    *,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Opinion:
    """Say which of a tool's fitted parameters hold, which absorbed missing physics, and which the log leaves open.

    A cause counts against a number only where it closes most of the gap on held-out runs.
    The log is diagnosed with each number within the tolerance that the simulator's simulator file states, or free to
    move about the fitted value where it states none. A number absorbed missing physics if it moves by more than its
    error once the cause is added, if it left its tolerance, or if it is unphysical. Directions that the log does not
    fix are reported as combinations.

    Parameters
    ----------
    log : DataFrame
        ``trajectory``, ``time`` (s) and the columns that the simulator's ports name.
    simulator : Simulator
        The simulator as it was before the fit; its tolerances are what is known of its numbers.
    after : path-like, mapping, FittedParameters or sequence of path-like
        What the tool fitted, see `read_fit`; several files are several fits, which are compared.
    effects : "all" or sequence of str, default="all"
        Effects that may be missing.

    Returns
    -------
    Opinion
        The answer.

    Raises
    ------
    ParameterError
        The fit names no number of the simulator.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.opinion import second_opinion
    >>> from pamid.simulators import FunctionSimulator, Port
    >>> rng, runs = np.random.default_rng(0), []
    >>> for k in range(4):  # a mass of 2 kg on a rail with 3 N s/m, and 1.5 N of dry friction that is not modelled
    ...     t, x, v = np.arange(0, 8, 0.01), [0.0], [0.0]
    ...     F = 5 * np.sin((1 + k) * t) + 3 * np.sin(0.7 * t)
    ...     for f in F[:-1]:
    ...         v.append(v[-1] + 0.01 * (f - 3 * v[-1] - 1.5 * np.tanh(v[-1] / 0.01)) / 2)
    ...         x.append(x[-1] + 0.005 * (v[-1] + v[-2]))
    ...     noisy = {"x": x + 1e-5 * rng.standard_normal(800), "v": v + 1e-3 * rng.standard_normal(800)}
    ...     runs.append(pd.DataFrame({"trajectory": str(k), "time": t, "F": F, **noisy}))
    >>> ports = [Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]
    >>> rate = lambda t, x, u, p: [x.v, (u.F - p.c * x.v) / p.m]
    >>> rail = FunctionSimulator(rate, ports, {"m": (2.0, 0.05, "kg"), "c": (3.0, 0.0, "N s/m")})
    >>> said = second_opinion(pd.concat(runs), rail, {"m": 2.02, "c": 4.4}, ["coulomb_friction", "actuator_gain"])
    >>> "c" in said.absorbed, said.missing
    (True, ['coulomb_friction@x'])
    """
    from scipy.stats import norm

    say, log = progress or (lambda _: None), as_pandas(log)
    several = not isinstance(after, str | Path | Mapping | FittedParameters)
    given: list[Any] = list(after) if several else [after]  # type: ignore[arg-type]
    fits = [read_fit(a).of(simulator) for a in given]
    fit = fits[0]
    known = simulator.fit_numbers()
    values = {n: v.value for n, v in fit.numbers.items()}
    # A number is known as the simulator file states; the others may be anything around the fitted value.
    stated = {n for n in values if known[n].tolerance > 0.0 and known[n].value != 0.0}
    begun = simulator if fit.model is None else simulator.as_fitted(fit.model, stated)
    fitted = freed(begun, {n: v for n, v in values.items() if n not in stated})
    found = diagnose(log, fitted, effects, seed=seed, progress=say)
    say("errors and directions")
    about = found.corrected if found.corrected is not None else _moved(fitted, found)
    est = estimates(log, about, list(values))
    place = {n: k for k, n in enumerate(est.names)}
    z = float(norm.isf(0.5 * LEVEL / max(len(values), 1)))
    judged = []
    for name, number in fit.numbers.items():
        unit = about.parameters[name].unit
        if name not in place:
            why = "it is zero" if number.value == 0.0 else "the log says nothing about it"
            status = "absorbed" if _closes(found) and _collapsed(number, known[name].value) else "not tested"
            judged.append(Judgement(name, status, number.value, number.value, (-np.inf, np.inf), unit, why))
            continue
        k = place[name]
        # The result of the diagnosis, under its robust likelihood; the errors are those of the step from there.
        errors = float(est.errors[k]), float(est.alone[k])
        judged.append(_judged(name, number, about, errors, z, found, known[name], unit))
    judged = [_between(j, [f.numbers[j.name].value for f in fits if j.name in f.numbers], found) for j in judged]
    open_names = {n for direction in est.flat for n, w in direction.weights.items() if abs(w) > 0.3}
    judged = [_opened(j) if j.name in open_names and j.status in ("holds", "off") else j for j in judged]
    missing = [f"{c.effects[0]}@{c.where[0]}" if c.where else c.effects[0] for c in found.causes]
    numeric = [p.source for p in fitted.ports if p.source in log.columns]
    ranges = {c: (float(log[c].min()), float(log[c].max())) for c in dict.fromkeys(numeric)}
    return Opinion(
        judged, missing, est.flat, found, _next(found, est.flat), est.agreement, fit.unmatched, fit.source, ranges
    )


def _moved(fitted: Simulator, found: Diagnosis) -> Simulator:
    """Return the simulator where the log has it without a cause."""
    moved = {n: x for n, x in found.deviations.items() if n in fitted.tolerance}
    return fitted.with_({n: fitted.get(n) * (1.0 + fitted.tolerance[n] * x) for n, x in moved.items()})


def _closes(found: Diagnosis) -> bool:
    """Return whether the missing physics closes most of the gap on held-out runs."""
    shares = {e.equation: e.share for e in found.equations}
    closed = sum(shares.get(c.equation, 0.0) * c.closed_share for c in found.closure)
    return bool(found.gap and found.added and closed > MOST * sum(shares.values()))


def _collapsed(number: FittedNumber, nominal: float) -> bool:
    return nominal > 0.0 and abs(number.value) < NEGLIGIBLE * nominal


def _judged(
    name: str,
    number: FittedNumber,
    about: Simulator,
    errors: tuple[float, float],
    z: float,
    found: Diagnosis,
    nominal: Any,
    unit: str,
) -> Judgement:
    value, (error, alone) = about.get(name), errors
    ci = (value - 1.645 * error, value + 1.645 * error)
    moved = abs(value - number.value) > z * error + NEGLIGIBLE * abs(number.value)
    causes = ", ".join(c.effects[0] for c in found.added) or "a cause outside the library"
    why, status = f"{number.value:.4g} as fitted, {value:.4g} ± {1.645 * error:.2g} {unit} here", "holds"
    off = abs(number.value - nominal.value) / abs(nominal.value) if nominal.value else 0.0
    slack = z * alone / abs(nominal.value) if nominal.value else 0.0
    if number.value < 0.0 and (name.startswith(POSITIVE) or about.plausible(name)[0] >= 0.0):
        status, why = "absorbed", f"it is {number.value:.4g} {unit}, and cannot be negative"
    elif nominal.tolerance > 0.0 and off > nominal.tolerance + slack + NEGLIGIBLE:
        status = "absorbed"
        known = f"{nominal.value:.4g}, known to {100 * nominal.tolerance:.0f} %"
        why = f"{number.value:.4g} {unit} is {100 * off:.0f} % off {known}"
    elif _closes(found) and _collapsed(number, nominal.value):
        status, why = "absorbed", f"it fell from {nominal.value:.4g} to {number.value:.2g} {unit}"
    elif moved and found.added and _closes(found):
        status, why = (
            "absorbed",
            f"{number.value:.4g} as fitted, {value:.4g} ± {1.645 * error:.2g} {unit} with {causes}",
        )
    elif moved:
        status = "off"
    return Judgement(name, status, number.value, value, ci, unit, why)


def _between(j: Judgement, values: Sequence[float], found: Diagnosis) -> Judgement:
    """Return a judgement with what several fits of the tool say of the number."""
    if len(values) < 2:
        return j
    spread, half = max(values) - min(values), 0.5 * (j.ci90[1] - j.ci90[0])
    if not spread > 2.0 * half + NEGLIGIBLE * abs(j.fitted):
        return j
    status = "absorbed" if _closes(found) and j.status == "holds" else j.status
    return Judgement(
        j.name, status, j.fitted, j.value, j.ci90, j.unit,
        f"{j.why}; the fits disagree, {min(values):.4g} to {max(values):.4g} {j.unit}",
    )  # fmt: skip


def _opened(j: Judgement) -> Judgement:
    return Judgement(j.name, "open", j.fitted, j.value, j.ci90, j.unit, f"{j.why}; this log does not determine it")


def _next(found: Diagnosis, flat: Sequence[Open]) -> str:
    """Describe the run that is needed next; empty where none is."""
    from ..report.sentences import experiment

    if found.next_run is not None:
        return experiment(found.next_run)
    if not flat:
        return ""
    names = ", ".join(dict.fromkeys(n for direction in flat for n in direction.weights))
    if flat[0].spread > ENDLESS:
        return f"one of {names} measured separately, such as a mass on scales; motion alone hardly distinguishes them."
    return f"one in which {names} act differently: other speeds, loads or frequencies than this log's."
