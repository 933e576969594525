"""A diagnosis in sentences, one for each of where, which and how far; command line, page and display share them."""

import math
import re
from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

from ..equations import all_equations
from ..explained import explained_fields
from ..gap.diagnosis.findings import Cause, Closure, NextExperiment, Region
from ..gap.diagnosis.result import Diagnosis
from .causes import cause_names, causes_listed, either, size
from .doubts import question
from .quantities import (
    NOT_EFFECTS,
    at_least,
    capital,
    effect,
    error_size,
    interval_of,
    listed,
    percent,
    probability,
    run_named,
)
from .several import changed
from .when import when
from .words import BENCH, Words

_MOST_OF_IT = 0.85  # equations are named until they hold this share of the gap
_CONCENTRATED = 1.5  # a region is worth a word if it holds this many times its share of the samples
_CONDITION = re.compile(r"^\(*\s*([A-Za-z_]\w*)\s*(<=|>=|<|>)\s*(-?[\d.]+(?:[eE][-+]?\d+)?)\s*\)*$")
_SIDE = re.compile(r"[12]$")
_EXPERIMENT_UNITS = {
    "frequency": "rad/s", "amplitude": "deg", "angle": "deg", "start": "deg", "end": "deg", "seconds": "s",
    "rise": "Pa", "at": "s", "after": "s", "phase": "rad",
}  # fmt: skip
_READABLE = 4  # conditions of a region that a sentence holds
_NOTHING = 0.02  # share closed that is not worth a name
_ALLOWED = {
    "timing": "when {} acts within a sample",
    "bend": "how {} changes from row to row",
    "start": "what {} was before the log began",
    "drive": "how {} changes within a sample",
    "skew": "the time between {} and its position, within a sample",
    "offset": "a small offset at {}",
}
"""What a fit also adjusts, by the first word of its name."""
_FEW_RUNS = 3  # below this number of runs, pieces of a log are held out in turn


@explained_fields
class Answers(NamedTuple):
    """A diagnosis in four sentences.

    Examples
    --------
    >>> from pamid.report import Answers
    >>> print(Answers("No gap beyond the noise", "Nowhere.", "None.", "There is nothing to close."))
    No gap beyond the noise
    Nowhere.
    None.
    There is nothing to close.
    """

    verdict: Annotated[str, "The answer in a few words."]
    where: Annotated[str, "One sentence each; of several causes `which` has a line each."]
    which: Annotated[str, "One sentence each; of several causes `which` has a line each."]
    how_far: Annotated[str, "One sentence each; of several causes `which` has a line each."]

    def __str__(self) -> str:
        return "\n".join(" ".join(sentence.splitlines()) for sentence in self if sentence)


def answers(diagnosis: Diagnosis) -> Answers:
    """Summarise a diagnosis in sentences.

    Parameters
    ----------
    diagnosis : Diagnosis
        What `pamid.gap.diagnose` returned.

    Returns
    -------
    Answers
        The verdict, where the gap lies, which effect causes it, how far it shrinks.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.gap import diagnose
    >>> nominal = BenchParameters.for_muscle("B")
    >>> log = simulate(nominal, [sine(2, 10, 500), sine(6, 10, 500)], effects=["leakage"])
    >>> from pamid.report import answers
    >>> answers(diagnose(log, nominal, ["leakage"])).verdict
    'One cause: leakage'
    """
    first = f"{question(diagnosis)} {where(diagnosis)}".lstrip()
    cause = " ".join([which(diagnosis), *map(changed, diagnosis.changes)])
    return Answers(verdict(diagnosis), first, cause, how_far(diagnosis))


def verdict(d: Diagnosis) -> str:
    """Return the answer in a few words."""
    if not d.tested:
        return "Nothing could be tested"
    if d.verdict == "none":
        return "No gap beyond the noise" + (" in what could be tested" if d.cannot_show else "")
    if d.families:
        kinds = listed(list(dict.fromkeys(c.family for c in d.families)))
        found = listed([either(c, Words.of(d)) for c in d.families])
        return f"A gap whose cause is unknown but resembles {found}{f' ({kinds})' if kinds != found else ''}"
    if d.verdict == "unknown" or not d.causes:
        return f"A gap whose cause is not {'found yet' if d.interrupted else 'in the library'}"
    return _named(d) + _more(d)


