"""Diagnose the gap between a simulator and a log of its bench."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..effects.registry import chosen_effects
from .diagnosis.closure import Clusters, closures, main_equation
from .diagnosis.decide import Verdict, decide
from .diagnosis.localise import bands, regions, shares, trajectories
from .diagnosis.next_experiment import next_experiment
from .diagnosis.remainder import leftover
from .diagnosis.result import Candidate, Cause, Diagnosis, EquationFinding
from .inference.gauss_newton import Fit, Fitter
from .inference.search import Search
from .inference.significance import excess
from .residuals.bench import Evidence
from .residuals.checks import check, notes_on, without_stuck
from .residuals.protocol import STATE, ResidualSource

if TYPE_CHECKING:
    import pandas as pd

    from ..bench.parameters import BenchParameters


def diagnose(
    log: pd.DataFrame,
    params: BenchParameters,
    effects: str | Sequence[str] = "all",
    *,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Say where a simulator and a log part, which effect is the cause, and how far the gap closes once it is added.

    The parameters that have a tolerance are refitted within it together with every candidate, so that a parameter that
    is a little off is no gap. Residuals are those of `pamid.equations`, over windows of 20 ms.

    Parameters
    ----------
    log : DataFrame
        Log of the bench: ``trajectory``, ``time`` (s), ``q`` (rad), ``P1``, ``P2`` (Pa, absolute), ``F1``, ``F2`` (N),
        ``mdot1``, ``mdot2`` (kg/s), ``u1``, ``u2``. Without some of them the equations that read them are left out.
    params : BenchParameters
        The simulator, with its tolerances.
    effects : "all" or sequence of str, default="all"
        The library: names of effects that may be causes; "all" are those that a bench may have.
    seed : int, default=0
        Seed of the draws behind p-values and intervals.
    progress : callable, optional
        Called with a short text at each step.

    Returns
    -------
    Diagnosis
        The answer.

    Raises
    ------
    UnknownOptionError
        The library has no effect of a name.
    ExcitationError
        The log excites nothing that could tell effects apart.
    MissingColumnError, MissingTrajectoryError, TimeOrderError, NonFiniteError
        The log cannot be used as it is.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.gap import diagnose
    >>> nominal = BenchParameters.for_muscle("B")
    >>> leaking = nominal.replace(effects=[("leakage", {"conductance": 2e-10})])
    >>> log = simulate(leaking, [sine(2, 10, 1500), sine(6, 10, 1500)], seed=0)
    >>> diagnose(log, nominal, ["leakage", "viscous_friction"]).causes[0].effects
    ('leakage',)
    """
    library = chosen_effects(effects, "bench")
    say = progress or (lambda _: None)
    say("read the log")
    notes = check(log, params)
    log, stuck = without_stuck(log)
    notes += stuck
    thinned = _thinned(log, MAX_ROWS)
    if len(thinned) < len(log):
        notes.append(f"{len(thinned):,} of {len(log):,} rows were used, whole trajectories evenly spread over the log.")
    evidence = Evidence(thinned, params)
    part = _thinned(thinned, SEARCH_ROWS)
    searched = Evidence(part, params) if len(part) < len(thinned) else evidence
    if searched is not evidence:
        notes.append(f"Causes were searched in {len(part):,} rows, and fitted to {len(thinned):,}.")
    return explain(evidence, library, np.random.RandomState(seed), notes + notes_on(evidence), say, searched)


def explain(
    evidence: ResidualSource,
    library: Sequence[str],
    random_state: np.random.RandomState,
    notes: list[str],
    say: Callable[[str], None] = lambda _: None,
    searched: ResidualSource | None = None,
) -> Diagnosis:
    """Decide on evidence and write down what it says.

    Parameters
    ----------
    evidence : ResidualSource
        The log, held against its model.
    library : sequence of str
        Effects that may be causes.
    random_state : RandomState
        Draws behind p-values and intervals.
    notes : list of str
        What the reader must know.
    say : callable, optional
        Called with a short text at each step.
    searched : ResidualSource, optional
        The part of it in which causes are searched; all by default.
    """
    from threadpoolctl import threadpool_limits

    if not evidence.equations:
        return _untested(evidence, library, notes)
    with threadpool_limits(1):  # thousands of small products: threads would only wait for one another
        verdict, search = decide(searched or evidence, library, random_state, say)
        fitter = search.fitter
        if search.evidence is not evidence:
            say("fit the causes to all rows")
            fitter = Fitter(evidence)
            verdict.base = fitter.base()
            verdict.fit = fitter.refine(verdict.fit.spec, near=verdict.fit.x) if verdict.fit.spec else verdict.base
        say("measure the closure")
        return _written(fitter, search, verdict, notes, random_state, say)


