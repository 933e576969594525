"""One equation of any actuator against a model: its signals on a log, and their evidence."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from ..effects import Plant
from ..errors import ExcitationError, TimeOrderError
from ..signals.stretches import stuck_rows
from ..simulators.placement import Scales
from ..simulators.port_log import PortLog
from ..simulators.problem import Problem
from .diagnosis.result import Diagnosis
from .inference.floor import explainable, measured_noise, sense_of
from .inference.sensitivity import Template, templates
from .residuals.on_equation import scales_of, strain_scale
from .residuals.rates import with_rates
from .residuals.single import SignalEvidence, Table
from .residuals.units import Units

_STUCK_SHARE = 0.02  # share of the range by which others must move for a reading that repeats itself to count as stuck


class Gathered(NamedTuple):
    """One equation, ready for a diagnosis, in the unit of its target."""

    evidence: SignalEvidence
    noise: float
    """Standard deviation of a window's noise."""
    learned: float
    """What a flexible learner leaves on held-out runs."""
    share: float
    """Share of the gap beyond the noise that it predicts."""


@dataclass(frozen=True)
class Measured:
    """One equation on a log: signals by role, rates included, what was measured, and what a model says."""

    signals: dict[str, np.ndarray]
    y: np.ndarray
    codes: np.ndarray
    """Run of each row, from 0 in their order."""
    names: Sequence[str]
    dt: float
    model: Callable[[np.ndarray], Callable[[Table], np.ndarray]]
    """Takes row numbers, returns what turns the signals of these rows into the modelled target."""
    usual: Callable[[int], Callable[[Table], np.ndarray]]
    """The same for a number of rows whose columns without a role are where they usually are."""
    equation: str
    columns: Mapping[str, str]
    """The user's name of each role that the log has."""
    units: Units
    plant: Plant | None = None
    position_scale: float = 1.0
    notes: list[str] = field(default_factory=list)
    counts: np.ndarray | None = None
    """Rows that count."""

    @classmethod
    def of(cls, problem: Problem) -> Measured:
        """Return the equation that a simulator states on a log."""
        import pandas as pd

        X, roles, codes = problem.X, dict(problem.roles), problem.codes
        given = {role: X[column].to_numpy(dtype=float) for role, column in roles.items()}
        dt = sampling_interval(given, codes)
        signals = role_signals(given, codes, dt, problem.equation)
        contraction = is_contraction(problem.plant, roles)

        def model(T: pd.DataFrame) -> Callable[[Table], np.ndarray]:
            def modelled(table: Table) -> np.ndarray:
                return np.asarray(problem.nominal(T.assign(**{c: table[r] for r, c in roles.items()})), dtype=float)

            return modelled

        def usual(n: int) -> Callable[[Table], np.ndarray]:
            return model(pd.DataFrame(np.tile(X.median().to_numpy(), (n, 1)), columns=X.columns))

        first = np.searchsorted(codes, np.arange(codes[-1] + 1))
        return cls(
            signals, problem.y, codes, [str(n) for n in problem.groups[first]], dt, lambda rows: model(X.iloc[rows]),
            usual, problem.equation, roles, told_units(problem.equation, contraction, problem.units), problem.plant,
            strain_scale(signals.get("position", np.zeros(1)), contraction), problem.notes, problem.counts,
        )  # fmt: skip

    @property
    def nominal(self) -> Callable[[Table], np.ndarray]:
        """What turns the signals of all rows into the modelled target."""
        return self.model(np.arange(len(self.y)))

    def checked(self) -> tuple[np.ndarray, list[str]]:
        """Return the rows that are left out, and notes on the signals; raise where none can be used."""
        driven = [x for role, x in self.signals.items() if role in self.columns and role not in ("time", "flow")]
        if not any(np.ptp(x) > 0 for x in driven):
            what = f"None of the signals {', '.join(self.signals)} moves."
            raise ExcitationError(what, "motion", "Record runs in which position changes.")
        notes = self._notes()
        moving = {k: v for k, v in self.signals.items() if k in ("position", "pressure", "command")}
        stuck = stuck_beside(self.y, moving, self.codes)
        if stuck.any():
            share = f"{100 * stuck.mean():.1f} %"
            what = f"y repeats one value in {share} of the rows while others move: a clipped or stuck sensor."
            notes.append(f"{what} Those rows are left out.")
        without = stuck if self.counts is None else stuck | ~self.counts
        if without.all():
            raise ExcitationError("No row is left.", "rows that meet the condition", "Correct where=.")
        return without, notes

    def _notes(self) -> list[str]:
        signals, codes, notes = self.signals, self.codes, list[str]()
        if codes[-1] == 0:
            notes.append("Only one run: no intervals over runs can be given; stretches of it are held out.")
        if "time" in signals:
            steps, same = np.diff(signals["time"]), np.diff(codes) == 0
            if np.any(steps[same] < 0):
                raise TimeOrderError("Time runs backwards within a run.", "rows in order of time", "Sort each run.")
            each = [float(np.median(s)) for k in np.unique(codes) if len(s := steps[same & (codes[1:] == k)])]
            if each and max(each) > 1.1 * min(each):
                notes.append(
                    f"The runs are sampled every {min(each):.3g} to {max(each):.3g} s; the median is used, so time "
                    "constants are uncertain by as much."
                )
        if still := [role for role, x in signals.items() if np.ptp(x) == 0.0]:
            notes.append(f"Constant, so no cause can depend on it: {', '.join(still)}.")
        if "position" in signals and not {"position", "velocity"} & set(self.columns):
            notes.append("No column is a position: effects of the position follow the drive of the system instead.")
        return notes

    def evidence(
        self, scales: Scales | None = None, rows: slice = slice(None), without: np.ndarray | None = None
    ) -> SignalEvidence:
        """Return the evidence of some rows, whole runs; effects are in the units of the log without scales."""
        at = np.arange(len(self.y))[rows]
        return SignalEvidence(
            {k: v[at] for k, v in self.signals.items()}, self.y[at], self.model(at), self.codes[at], self.dt,
            self.equation, self.plant, scales or Scales(position=self.position_scale), self.units, self.columns,
            self.names, None if without is None else without[at],
        )  # fmt: skip

    @property
    def log(self) -> PortLog:
        """The signals, as the log of a simulator with ports."""
        starts, at = np.flatnonzero(np.diff(self.codes, prepend=-1)), np.arange(len(self.y))
        since = at - starts[np.searchsorted(starts, at, side="right") - 1]
        channels = {c: self.signals[r] for r, c in self.columns.items() if c != "time"}
        return PortLog(channels, since * self.dt, starts, self.dt, [str(self.names[k]) for k in self.codes[starts]])