def _named(d: Diagnosis) -> str:
    """Return the named causes."""
    words = Words.of(d)
    if d.verdict == "several":
        main = main_causes(d)
        few = len(d.causes) - len(main)
        beside = f"; {_count(few).lower() if few > 1 else 'one'} more with under 2 % of the gap" if few else ""
        head = f"{_count(len(main))} causes" if len(main) > 1 else "One cause"
        if all(c.with_reserve for c in main):
            return f"{head}: {causes_listed([either(c, words) for c in main])}{_reserve(d, main)}{beside}"
        told = [either(c, words) + (" (or something that looks like it)" if c.with_reserve else "") for c in main]
        return f"{head}: {causes_listed(told)}{beside}"
    first = cause_names(d.causes[0], words)
    if len(first) > 1:
        return f"One cause, and this log cannot tell which: {either(d.causes[0], words)}{_reserve(d, d.causes)}"
    return f"One cause: {first[0]}{_reserve(d, d.causes)}"


def main_causes(d: Diagnosis) -> list[Cause]:
    """Return the causes of at least 2 % of the gap; the first where all are smaller."""
    return [c for c in d.causes if c.share >= _NOTHING] or d.causes[:1]


def _more(d: Diagnosis) -> str:
    """Say that a gap remains whose cause is not among the named ones."""
    if not d.unexplained:
        return ""
    where_left = listed([Words.of(d).in_equation(name).removeprefix("in ") for name in d.unexplained])
    return f"; and a gap in {where_left} that the library does not explain"


def _reserve(d: Diagnosis, main: list[Cause]) -> str:
    """Return the reserve on names where a cause beyond the library cannot be excluded."""
    if not any(c.with_reserve for c in main):
        return ""
    them = "them" if len(main) > 1 else "it"
    return f", or something that looks like {them} on this log"


# --- where --------------------------------------------------------------------------------------------------
def where(d: Diagnosis) -> str:
    """Return where the gap lies."""
    words = Words.of(d)
    names = [words.equation(e.equation) for e in d.equations]
    if not d.tested or (d.verdict == "none" and not names):
        return f"Unknown: no equation could be compared with the log.{_left_out(d)}"
    if d.verdict == "none":
        tested = f"{listed(names)} agree" if len(names) > 1 else f"{names[0]} agrees"
        return f"Nowhere: {tested} with the log within the noise ({probability(d.p_value)}).{_left_out(d)}"
    held = sorted(d.equations, key=lambda e: -e.share)
    if not held:
        return f"Simulator and log disagree ({probability(d.p_value)}).{_event_text(d)}{_left_out(d)}"
    told, total = [], 0.0
    for finding in held:
        told.append(finding)
        total += finding.share
        if total >= _MOST_OF_IT:
            break
    first = told[0].equation
    if len(told) == 1:
        text = f"{capital(percent(told[0].share))} of the gap is {words.in_equation(first)}"
    else:
        parts = [f"{words.equation(e.equation)} ({percent(e.share)})" for e in told]
        bench = words.in_equation(first).endswith(" equation")
        text = f"The gap is in {'the equations of ' if bench else ''}{listed(parts)}"
    part = "it" if len(told) == 1 else f"the part {words.in_equation(first)}"
    text += f"; {_region_text(d.regions, first, part, words)}{_band_text(d, first)}."
    return f"{text}{when(d)}{_event_text(d)}{_left_out(d)}"


def _event_text(d: Diagnosis) -> str:
    """Return when an error far beyond the noise lasts, of several the largest."""
    if not d.events:
        return ""
    event, words = d.events[0], Words.of(d)
    when = f"From {event.begins:.4g} to {event.ends:.4g} s of {run_named(event.trajectory)}"
    added = " with the causes added" if d.added else ""
    others = len(d.events) - 1
    more = f"; {others} more stretch{'es stand' if others > 1 else ' stands'} out" if others else ""
    return (
        f" {when}, the {words.residual_words(event.equation)}{added} "
        f"is up to {float(f'{event.excess:.2g}'):g} times its noise{more}."
    )


def _left_out(d: Diagnosis) -> str:
    """Return which equations were not tested, and why."""
    known = all_equations()
    tested = [known[e.equation] for e in d.equations if e.equation in known]
    together = [e for e in tested if set(e.combines) & set(d.not_tested)]
    combined = {name for e in together for name in e.combines}
    text = "".join(
        f" {capital(listed(list(e.combines)))} were tested together, since the log lacks "
        f"the {BENCH.signal(e.without).words} of each muscle."
        for e in together
    )
    alone = {name: why for name, why in d.not_tested.items() if name not in combined}
    return text + "".join(f" Not tested: {_sentence_end(why)}" for why in alone.values())


