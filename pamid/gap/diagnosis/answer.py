"""Assemble the diagnosis: where the gap lies, its causes, how far it shrinks, what to record next."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from ..design.experiment import next_experiment
from ..inference.competition import Competition
from ..inference.gauss_newton import Fit, Fitter, slots_of
from ..inference.significance import excess, lasting, noise_error
from ..inference.so_far import in_words
from ..inference.student_t import scale
from ..residuals.bench import Evidence
from ..residuals.protocol import STATE, ResidualSource
from ..settings import FALSE_ALARM, MATERIAL
from .belief import candidates
from .closure import Clusters, closures, main_equation
from .decide import Verdict
from .findings import Cause, Closure, EquationFinding, Event, HypothesisFinding, ParameterEstimate
from .localise import bands, regions, shares, trajectories
from .remainder import leftover, remainder
from .result import Diagnosis
from .rivals import rivals_of
from .signs import worst
from .sized import sized

SHORT = "The diagnosis was interrupted: the sizes of causes were fitted only to the part of the log that was searched."
"""What a diagnosis notes whose causes were not fitted to all rows."""
MOST = 12
"""Number of sets of effects that a diagnosis reports."""


def answer(
    evidence: ResidualSource,
    competition: Competition,
    verdict: Verdict,
    notes: list[str],
    random_state: np.random.RandomState,
    say: Callable[[str], None],
    short: bool = False,
) -> Diagnosis:
    """Return the diagnosis of a log, the causes fitted to all of it; in short without what takes long and can lack."""
    say("compute how much of the gap is closed")
    fitter, base, fit = competition.fitter, verdict.outcome.base.fit, verdict.outcome.best.fit
    if competition.evidence is not evidence:
        say("fit the causes to all rows")
        fitter = Fitter(evidence)
        base = fitter.base()
        fit = (fitter.at(fit.spec) if short else _again(fitter, fit)) if verdict.named else base
        notes = [*notes, SHORT] if short and verdict.named else notes
    fit = fitter.told(fit) if verdict.named and not short else fit
    # The gap is what a refit within the tolerances leaves; what they explain is not a gap.
    base = fitter.unwhitened(base)
    fit = fit if verdict.named else base
    before = after = held_out = evidence.raw(base.z)
    clusters, parameters = None, dict[str, dict[str, ParameterEstimate]]()
    if verdict.named:
        clusters = Clusters(fitter, fit)
        parameters = clusters.parameters()
        verdict.trust = sized(verdict.trust, clusters, parameters)
        if verdict.rests_on_size and not any(verdict.trust[name].sized for name in verdict.outcome.best.names):
            verdict, fit, clusters = verdict.without_gap(), base, None
    if clusters is not None:
        after, held_out = evidence.raw(clusters.z), evidence.raw(clusters.held_out())
    gap = before - after if verdict.named else before
    power = np.square(gap) if verdict.named else np.maximum(np.square(before) - 1.0, 0.0)
    energy = power * np.square(evidence.noise)
    closure = closures(evidence, before, held_out, after, random_state)
    equations = _equations(evidence, before, after, verdict)
    alike, not_named = verdict.kind == "family", verdict.kind in ("family", "unknown")
    main = [e.equation for e in equations if e.share > MATERIAL] or [e.equation for e in equations[:1]]
    causes = _causes(fitter, verdict, clusters, parameters, closure) if clusters is not None else []
    experiment, nominal, corrected = None, None, None
    if isinstance(evidence, Evidence):
        if not short:
            say("look for the next experiment")
            experiment, rivals = next_experiment(evidence, verdict)
            causes = [_distinguished(c, experiment, rivals) for c in causes] if rivals else causes
        nominal = evidence.deviated(dict(zip(evidence.free, map(float, base.x), strict=True)))
        deviations = dict(zip(evidence.free, map(float, fit.x), strict=True))
        corrected = evidence.corrected(fit.spec if verdict.named else {}, deviations)
    gapped = verdict.kind != "none"
    return Diagnosis(
        verdict="unknown" if alike else verdict.kind,
        p_value=verdict.p_value,
        equations=equations,
        regions=[r for e in main for r in regions(evidence, e, energy)] if gapped else [],
        bands=[b for e in main for b in bands(evidence, e, gap)] if gapped else [],
        trajectories=trajectories(evidence, _balanced(evidence, power)) if gapped else [],
        events=_events(evidence, after) if gapped else [],
        candidates=candidates(competition, verdict),
        causes=[] if alike else causes,
        families=causes if alike else [],
        closure=[c for c in closure if gapped],
        next_run=experiment,
        notes=[*notes, *competition.notes, *_beginnings(evidence, fit.spec if verdict.named else {})],
        nominal=nominal,
        corrected=corrected,
        windows=_windows(evidence, before, after),
        leftover=leftover(evidence, equations[0].equation, before) if equations and not_named and not short else {},
        remainder=remainder(evidence, before, after) if verdict.named and not short else {},
        with_reserve=verdict.reserved,
        signs=worst({name: found.signs for name, found in verdict.trust.items()}),
        hypotheses=_hypotheses(verdict),
        deviations=dict(zip(evidence.free, map(float, fit.x), strict=True)),
        unexplained=_unexplained(evidence, before, after, equations) if causes and not alike else [],
        not_tested=dict(evidence.skipped),
        cannot_show=[name for name in competition.library if not competition.evidence.touched([name])],
        rivals=rivals_of(competition, verdict),
    )


def untested(evidence: ResidualSource, library: Sequence[str], notes: list[str]) -> Diagnosis:
    """Assemble a diagnosis without evidence: nothing in the log could be compared with its model."""
    return Diagnosis(
        verdict="untested",
        p_value=float("nan"),
        equations=[],
        regions=[],
        bands=[],
        trajectories=[],
        candidates=[],
        causes=[],
        closure=[],
        next_run=None,
        notes=notes,
        nominal=evidence.params if isinstance(evidence, Evidence) else None,
        corrected=None,
        windows=_windows(evidence, np.zeros(0), np.zeros(0)),
        not_tested=dict(evidence.skipped),
        cannot_show=list(library),
    )


def _hypotheses(verdict: Verdict) -> list[HypothesisFinding]:
    """Return the sets of effects that were refitted, the likeliest first."""
    base = verdict.outcome.base
    return [
        HypothesisFinding(tuple(h.fit.spec), float(h.score - base.score), float(h.plain - base.plain))
        for h in verdict.outcome.refitted[:MOST]
        if h.fit.spec
    ]


def _balanced(evidence: ResidualSource, power: np.ndarray) -> np.ndarray:
    """Return the power, each equation weighted by its significance, not by its unit."""
    out = np.zeros(len(power))
    for part in evidence.parts:
        mean = float(np.mean(power[part])) if len(power[part]) else 0.0
        if mean > 0.05:
            out[part] = power[part] / mean * np.log1p(mean)
    return out


def _equations(
    evidence: ResidualSource, before: np.ndarray, after: np.ndarray, verdict: Verdict
) -> list[EquationFinding]:
    sizes = [scale(before[part], 0.0) for part in evidence.parts]
    over = [excess(evidence, before, part, s) for part, s in zip(evidence.parts, sizes, strict=True)]
    if verdict.named:
        # The gap is what causes close, plus what they leave far beyond the noise.
        left = [_beyond(after[p]) * (e.p_value < FALSE_ALARM) for p, e in zip(evidence.parts, over, strict=True)]
        gains = [
            len(before[p]) * np.log1p(np.mean(np.square(before[p] - after[p])) + more)
            for p, more in zip(evidence.parts, left, strict=True)
        ]
    else:
        # A few windows far out are a gap that a robust scale ignores.
        ratios = [
            max(s, float(np.sqrt(np.mean(np.square(before[p]))))) for p, s in zip(evidence.parts, sizes, strict=True)
        ]
        gains = [len(before[p]) * max(np.log(s), 0.0) + 1e-3 for p, s in zip(evidence.parts, ratios, strict=True)]
    found = [
        EquationFinding(name, float(share), e.p_value, float(np.sqrt(max(s**2 - 1.0, 0.0))), evidence.units[name])
        for name, share, e, s in zip(evidence.equations, shares(np.array(gains)), over, sizes, strict=True)
    ]
    return sorted(found, key=lambda e: -e.share)


def _events(evidence: ResidualSource, left: np.ndarray) -> list[Event]:
    """Return the stretches of runs with outstanding residuals, the largest first."""
    found = []
    for name, part in zip(evidence.equations, evidence.parts, strict=True):
        if evidence.exact and part not in evidence.sharp:  # it may err wherever a command jumps between two samples
            continue
        for rows in lasting(evidence, left, part, max(1.0, scale(left[part], 0.0))):
            run = evidence.trajectories[evidence.block[rows[0]]]
            times, most = evidence.time[rows], float(np.max(np.abs(left[rows])))
            event = Event(name, run, float(times[0]), float(times[-1]), most)
            found.append((float(np.sum(np.square(left[rows]))), event))
    return [event for _, event in sorted(found, key=lambda e: -e[0])]


def _beyond(z: np.ndarray) -> float:
    """Return the mean power of residuals beyond that of the noise."""
    return max(float(np.mean(np.square(z))) - 1.0, 0.0) if len(z) else 0.0


def _unexplained(
    evidence: ResidualSource, before: np.ndarray, after: np.ndarray, equations: Sequence[EquationFinding]
) -> list[str]:
    """Return the equations with a part of the gap of which the named causes close less than half, beyond the noise."""
    parts = dict(zip(evidence.equations, evidence.parts, strict=True))
    material = [e.equation for e in equations if e.share > MATERIAL]
    least, was = noise_error(evidence), {name: _beyond(before[parts[name]]) for name in material}
    return [name for name in material if _beyond(after[parts[name]]) > max(0.5 * was[name], least)]


def _causes(
    fitter: Fitter,
    verdict: Verdict,
    clusters: Clusters,
    parameters: Mapping[str, dict[str, ParameterEstimate]],
    closure: list[Closure],
) -> list[Cause]:
    evidence, fit, part_of = fitter.evidence, clusters.fit, verdict.part_of
    whole = evidence.z(fit.spec)
    by_equation = {c.equation: c for c in closure}
    found = []
    for name in fit.spec:
        rest = {k: v for k, v in fit.spec.items() if k != name}
        added = evidence.raw(whole - (evidence.z(rest) if rest else evidence.z0))
        equation = main_equation(evidence, name, added, by_equation)
        closed = by_equation[equation]
        share = part_of[name] * closed.closed_share if len(fit.spec) > 1 else closed.closed_share
        ci = tuple(part_of[name] * v for v in closed.ci90) if len(fit.spec) > 1 else closed.ci90
        names = verdict.classes.get(name, (name,))
        weights = verdict.weights.get(name, {name: 1.0})
        trust = verdict.trust[name]
        confidence = trust.probability * sum(weights.get(n, 0.0) for n in names)
        others = tuple(_in_place(fitter, verdict, name, other) for other in names[1:])
        found.append(
            Cause(
                names,
                equation,
                float(confidence),
                float(share),
                (ci[0], ci[1]),
                parameters[name],
                others=others,
                with_reserve=not trust.sure,
                grade=trust.grade,
                family=fitter.evidence.effects[name].family,
                signs=dict(trust.signs),
            )
        )
    return sorted(found, key=lambda c: -c.share)


def _beginnings(evidence: ResidualSource, spec: Mapping[str, Mapping[str, float]]) -> list[str]:
    """Return notes on causes whose past is not in the log."""
    slots = slots_of(evidence.effects, spec)
    found = dict.fromkeys(n for n, p in slots if p.before and spec[n][p.name] > 0.0)
    return [
        f"The state of {name} at the beginning of a run is not in the log: it was fitted in each run, and is not part "
        "of the corrected simulator, whose runs begin at rest."
        for name in map(in_words, found)
    ]


def _in_place(fitter: Fitter, verdict: Verdict, name: str, other: str) -> dict[str, ParameterEstimate]:
    """Return the parameters of an effect that replaces a cause."""
    rest = verdict.outcome.best.names - {name}
    fit = next(h.fit for h in verdict.outcome.alternatives[name] if h.names == rest | {other})
    if len(fit.z) != len(fitter.evidence.z0):
        fit = _again(fitter, fit)
    return Clusters(fitter, fit).parameters()[other]


def _again(fitter: Fitter, fit: Fit) -> Fit:
    """Return a fit to a part of a log as one to all of it, which may have more parameters."""
    return fitter.refine(fit.spec, near=fit.x if len(fit.x) == fitter.n else None)


def _distinguished(cause: Cause, experiment: Any, rivals: tuple[str, ...]) -> Cause:
    if experiment is None or len(cause.effects) < 2 or not set(rivals) <= set(cause.effects):
        return cause
    kind = str(experiment.trajectory.get("kind", "run")).replace("_", " ")
    return replace(cause, distinguished_by=f"{kind} ({experiment.reason})")


def _windows(evidence: ResidualSource, before: np.ndarray, after: np.ndarray) -> pd.DataFrame:
    names = np.empty(len(before), dtype=object)
    for name, part in zip(evidence.equations, evidence.parts, strict=True):
        names[part] = name
    return pd.DataFrame(
        {
            "trajectory": np.array(evidence.trajectories, dtype=object)[evidence.block],
            "time": evidence.time,
            "equation": names,
            "side": evidence.side + 1,
            **{key: evidence.state[key] for key in STATE},
            "measured": evidence.measured,
            "before": before * evidence.noise,
            "after": after * evidence.noise,
            "noise": evidence.noise,
        }
    )