def sampling_interval(signals: Table, codes: np.ndarray, otherwise: float = 1e-3) -> float:
    """Return the sampling interval that the times of signals tell, s; another where they do not."""
    steps = np.diff(signals["time"])[np.diff(codes) == 0] if "time" in signals else np.zeros(0)
    steps = steps[steps > 0]
    return float(np.median(steps)) if len(steps) else float(otherwise)


def role_signals(given: dict[str, np.ndarray], codes: np.ndarray, dt: float, equation: str) -> dict[str, np.ndarray]:
    """Return the signals by role; a velocity that was not given is differentiated within each run.

    Where nothing is a position, the command (or the force) that drives the thing stands for it: hysteresis and creep
    then act on that.
    """
    signals = dict(given)
    if "position" not in signals and "velocity" not in signals:
        driving = next((r for r in ("command", "force", "pressure") if r in signals), None)
        if driving and not (driving == "pressure" and equation == "flow"):
            signals["position"] = signals[driving]
    return with_rates(signals, codes, dt)


def is_contraction(plant: Plant | None, columns: Mapping[str, str]) -> bool:
    """Return whether the position is a contraction ratio."""
    return plant is not None or columns.get("position", "").lower().startswith(("eps", "contraction"))


def told_units(equation: str, contraction: bool, given: Mapping[str, str] | None) -> Units:
    """Return the units in which parameters are told: SI of a muscle, else as given."""
    si = {"target": "kg/s" if equation == "flow" else "N", "position": "-", "pressure": "Pa"}
    unnamed = {role: f"{role} unit" for role in si}
    return Units(**{**(si if contraction else unnamed), **(given or {})})


def library_for(effects: str | Sequence[str], equation: str, contraction: bool, units: Units) -> list[str]:
    """Return the effects that a choice stands for, of `pamid.effects.base.KINDS` those of what the equation is about.

    On one equation, damping of a joint is viscous friction by another name.
    """
    from ..effects.registry import chosen_effects

    about = {"force": "actuator", "torque": "motor" if units.target == "V" else "joint"}.get(equation, "gas")
    library = chosen_effects(effects, "muscle" if contraction else about)
    return [name for name in library if name != "joint_damping" or "viscous_friction" not in library]


def gather(
    m: Measured, library: Sequence[str], sense: str | int = "auto", without: np.ndarray | None = None, seed: int = 0
) -> Gathered:
    """Return the evidence on one equation, the units it is in, its noise, and what of it could be explained."""
    residual = m.y - m.nominal(m.signals)
    lengths = np.diff(np.concatenate([[0], np.flatnonzero(np.diff(m.codes)) + 1, [len(m.codes)]])) * m.dt
    scales = Scales(position=m.position_scale)
    if m.plant is None:
        scales = scales_of(m.signals, residual, float(np.median(lengths)), m.dt, m.position_scale, m.equation)

    def look(towards: int) -> tuple[SignalEvidence, list[Template]]:
        evidence = m.evidence(replace(scales, target=towards * scales.target), without=without)
        return evidence, [t for name in library for t in templates(evidence, name)]

    evidence, found = look(1 if sense == "auto" else int(sense))
    # The tension, or the flow, of a muscle that is known is what it delivers.
    if sense == "auto" and m.plant is None and sense_of(evidence, found) < 0:
        evidence, found = look(-1)
    noise = measured_noise(evidence)
    learned = explainable(evidence, found, noise, seed)
    evidence.assume(noise, learned.left)
    return Gathered(evidence, noise, learned.rms, learned.share)


def stuck_beside(x: np.ndarray, others: Table, codes: np.ndarray) -> np.ndarray:
    """Return the rows in which a reading stays at one value for long while other signals move: clipped or stuck."""
    return stuck_rows(x, lambda a, b: any(_moves(v, a, b) for v in others.values()), codes)


def _moves(x: np.ndarray, a: int, b: int) -> bool:
    return bool(np.ptp(x[a:b]) > 5 * _STUCK_SHARE * max(float(np.ptp(x)), 1e-300))


def plain(found: Diagnosis) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Return a diagnosis without its table, and the table's columns as arrays."""
    out = ("windows", "nominal", "corrected", "rivals", "logs", "changes", "rounds")
    fields = {k: v for k, v in vars(found).items() if k not in out}
    columns = {
        str(k): np.asarray(v.to_numpy(), dtype=str if v.dtype == object else None) for k, v in found.windows.items()
    }
    return fields, columns


def rebuilt(fields: Mapping[str, Any], columns: Mapping[str, np.ndarray]) -> Diagnosis:
    """Return the diagnosis that `plain` took apart."""
    import pandas as pd

    table = {k: v.astype(object) if v.dtype.kind == "U" else v for k, v in columns.items()}
    return Diagnosis(**fields, nominal=None, corrected=None, windows=pd.DataFrame(table))