def _region_text(regions: list[Region], equation: str, part: str, words: Words) -> str:
    region = leading_region(regions, equation)
    if region is None:
        return f"{part} is spread over the whole state space"
    own = [r for r in regions if r.equation == equation]
    share, samples = sum(r.share for r in own), sum(r.samples for r in own)
    if share > 1.25 * region.share and share >= _CONCENTRATED * samples:
        found = f"{percent(share)} of {part} lies in {percent(samples)} of the samples"
        return f"{found}, mostly {region_words(region.query, words)}"
    return (
        f"{percent(region.share)} of {part} lies in {percent(region.samples)} of the samples, "
        f"{region_words(region.query, words)}"
    )


def region_words(query: str, words: Words) -> str:
    """Return a region in words; of more conditions than one reads at once, the signals alone."""
    found = [_CONDITION.match(part.strip()) for part in query.split(" and ")]
    names = list(dict.fromkeys(words.signal(m[1]).words for m in found if m is not None))
    return f"in a region of {listed(names)}" if len(found) > _READABLE and names else query_words(query, words)


def leading_region(regions: list[Region], equation: str) -> Region | None:
    """Return the region that holds most of an equation's gap beyond its share of the samples, if one does."""
    own = [r for r in regions if r.equation == equation and r.share >= _CONCENTRATED * r.samples and r.share > 0.1]
    return max(own, key=lambda r: r.share - r.samples, default=None)


def _band_text(d: Diagnosis, equation: str) -> str:
    own = [b for b in d.bands if b.equation == equation and math.isfinite(b.share)]
    if not own:
        return ""
    band = max(own, key=lambda b: b.share)
    if band.share < 0.4:
        return ", at all frequencies"
    place = f"below {band.to_hz:.3g} Hz" if band.from_hz <= 0 else f"from {band.from_hz:.3g} to {band.to_hz:.3g} Hz"
    return f"; {percent(band.share)} of it lies {place}"


def query_words(query: str, words: Words = BENCH) -> str:
    """Return a region's query in words, or as it is where it is not a plain list of conditions."""
    found = [_CONDITION.match(part.strip()) for part in query.split(" and ")]
    plain = [m for m in found if m is not None]
    if len(plain) < len(found):
        return f"where {query}"
    # Both muscles are alike: what is said of the first one alone holds for either.
    alike = not any(m[1].endswith("2") for m in plain)
    ranges: dict[str, tuple[float, float]] = {}
    for m in plain:
        (low, high), limit = ranges.get(m[1], (-math.inf, math.inf)), float(m[3])
        ranges[m[1]] = (max(low, limit), high) if m[2][0] == ">" else (low, min(high, limit))
    return f"where {listed([_condition(name, *ends, alike, words) for name, ends in ranges.items()])}"


def _condition(name: str, low: float, high: float, alike: bool, words: Words) -> str:
    """Return in words that a signal lies within a range, which may be open at one end."""
    if name in words.ports:
        return f"{name} is {_within(low, high, 1.0, words.signal(name).unit)}"
    bare, side = _SIDE.sub("", name), name[-1] if _SIDE.search(name) else ""
    if alike:
        name, side = bare, ""
    muscle = f"muscle {side}" if side else "the muscle"
    moving = {
        "deps": ("shortens", "lengthens"),
        "dP": ("gains pressure", "loses pressure"),
        "u": ("is being filled", "is being vented"),
    }
    if bare in moving and (low, high) in ((0.0, math.inf), (-math.inf, 0.0)):
        return f"{muscle} {moving[bare][low != 0.0]}"
    quantity = words.signal(name)
    return f"the {quantity.words.replace(', absolute', '')} is {_within(low, high, quantity.factor, quantity.unit)}"


def _within(low: float, high: float, factor: float, unit: str) -> str:
    ends = [f"{end * factor:.3g}" for end in (low, high) if math.isfinite(end)]
    where_ = "between" if len(ends) == 2 else "above" if high == math.inf else "below"
    return f"{where_} {' and '.join(ends)} {unit}".rstrip()