_QUIET = 0.5, 0.96
"""Confidence in no gap where evidence of one is only just missing, and where there is no sign of it."""
_BEYOND = 0.95
"""Most confidence in a cause beyond the library: a cause in it may have another form than it knows."""
MAX_ROWS = 160_000
"""Most rows that a diagnosis looks at; longer logs are thinned to whole trajectories."""
SEARCH_ROWS = 40_000
"""Most rows in which causes are searched; what is found is fitted to all."""


def _thinned(log: pd.DataFrame, most: int) -> pd.DataFrame:
    """Return a log of no more rows than wanted: whole trajectories, evenly spread."""
    from ..equations.log import trajectory_rows

    if len(log) <= most:
        return log
    rows = trajectory_rows(log)
    count = max(1, len(rows) * most // len(log))
    chosen = [rows[k] for k in np.linspace(0, len(rows) - 1, count).round().astype(int)]
    parts = [np.arange(r.start, min(r.stop, r.start + most)) for _, r in chosen]
    return log.iloc[np.concatenate(parts)[:most]]


def _written(
    fitter: Fitter,
    search: Search,
    verdict: Verdict,
    notes: list[str],
    random_state: np.random.RandomState,
    say: Callable[[str], None],
) -> Diagnosis:
    evidence, known = fitter.evidence, verdict.kind in ("cause", "class", "several")
    # The gap is what a refit within the tolerances leaves: what they take up is none.
    base = fitter.as_seen(verdict.base)
    fit = verdict.fit if known else base
    before = after = held_out = evidence.raw(base.z)
    part_of = verdict.part_of if known else {}
    if known:
        clusters = Clusters(fitter, fit)
        after, held_out = evidence.raw(clusters.z), evidence.raw(clusters.held_out())
    gap = before - after if known else before
    power = np.square(gap) if known else np.maximum(np.square(before) - 1.0, 0.0)
    energy = power * np.square(evidence.noise)
    closure = closures(evidence, before, held_out, after, random_state)
    equations = _equations(evidence, before, after, verdict)
    loud = [e.equation for e in equations if e.share > 0.1] or [equations[0].equation] if equations else []
    causes = _causes(evidence, verdict, clusters, closure) if known else []
    experiment, nominal, corrected = None, None, None
    if isinstance(evidence, Evidence):
        say("look for the next experiment")
        experiment, rivals = next_experiment(evidence, search, verdict, evidence.params)
        causes = [_told_apart(c, experiment, rivals) for c in causes] if rivals else causes
        nominal = evidence.deviated(dict(zip(evidence.free, map(float, base.x), strict=True)))
        deviations = dict(zip(evidence.free, map(float, fit.x), strict=True))
        corrected = evidence.simulator(fit.spec if known else {}, deviations)
    return Diagnosis(
        verdict=verdict.kind,
        p_value=verdict.p_value,
        equations=equations,
        regions=[r for e in loud for r in regions(evidence, e, energy)] if verdict.kind != "none" else [],
        bands=[b for e in loud for b in bands(evidence, e, gap)] if verdict.kind != "none" else [],
        trajectories=trajectories(evidence, _balanced(evidence, power)) if verdict.kind != "none" else [],
        candidates=_candidates(search, verdict, part_of),
        causes=causes,
        closure=[c for c in closure if verdict.kind != "none"],
        next_experiment=experiment,
        notes=notes,
        nominal=nominal,
        corrected=corrected,
        windows=_windows(evidence, before, after),
        deviations=dict(zip(evidence.free, map(float, (fit if known else base).x), strict=True)),
        leftover=leftover(evidence, equations[0].equation, before) if verdict.kind == "unknown" and equations else {},
        not_tested=dict(evidence.skipped),
        cannot_show=[name for name in search.library if not evidence.touched([name])],
    )


def _untested(evidence: ResidualSource, library: Sequence[str], notes: list[str]) -> Diagnosis:
    """Write down that nothing of a log could be held against its model; no number speaks for or against a gap."""
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
        next_experiment=None,
        notes=notes,
        nominal=evidence.params if isinstance(evidence, Evidence) else None,
        corrected=None,
        windows=_windows(evidence, np.zeros(0), np.zeros(0)),
        not_tested=dict(evidence.skipped),
        cannot_show=list(library),
    )


