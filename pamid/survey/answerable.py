"""What a log lets a diagnosis answer, class by class of effects, and what it lacks for the rest."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, NamedTuple

from ..explained import explained_fields
from .coverage import Coverage
from .sampling import Sampling

_SETS = {
    "F": ("F", "F1", "drive", "q_ref"),
    "mdot": ("mdot", "mdot1"),
    "u": ("u", "u1"),
    "P": ("P", "P1"),
    "position": ("q", "eps", "x"),
}


_QUICK = 200.0  # Hz: sampling that shows delays of a few ms


@explained_fields
@dataclass(frozen=True)
class Answerable:
    """Whether one question can be answered.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.survey.survey import survey
    >>> log = simulate(BenchParameters.for_muscle("B"), [sine(4, 15, 800), sine(8, 10, 800)])
    >>> first = survey(log).answers[0]
    >>> first.question != "", first.answer != ""
    (True, True)
    """

    question: Annotated[str, "In words: what the effects are, or which are to be distinguished."]
    effects: Annotated[tuple[str, ...], "Their names in the library."]
    answer: Annotated[str, '``"yes"``, ``"partly"`` or ``"no"``.']
    why: Annotated[str, "The reason, with numbers."]
    record: Annotated[str, "What would help; empty for a yes."] = ""


class Rule(NamedTuple):
    """One question: the signals that it needs, and a test on the excitation."""

    question: str
    """See `Answerable`."""
    effects: str
    """Names in the library, separated by blanks."""
    kinds: str
    """Kinds of logs that it makes sense for, separated by blanks."""
    needs: str
    """Signals, separated by blanks."""
    test: Callable[[Coverage, Sampling], tuple[bool | None, str]]
    """Takes excitation, runs and clock; returns whether it holds (None: partly) and the figure that it looked at."""
    record: str | Callable[[Sampling], str]
    """What to record where it does not hold; a callable takes runs and clock."""


def _graded(value: float, much: float, some: float) -> bool | None:
    """Return whether a value is large enough; None if it is in part."""
    return value > much or (None if value > some else False)


def _both_ways(c: Coverage, s: Sampling) -> tuple[bool | None, str]:
    if c.up + c.down == 0:
        return False, "the position stands still in every run"
    return _graded(min(c.up, c.down), 0.05, 0.01), f"moves up {c.up:.0%} and down {c.down:.0%} of the time"


def _speeds(c: Coverage, s: Sampling) -> tuple[bool | None, str]:
    if c.up + c.down == 0:
        return False, "the position stands still in every run"
    ratio = c.fast / c.slow if c.slow > 0 else 0.0
    return _graded(ratio, 5, 2), f"speeds differ by a factor of {ratio:.3g}"


def _moving_levels(c: Coverage, s: Sampling) -> tuple[bool | None, str]:
    return _levels(c, s) if c.up + c.down > 0.05 else (False, "the position stands still")


def _levels(c: Coverage, s: Sampling) -> tuple[bool | None, str]:
    bar = c.pressure_range / 1e5
    return _graded(bar, 1.0, 0.3), f"the pressure covers {bar:.3g} bar"


def _memory(c: Coverage, s: Sampling) -> tuple[bool | None, str]:
    said = f"{c.reversals} turns of {c.amplitudes} different amplitudes"
    return ((c.reversals >= 6 and c.amplitudes >= 2) or (None if c.reversals >= 3 else False)), said


def _rest(c: Coverage, s: Sampling) -> tuple[bool | None, str]:
    seconds = max(c.longest_hold, 0.0)
    return (seconds >= 5 or (None if seconds >= 1 else False)), f"the longest hold lasts {seconds:.2g} s"


def _plane(c: Coverage, s: Sampling) -> tuple[bool | None, str]:
    if math.isnan(c.correlation):
        return False, "position or pressure stands still"
    return _graded(-abs(c.correlation), -0.9, -0.98), f"position and pressure correlate by {c.correlation:.2f}"


def _sealed(c: Coverage, s: Sampling) -> tuple[bool | None, str]:
    if math.isnan(c.sealed):
        return False, "no command is logged, so sealed periods cannot be found"
    said = f"{c.sealed:.2g} s with the valves shut, at {c.sealed_levels} pressure levels"
    return ((c.sealed >= 1 and c.sealed_levels >= 2) or (None if c.sealed >= 0.5 else False)), said


def _held(c: Coverage, s: Sampling) -> tuple[bool | None, str]:
    kpa = c.held_pressure_moves / 1e3
    return _graded(kpa, 50, 10), f"the pressure moves by {kpa:.3g} kPa while the position stands"


def _speeds_of_filling(c: Coverage, s: Sampling) -> tuple[bool | None, str]:
    octaves = c.bandwidth / c.lowest if c.lowest > 0 else 0.0
    said = f"movement from {c.lowest:.2g} to {c.bandwidth:.2g} Hz" if c.bandwidth > 0 else _movement(c)
    return ((octaves > 20 and c.bandwidth > 1) or (None if octaves > 5 else False)), said


def _commands(c: Coverage, s: Sampling) -> tuple[bool | None, str]:
    low, high = c.command
    if math.isnan(low):
        return False, "the valves never open"
    said = f"open commands from {low:.2g} to {high:.2g}"
    return ((low < 0.1 and high > 0.7) or (None if high > 4 * low else False)), said


def _quick(c: Coverage, s: Sampling) -> tuple[bool | None, str]:
    enough = c.bandwidth > 0 and s.rate > 10 * c.bandwidth
    good = enough and s.rate >= _QUICK and c.bandwidth >= 2
    said = f"sampled at {s.rate:.4g} Hz, {_movement(c)}"
    return good or (None if enough and c.bandwidth > 0.5 else False), said


def _record_quick(s: Sampling) -> str:
    rate = "Sample at 200 Hz or more, and record" if s.rate < _QUICK else "Record"
    return f"{rate} steps or sines above 2 Hz."


def _movement(c: Coverage) -> str:
    return f"movement up to {c.bandwidth:.2g} Hz" if c.bandwidth > 0 else "no movement"


def _accelerates(c: Coverage, s: Sampling) -> tuple[bool | None, str]:
    return _graded(c.bandwidth, 1.5, 0.5), _movement(c)


def _held_out(c: Coverage, s: Sampling) -> tuple[bool | None, str]:
    return _graded(s.runs, 5, 2), f"{s.runs} run{'' if s.runs == 1 else 's'}"


def _noise_by_repeats(c: Coverage, s: Sampling) -> tuple[bool | None, str]:
    plural, verb = ("", "s") if s.repeats == 1 else ("s", "")
    said = f"{s.repeats} run{plural} repeat{verb} an earlier one" if s.repeats else "no run repeats another"
    return _graded(s.repeats, 1, 0), said


ALL, GAS, LINE = "bench muscle cylinder joint", "bench muscle", "bench muscle cylinder"

RULES = (
    Rule(
        "friction of any kind",
        "coulomb_friction viscous_friction",
        ALL,
        "F position",
        _both_ways,
        "Move both ways over the whole range: friction is what differs between the directions.",
    ),
    Rule(
        "dry friction against viscous friction and Stribeck's",
        "coulomb_friction viscous_friction stribeck_friction",
        ALL,
        "F position",
        _speeds,
        "Repeat the same stroke slowly and ten times as fast.",
    ),
    Rule(
        "friction that grows with the pressure",
        "load_dependent_friction coulomb_friction",
        LINE,
        "F P position",
        _moving_levels,
        "Repeat the same stroke at three pressures at least, 1 bar apart.",
    ),
    Rule(
        "hysteresis and backlash",
        "hysteresis backlash",
        ALL,
        "F position",
        _memory,
        "Turn inside the range as well: strokes of the full, half and tenth amplitude, several turns each.",
    ),
    Rule(
        "creep and relaxation",
        "creep",
        LINE,
        "F position",
        _rest,
        "Hold for 10 s after a quick step, at constant pressure.",
    ),
    Rule(
        "geometry and elasticity: diameter, braid, threads, bladder",
        "diameter braid_angle length thread_extensibility bladder_elasticity end_cap",
        GAS,
        "F P position",
        _plane,
        "Move the position at constant pressure, and the pressure at constant position, so that the two are not "
        "correlated.",
    ),
    Rule(
        "offset or gain of force and pressure sensors",
        "force_bias force_gain pressure_bias pressure_gain",
        LINE,
        "F P",
        _levels,
        "Cover the pressures from ambient to the highest; record one run vented and unloaded.",
    ),
    Rule(
        "a leak against an offset of the flow meter",
        "leakage flow_bias",
        GAS,
        "mdot P",
        _sealed,
        "Shut all valves and hold for some seconds at two pressures at least, 1 bar apart.",
    ),
    Rule(
        "dead volume and volume of the muscle",
        "dead_volume diameter",
        GAS,
        "mdot P position",
        _held,
        "Fill and vent while the position is held: isometric runs at two positions.",
    ),
    Rule(
        "warming of the gas: heat transfer, polytropic exponent",
        "heat_transfer polytropic_exponent gas_temperature",
        GAS,
        "mdot P",
        _speeds_of_filling,
        "Fill and vent slowly (below 0.2 Hz) and quickly (above 2 Hz).",
    ),
    Rule(
        "valve: dead zone, saturation, conductance, asymmetry",
        "valve_dead_zone valve_saturation valve_conductance valve_asymmetry",
        "bench",
        "mdot u P",
        _commands,
        "Use small commands (below 10 %) and full ones, to fill and to vent.",
    ),
    Rule(
        "delays and lags of valve and sensors",
        "transport_delay valve_lag pressure_lag force_lag flow_lag",
        ALL,
        "position",
        _quick,
        _record_quick,
    ),
    Rule(
        "inertia and damping of the joint",
        "inertia joint_damping gravity",
        "bench joint",
        "F position",
        _accelerates,
        "Add quicker motion: sines above 1.5 Hz, or steps.",
    ),
    Rule(
        "errors on runs that the fit has not seen",
        "",
        ALL,
        "",
        _held_out,
        "Record six runs at least, of different kinds.",
    ),
    Rule(
        "noise by repeated runs",
        "",
        ALL,
        "",
        _noise_by_repeats,
        "Record one run twice or more: otherwise the noise is estimated from differences between neighbouring samples.",
    ),
)
"""The questions, in the order of the page."""

WORDS = {"F": "a force", "mdot": "a mass flow", "u": "the valve's command", "P": "a pressure", "position": "a position"}


def answerable(columns: list[str], coverage: Coverage, sampling: Sampling, kind: str = "bench") -> list[Answerable]:
    """Return the questions that a log can answer."""
    has = frozenset(key for key, names in _SETS.items() if set(names) & set(columns))
    found = []
    for rule in RULES:
        if kind not in rule.kinds.split():
            continue
        effects = tuple(rule.effects.split())
        lacking = [WORDS[need] for need in rule.needs.split() if need not in has]
        if lacking:
            what = " and ".join(lacking)
            found.append(Answerable(rule.question, effects, "no", f"the log lacks {what}", f"Log {what} as well."))
            continue
        holds, why = rule.test(coverage, sampling)
        answer = "partly" if holds is None else "yes" if holds else "no"
        record = "" if holds else rule.record if isinstance(rule.record, str) else rule.record(sampling)
        found.append(Answerable(rule.question, effects, answer, why, record))
    return found