# --- which --------------------------------------------------------------------------------------------------
def which(d: Diagnosis) -> str:
    """Return which effect causes the gap."""
    words, tried = Words.of(d), "tried so far" if d.interrupted else "of the library"
    if not d.tested:
        return "No answer: there is no evidence for or against a gap."
    if d.verdict == "none":
        text = f"parameters within their tolerances and sensor noise explain the log{_confidence(d)}"
        if not d.cannot_show:
            return f"None: {text}."
        silent = listed([effect(name) for name in d.cannot_show], "or")
        return f"None of the effects that this log can show: {text}. It cannot show {silent}."
    if d.families:
        closest = "; ".join(_sized(c, words) for c in d.families)
        return f"No effect {tried} explains it, even allowing for an inexact formula. Closest: {closest}."
    if d.verdict == "unknown" or not d.causes:
        text, best = f"No effect {tried} explains it", best_effect(d)
        if best is not None and best.closed_share < _NOTHING:
            text = f"No effect {tried} explains any of it"
        elif best is not None:
            text += f": the best, {effect(best.effect)}, closes {percent(best.closed_share)} of the gap"
        depends = d.leftover.get("depends_on") or d.leftover.get("signals")
        if isinstance(depends, (list, tuple)) and depends:
            text += f"; the remaining error depends on {listed([words.signal(str(s)).words for s in depends])}"
        return text + "."
    if d.verdict == "several":
        return _one_a_line(d)
    cause, names = d.causes[0], cause_names(d.causes[0], words)
    certain, place = f"confidence {percent(cause.confidence)}", words.in_equation(cause.equation)
    if len(names) > 1:
        text = f"Either {either(cause, words)}, {place} ({certain} that it is one of them)"
        apart = f". A run that would distinguish them: {cause.distinguished_by}" if cause.distinguished_by else ""
        text = _sentence_end(text + (apart or "; this log cannot distinguish them"))
        return f"{text} Size of {names[0]}: {told}." if (told := size(cause, words)) else text
    told = size(cause, words, full=True)
    return f"{capital(names[0])}, {place} ({certain}){f': {told}' if told else ''}."


def _one_a_line(d: Diagnosis) -> str:
    """Return several causes, a line each with its size; those of under 2 % of the gap in one."""
    main, lines, words = main_causes(d), [], Words.of(d)
    for c in main:
        names = cause_names(c, words)
        rest = f", or {listed(names[1:], 'or')}" if len(names) > 1 else ""
        share = f"{percent(c.share)} of the gap, {words.in_equation(c.equation)}"
        lines.append(f"{capital(_sized(c, words))}{rest}: {share}.")
    small = [cause_names(c, words)[0] for c in d.causes if c not in main]
    lines += [f"{capital(listed(small))}: under 2 % of the gap{' each' * (len(small) > 1)}."] if small else []
    return "\n".join([*lines, f"Confidence {at_least(min(c.confidence for c in main))}{' in each' * (len(main) > 1)}."])


def _sized(cause: Cause, words: Words) -> str:
    return ", ".join(filter(None, (cause_names(cause, words)[0], size(cause, words))))


def _confidence(d: Diagnosis) -> str:
    none = next((c for c in d.candidates if c.effect == "none"), None)
    return f" (confidence {percent(none.confidence)})" if none is not None else ""


def best_effect(d: Diagnosis) -> Any:
    """Return the effect of the library that closes most by itself; None if none was tried."""
    own = [c for c in d.candidates if c.effect not in NOT_EFFECTS and math.isfinite(c.closed_share)]
    return max(own, key=lambda c: c.closed_share, default=None)


# --- how far ------------------------------------------------------------------------------------------------
def how_far(d: Diagnosis) -> str:
    """Return how far the gap shrinks."""
    if not d.tested:
        return "Nothing was fitted. Correct what prevented the tests, or record new runs, and try again."
    if d.verdict == "none":
        return f"There is nothing to close{_errors(d)}."
    causes = d.added
    if not causes:
        return (
            "Nothing is added to the simulator: an effect that closes part of a gap for the wrong reason would mislead."
        )
    order = {e.equation: e.share for e in d.equations}
    main = causes[0].equation
    closures = sorted(d.closure, key=lambda c: (c.equation != main, -order.get(c.equation, 0.0)))
    if not closures:
        return f"How much of the gap closes could not be tested on unseen {_unseen(d)}."
    c, words = closures[0], Words.of(d)
    it = "them" if len(causes) > 1 else "the likelier one" if len(cause_names(causes[0], words)) > 1 else "it"
    share = f"{interval_of(c.closed_share, *c.ci90)} of the gap"
    before, after, noise = (error_size(x, c.unit) for x in (c.rmse_before, c.rmse_after, c.noise_floor))
    became = f"error {before} before, {after} after (noise: {noise})"
    text = f"Adding {it} closes {share} {words.in_equation(c.equation)} on unseen {_unseen(d)}: {became}"
    if not any(o.closed_share for o in closures) and c.ci90 == (0.0, 1.0):
        return f"On unseen {_unseen(d)} the gap {words.in_equation(c.equation)} is within the noise: {became}."
    rest = [o for o in closures[1:] if order.get(o.equation, 0.0) >= 0.1]
    others = [f"{percent(o.closed_share)} {words.in_equation(o.equation)}" for o in rest]
    return (f"{text}; {listed(others)}." if others else f"{text}.") + _by_itself(c)