def _balanced(evidence: ResidualSource, power: np.ndarray) -> np.ndarray:
    """Return the power with each equation's weighed by how clearly it shows there, not by its unit."""
    out = np.zeros(len(power))
    for part in evidence.parts:
        mean = float(np.mean(power[part])) if len(power[part]) else 0.0
        if mean > 0.05:
            out[part] = power[part] / mean * np.log1p(mean)
    return out


def _equations(
    evidence: ResidualSource, before: np.ndarray, after: np.ndarray, verdict: Verdict
) -> list[EquationFinding]:
    from .inference.student_t import scale

    sizes = [scale(before[part], 0.0) for part in evidence.parts]
    over = [excess(evidence, before, part, s) for part, s in zip(evidence.parts, sizes, strict=True)]
    if verdict.kind in ("cause", "class", "several"):
        gains = [
            len(before[part]) * np.log1p(np.mean(np.square(before[part] - after[part]))) for part in evidence.parts
        ]
    else:
        # A few windows far out are a gap that a robust scale does not hear of.
        loud = [
            max(s, float(np.sqrt(np.mean(np.square(before[p]))))) for p, s in zip(evidence.parts, sizes, strict=True)
        ]
        gains = [len(before[p]) * max(np.log(s), 0.0) + 1e-3 for p, s in zip(evidence.parts, loud, strict=True)]
    found = [
        EquationFinding(name, float(share), e.p_value, float(np.sqrt(max(s**2 - 1.0, 0.0))))
        for name, share, e, s in zip(evidence.equations, shares(np.array(gains)), over, sizes, strict=True)
    ]
    return sorted(found, key=lambda e: -e.share)


def _causes(
    evidence: ResidualSource,
    verdict: Verdict,
    clusters: Clusters,
    closure: list[Any],
) -> list[Cause]:
    fit, part_of = verdict.fit, verdict.part_of
    parameters = clusters.parameters()
    whole = evidence.z(fit.spec)
    by_equation = {c.equation: c for c in closure}
    found = []
    for name in fit.spec:
        rest = {k: v for k, v in fit.spec.items() if k != name}
        added = evidence.raw(whole - (evidence.z(rest) if rest else evidence.z0))
        equation = main_equation(evidence, name, added)
        closed = by_equation[equation]
        share = part_of[name] * closed.closed_share if len(fit.spec) > 1 else closed.closed_share
        ci = tuple(part_of[name] * v for v in closed.ci90) if len(fit.spec) > 1 else closed.ci90
        names = verdict.classes.get(name, (name,))
        weights = verdict.weights.get(name, {name: 1.0})
        confidence = (1.0 - verdict.unknown) * sum(weights.get(n, 0.0) for n in names)
        found.append(Cause(names, equation, float(confidence), float(share), (ci[0], ci[1]), parameters[name]))
    return sorted(found, key=lambda c: -c.share)


def _told_apart(cause: Cause, experiment: Any, rivals: tuple[str, ...]) -> Cause:
    from dataclasses import replace

    if experiment is None or len(cause.effects) < 2 or not set(rivals) <= set(cause.effects):
        return cause
    kind = experiment.trajectory.get("kind", "run")
    return replace(cause, told_apart_by=f"{kind}: {experiment.reason}")


