"""Everything about a log in one place."""

from dataclasses import dataclass, field, replace
from typing import Annotated, Any

import pandas as pd

from ..bench.parameters import BenchParameters
from ..equations.log import BenchLog
from ..equations.unit_doubts import unit_doubts
from ..errors import EmptyLogError, PamidError
from ..explained import explained_fields
from ..json_data import json_ready
from ..signals.frames import as_pandas
from ..signals.guess import guess_kind
from ..systems import System
from .answerable import Answerable, answerable
from .channels import Channel, channels_of
from .coverage import Coverage, coverage_of, first_of
from .sampling import Sampling, sampling_of
from .scales import scale_doubts
from .separation import Separation, separation

_UNITS = {"frequency": " rad/s", "amplitude": "°", "angle": "°", "start": "°", "end": "°", "rise": " Pa"}
_LEAST_BITS = 6.0
_LEAST_RATE = 20.0  # samples in a period of the quickest movement


@explained_fields
@dataclass(frozen=True)
class Survey:
    """The content of a log, and what can be identified from it.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.survey.survey import survey
    >>> log = simulate(BenchParameters.for_muscle("B"), [sine(4, 15, 800), sine(8, 10, 800)])
    >>> found = survey(log)
    >>> found.sampling.runs, [c.name for c in found.channels][:2]
    (2, ['q_ref', 'q'])
    """

    sampling: Annotated[Sampling, "Runs and clock."]
    channels: Annotated[list[Channel], "The channels."]
    coverage: Annotated[Coverage, "What it excites."]
    answers: Annotated[list[Answerable], "What can be answered from it."]
    separations: Annotated[list[Separation], "For a bench with a simulator: each effect of the library."] = field(
        default_factory=list
    )
    next_run: Annotated[dict[str, Any] | None, "For a bench with a simulator: the run that would distinguish most."] = (
        None
    )
    warnings: Annotated[list[str], "What is wrong or doubtful."] = field(default_factory=list)
    record: Annotated[list[str], "What to record next, the most useful first."] = field(default_factory=list)
    notes: Annotated[list[str], "What a reader should know besides."] = field(default_factory=list)

    def classes(self) -> list[tuple[str, ...]]:
        """Return groups of effects that this log could not distinguish, the largest first."""
        seen = {s.effect: set(s.alike) for s in self.separations if s.seen}
        groups: list[set[str]] = []
        for name, others in seen.items():
            both = {o for o in others if name in seen.get(o, set())}
            if both:
                touching = [g for g in groups if g & (both | {name})]
                merged = set.union({name}, both, *touching)
                groups = [g for g in groups if g not in touching] + [merged]
        return [tuple(sorted(g)) for g in sorted(groups, key=len, reverse=True)]

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain numbers and text, as ``pamid check --json`` prints it."""
        return {**json_ready(self), "classes": [list(g) for g in self.classes()]}


def survey(log: pd.DataFrame, simulator: BenchParameters | System | None = None) -> Survey:
    """Look through a log.

    Parameters
    ----------
    log : DataFrame
        Tidy log, as `pamid.read_log` returns it; missing values may be kept.
    simulator : BenchParameters or System, optional
        Simulator of the bench, with which each effect of the library is tried on the log; or page of a system.

    Returns
    -------
    Survey
        What was found. Nothing in the data makes it fail but a log without rows.

    Raises
    ------
    EmptyLogError
        The log has no rows.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.survey.survey import survey
    >>> bench = BenchParameters.for_muscle("B")
    >>> found = survey(simulate(bench, [sine(4, 15, 800)], seed=0))
    >>> found.sampling.runs, round(found.sampling.rate), found.coverage.position
    (1, 1000, 'q')
    """
    log = as_pandas(log)
    if not len(log):
        raise EmptyLogError("The log has no rows.", "at least one run", "Check how it was written.")
    if "trajectory" not in log.columns:
        log = log.assign(trajectory="0")
    channels = channels_of(log)
    imposed = [n for n in ("q_ref", "x", "eps", "q", "P", "P1", "F", "F1") if first_of(log, (n,))]
    sampling = sampling_of(log, imposed)
    coverage = coverage_of(log, sampling)
    columns = [c.name for c in channels if c.missing < 1.0]
    warnings = _clock_warnings(sampling, coverage) + [w for c in channels for w in _channel_warnings(c)]
    notes: list[str] = []
    separations: list[Separation] = []
    best: dict[str, Any] | None = None
    kind = guess_kind(set(columns)) or "bench"
    if isinstance(simulator, System):
        kind = simulator.kind
        warnings += _system_warnings(log, simulator)
    elif simulator is not None:
        try:
            bench_log = BenchLog.of(log)
            warnings += unit_doubts(bench_log, simulator)
            separations, best = separation(bench_log, simulator)
        except PamidError as error:
            warnings.append(f"The simulator could not be compared with the log: {error}")
        if not simulator.tolerance:
            warnings.append("The simulator file states no tolerances: a number that is a little off shows as a gap.")
    else:
        warnings += scale_doubts(log)
        notes.append("With --sim each effect of the library is tried on the log as well.")
    if not sampling.repeats:
        notes.append(
            "The noise is estimated from differences between neighbouring samples, since no run repeats another."
        )
    answers = answerable(columns, coverage, sampling, kind)
    found = Survey(sampling, channels, coverage, answers, separations, best, warnings, [], notes)
    return replace(found, record=_record(found))


def _clock_warnings(s: Sampling, c: Coverage) -> list[str]:
    found = []
    if s.jitter > 0.1:
        found.append(f"The sampling period varies by {s.jitter:.0%}: rates and delays are uncertain by as much.")
    if s.gaps:
        found.append(f"{s.gaps} gap(s) in time, the longest of {s.longest_gap:.3g} s; they are not bridged.")
    if s.mixed:
        found.append("The runs are sampled at different rates; a diagnosis of one equation takes their median.")
    if s.shortest < 0.5:
        found.append(
            f"The shortest run lasts {s.shortest:.2g} s: the ends of a run are left out, so little of it remains."
        )
    if c.bandwidth > 0 and s.rate < _LEAST_RATE * c.bandwidth:
        found.append(
            f"{s.rate:.3g} samples a second for movement up to {c.bandwidth:.2g} Hz: rates lose their peaks below "
            f"{_LEAST_RATE:g} samples a period."
        )
    return found


def _channel_warnings(c: Channel) -> list[str]:
    found = []
    if c.missing == 1.0:
        return [f"{c.name} holds no reading."]
    if c.missing > 0:
        burst = f", the longest stretch {c.longest_missing:.2g} s" if c.longest_missing > 0 else ""
        found.append(f"{c.name}: {100 * c.missing:.3g} % of the readings are missing{burst}.")
    if c.frozen > 0:
        found.append(f"{c.name} stays at one value for long while others move in {100 * c.frozen:.3g} % of the rows.")
    if c.clipped:
        end = {"low": "the lower end", "high": "the upper end", "both": "both ends"}[c.clipped]
        found.append(
            f"{c.name} piles up at {end} of its range: it looks clipped. Either the sensor saturates there, or "
            "what it measures is at a stop, which then belongs in the model."
        )
    if c.bits < _LEAST_BITS and c.moves and c.high - c.low > 4 * c.step and c.name not in ("branch", "enabled", "gain"):
        found.append(f"{c.name} has {2**c.bits:.0f} steps over its range: its rate will be coarse.")
    return found


def _system_warnings(log: pd.DataFrame, system: System) -> list[str]:
    try:
        system.require(log)
    except PamidError as error:
        return [f"The log does not suit the simulator file: {error}"]
    return system.doubts(log)


def _record(s: Survey) -> list[str]:
    """Return the next recordings: the run that splits most, then those for questions without an answer."""
    told = []
    if s.next_run is not None:
        own = {k: v for k, v in s.next_run.items() if k not in ("splits", "kind")}
        settings = ", ".join(f"{k.replace('_', ' ')} {v:g}{_UNITS.get(k, '')}" for k, v in own.items())
        splits = [str(name).replace("_", " ") for name in s.next_run["splits"][:6]]
        names = ", ".join(splits) + (" and more" if len(s.next_run["splits"]) > 6 else "")
        kind = str(s.next_run["kind"]).replace("_", " ")
        told.append(f"A run of the kind {kind} ({settings}): it would show or distinguish {names}.")
    asked = [a.record for answer in ("no", "partly") for a in s.answers if a.answer == answer and a.record]
    return told + list(dict.fromkeys(asked))