def _by_itself(c: Closure) -> str:
    """Return the closure of the corrected simulator where the fit also adjusts what the file cannot contain."""
    if not c.allowed:
        return ""
    kind, _, of = c.allowed.partition(" of ")
    rest = _ALLOWED[kind].format(of) if kind in _ALLOWED else f"the {c.allowed}"
    return (
        f" The corrected simulator by itself closes {percent(c.alone)}: the fit also adjusts {rest}, "
        "which that simulator does not contain."
    )


def _unseen(d: Diagnosis) -> str:
    """Return the held-out units: whole runs, or pieces if a simulator's log has one or two runs."""
    few = any(c.where for c in d.causes) and d.windows["trajectory"].nunique() < _FEW_RUNS
    return "pieces of the log" if few else "runs"


def _errors(d: Diagnosis) -> str:
    """Return the errors of the first equations beside their noise."""
    lines, known = [], all_equations()
    for finding in d.equations[:2]:
        part = d.windows[d.windows["equation"] == finding.equation]
        unit = finding.unit or (known[finding.equation].unit if finding.equation in known else "")
        if len(part) and unit:
            error, noise = (math.sqrt(float((part[c] ** 2).mean())) for c in ("before", "noise"))
            name = Words.of(d).equation(finding.equation)
            lines.append(f"{name} {error_size(error, unit)} (noise: {error_size(noise, unit)})")
    return f": {listed(lines)}" if lines else ""


# --- next ---------------------------------------------------------------------------------------------------
def experiment(e: NextExperiment) -> str:
    """Return the advice on the next recording."""
    kind = str(e.trajectory.get("kind", "a run")).replace("_", " ")
    numbers = (
        _motions(e.trajectory)
        if kind == "run"
        else [
            f"{str(name).replace('_', ' ')} {_plain(value)} {_EXPERIMENT_UNITS.get(str(name), '')}".rstrip()
            for name, value in e.trajectory.items()
            if name not in ("kind", "name")
        ]
    )
    text = "Record a run" if kind == "run" else f"Record a run of the kind {kind}"
    if numbers:
        text += f" ({', '.join(numbers)})"
    if e.separates:
        text += f": it distinguishes {listed([effect(s) for s in e.separates], 'from')}"
    if math.isfinite(e.expected) and e.expected > 0:
        ratio = math.exp(min(e.expected, 20.0))
        odds = "more than 1000" if ratio > 1000 else f"about {float(f'{ratio:.2g}'):g}"
        text += f"; the wrong one should then be {odds} times less likely"
    return text + "."


def _motions(run: Mapping[str, Any]) -> list[str]:
    """Describe each signal of a designed run: held, or a sine about its middle."""
    said = [f"{run['seconds']:.3g} s"] if "seconds" in run else []
    for name in run:
        if name in ("kind", "seconds") or name.endswith(("_amplitude", "_frequency")):
            continue
        q = BENCH.signal(name)
        middle = f"{run[name] * q.factor:.3g} {q.unit}".rstrip()
        if (size := run.get(f"{name}_amplitude")) is None:
            said.append(f"{q.words} held at {middle}")
        else:
            swing = f"{size * q.factor:.3g} {q.unit}".rstrip()
            said.append(f"{q.words} {middle} ± {swing} at {run[f'{name}_frequency']:.3g} rad/s")
    return said


def experiment_reason(e: NextExperiment) -> str:
    """Return why this run, as a sentence."""
    return _sentence_end(capital(e.reason)) if e.reason else ""


def experiment_option(e: NextExperiment) -> str:
    """Return the run as ``pamid simulate --trajectory`` takes it; empty for one of a single equation."""
    kind = str(e.trajectory.get("kind", ""))
    if kind == "run":
        return ""
    values = [f"{k}={_plain(v)}" for k, v in e.trajectory.items() if k not in ("kind", "name")]
    return f"{kind}:{','.join(values)}" if values else kind


def _plain(value: Any) -> str:
    return f"{value:g}" if isinstance(value, (int, float)) and not isinstance(value, bool) else str(value)


def _sentence_end(text: str) -> str:
    return text if text.endswith(".") else f"{text}."


def _count(n: int) -> str:
    return {2: "Two", 3: "Three", 4: "Four"}.get(n, str(n))