def _candidates(search: Search, verdict: Verdict, part_of: dict[str, float]) -> list[Candidate]:
    """Return the whole library with what speaks for each name, confidences adding to one."""
    scores: dict[str, float] = {}
    closed: dict[str, float] = {}
    reasons: dict[str, str] = {}
    base = search.base
    if verdict.first is not None:
        scores = {name: gain for name, (gain, _) in verdict.first.screened.items()}
        for r in verdict.first.rivals:
            scores[r.added] = search.gain(verdict.first.before, r)
            closed[r.added] = _explained(base.fit, r.fit, search.evidence)
    named = list(verdict.fit.spec) if verdict.kind in ("cause", "class", "several") else []
    leads = _leads({name: part_of.get(name, 1.0) for name in named})
    belief: dict[str, float] = {}
    for name in named:
        for other, w in verdict.weights[name].items():
            if other not in named or other == name:
                belief[other] = belief.get(other, 0.0) + w * (1.0 - verdict.unknown) * leads[name]
        scores.setdefault(name, max((g for r, g in verdict.rivals[name] if r.added == name), default=0.0))
    if verdict.kind == "none":
        calm = float(np.clip(np.log10(max(verdict.p_value, 1e-9) / 0.01), 0.0, 1.0))
        belief["none"] = _QUIET[0] + (_QUIET[1] - _QUIET[0]) * calm
        belief["unknown"] = 0.3 * (1.0 - belief["none"])
    else:
        clear = float(np.clip(np.log10(0.03 / max(verdict.p_value, 1e-9)) / 2.0, 0.0, 1.0))
        beyond = _QUIET[0] + (_BEYOND - _QUIET[0]) * clear
        belief["unknown"] = verdict.unknown if named else beyond * (0.6 + 0.4 * verdict.unknown)
        belief["none"] = min(0.5, verdict.p_value)
    rest = max(0.0, 1.0 - sum(belief.values()))
    others = {n: s for n, s in scores.items() if n not in belief}
    if others and rest > 0:
        top = max(others.values())
        odds = {n: float(np.exp(max(s - top, -50.0) / 3.0)) for n, s in others.items()}
        belief.update({n: rest * v / sum(odds.values()) for n, v in odds.items()})
    total = sum(belief.values()) or 1.0
    best = max(scores.values(), default=0.0)
    for name, score in scores.items():
        if name in named or belief.get(name, 0.0) > 0.05 * total:
            continue
        if score < search.evidence.least_gain and closed.get(name, 0.0) > 0.2:
            reasons[name] = "fits only where it turns into another effect"
        elif score < search.evidence.least_gain:
            reasons[name] = "brings no more than noise would"
        elif score < best:
            reasons[name] = f"explains less: its log-likelihood is lower by {best - score:.0f}"
        elif verdict.kind == "unknown":
            reasons[name] = "comes closest, but leaves more than an inexact form excuses"
        else:
            reasons[name] = "explains what another cause explains better beside the others"
    rows = [
        Candidate(
            name,
            belief.get(name, 0.0) / total,
            float(scores.get(name, 0.0)),
            closed.get(name, 0.0),
            reasons.get(name, ""),
        )
        for name in {**scores, **dict.fromkeys(("none", "unknown"))}
    ]
    untouched = [n for n in search.library if n not in scores]
    rows += [
        Candidate(n, 0.0, 0.0, 0.0, "changes no equation that this log allows, or nothing on it") for n in untouched
    ]
    # Causes come first in the order of the verdict; several of them may each be certain.
    place = {name: k for k, name in enumerate(named)}
    return sorted(rows, key=lambda c: (-c.confidence, place.get(c.effect, 99), -c.score))


def _leads(shares_of: dict[str, float]) -> dict[str, float]:
    """Return the probability that each cause is the leading one, from its share of what all explain together."""
    weight = {name: max(share, 0.02) ** 1.5 for name, share in shares_of.items()}
    return {name: w / sum(weight.values()) for name, w in weight.items()}


def _explained(base: Fit, fit: Fit, evidence: ResidualSource) -> float:
    """Return the share of the explainable gap that a fit closes where the gap is largest."""
    raw = evidence.raw(base.z), evidence.raw(fit.z)
    b, a = (np.array([float(np.mean(np.square(z[p]))) - 1.0 for p in evidence.parts]) for z in raw)
    k = int(np.argmax(b))
    return float(np.clip((b[k] - a[k]) / b[k], 0.0, 1.0)) if b[k] > 0.02 else 0.0


def _windows(evidence: ResidualSource, before: np.ndarray, after: np.ndarray) -> pd.DataFrame:
    import pandas as pd

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
