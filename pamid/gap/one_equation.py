"""One equation of any actuator against a model: evidence in typical units, and its diagnosis in the log's."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..effects import Effect, Plant, all_effects
from ..signals.stretches import stuck_rows
from .diagnosis.findings import ParameterEstimate
from .diagnosis.result import Diagnosis
from .inference.floor import explainable, measured_noise, sense_of
from .inference.sensitivity import Template, templates
from .residuals.scaling import Scaling, Table, scaling_of
from .residuals.single import SignalEvidence
from .residuals.units import Units

_STUCK_SHARE = 0.02  # share of the range by which others must move for a reading that repeats itself to count as stuck


class Gathered(NamedTuple):
    """One equation, ready for a diagnosis.

    Parameters
    ----------
    evidence : SignalEvidence
        The windows, in typical units.
    scaling : Scaling
        What turns those into the log's.
    noise : float
        Standard deviation of a window's noise, in the unit of the target.
    learned : float
        What a flexible learner leaves on held-out runs, in the unit of the target.
    share : float
        Share of the gap beyond the noise that it predicts.
    """

    evidence: SignalEvidence
    scaling: Scaling
    noise: float
    learned: float
    share: float


def gather(
    signals: Table,
    y: np.ndarray,
    nominal: Callable[[Table], np.ndarray],
    codes: np.ndarray,
    dt: float,
    library: Sequence[str],
    *,
    equation: str = "force",
    plant: Plant | None = None,
    position_scale: float = 1.0,
    sense: str | int = "auto",
    labels: Mapping[str, str] | None = None,
    names: Sequence[str] | None = None,
    without: np.ndarray | None = None,
    seed: int = 0,
) -> Gathered:
    """Return the evidence on one equation, the units it is in, its noise, and what of it could be explained."""
    residual = y - nominal(signals)
    lengths = np.diff(np.concatenate([[0], np.flatnonzero(np.diff(codes)) + 1, [len(codes)]])) * dt
    scaling = Scaling(position=position_scale)
    if plant is None:
        scaling = scaling_of(signals, residual, float(np.median(lengths)), dt, position_scale, equation)

    def look(towards: int) -> tuple[Scaling, SignalEvidence, list[Template]]:
        scaled = replace(scaling, target=towards * scaling.target)
        evidence = evidence_in(scaled, signals, y, nominal, codes, dt, equation, plant, labels, names, without)
        return scaled, evidence, [t for name in library for t in templates(evidence, all_effects()[name])]

    chosen, evidence, found = look(1 if sense == "auto" else int(sense))
    # The tension, or the flow, of a muscle that is known is what it delivers.
    if sense == "auto" and plant is None and sense_of(evidence, found) < 0:
        chosen, evidence, found = look(-1)
    noise = measured_noise(evidence)
    learned = explainable(evidence, found, noise, seed)
    evidence.assume(noise, learned.left)
    size = abs(chosen.target)
    return Gathered(evidence, chosen, noise * size, learned.rms * size, learned.share)


def evidence_in(
    scaling: Scaling,
    signals: Table,
    y: np.ndarray,
    nominal: Callable[[Table], np.ndarray],
    codes: np.ndarray,
    dt: float,
    equation: str,
    plant: Plant | None = None,
    labels: Mapping[str, str] | None = None,
    names: Sequence[str] | None = None,
    without: np.ndarray | None = None,
) -> SignalEvidence:
    """Return the evidence in given units; the arguments are those of `gather`."""

    def modelled(table: Table) -> np.ndarray:
        return np.asarray(nominal(scaling.outward(table)), dtype=float) / scaling.target

    evidence = SignalEvidence(
        scaling.inward(signals),
        y / scaling.target,
        modelled,
        codes,
        dt * scaling.time,
        equation,
        plant,
        scaling.position,
        columns=labels,
        shown=signals,
        without=without,
    )
    if names is not None:
        evidence.trajectories = [str(names[codes[a]]) for a in evidence.borders]
    return evidence


def outward(found: Diagnosis, scaling: Scaling, units: Units) -> Diagnosis:
    """Return a diagnosis in the units of the log."""
    size = abs(scaling.target)
    library = all_effects()
    causes = []
    for cause in found.causes:
        first, *others = [
            _in_units(library[name], parameters, scaling, units)
            for name, parameters in zip(cause.effects, (cause.parameters, *cause.others), strict=False)
        ]
        causes.append(replace(cause, parameters=first, others=tuple(others)))
    windows = found.windows.assign(
        time=found.windows["time"] / scaling.time,
        **{k: found.windows[k] * scaling.target for k in ("measured", "before", "after")},
        noise=found.windows["noise"] * size,
    )
    return replace(
        found,
        bands=[replace(b, from_hz=b.from_hz * scaling.time, to_hz=b.to_hz * scaling.time) for b in found.bands],
        causes=causes,
        closure=[
            replace(
                c,
                rmse_before=c.rmse_before * size,
                rmse_after=c.rmse_after * size,
                noise_floor=c.noise_floor * size,
                unit=units.target,
            )
            for c in found.closure
        ],
        windows=windows,
        remainder={**found.remainder, "rmse": found.remainder["rmse"] * size} if found.remainder else {},
    )


def _in_units(
    effect: type[Effect], parameters: Mapping[str, ParameterEstimate], scaling: Scaling, units: Units
) -> dict[str, ParameterEstimate]:
    """Return the parameters of an effect in the units of the log."""
    known = {p.name: p for p in effect.parameters}
    return {
        name: p.scaled(scaling.factor(effect, known[name]), units.of(effect, known[name]))
        for name, p in parameters.items()
    }


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
