"""The sizes of a log's signals, and how they scale effects at ports."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from .base import Limited
from .links import Link
from .structure import JointPort

_RUN = 10.0
_RUNS = 0.5, 100.0


class SignalSizes(NamedTuple):
    """Sizes of the signals of a log at the ports of a simulator."""

    spans: Mapping[str, float]
    """Range of each state, input and output."""
    tops: Mapping[str, float]
    """Largest size of each state."""
    lows: Mapping[str, float]
    """Smallest value of each state."""
    gaps: Mapping[str, float]
    """Size of a relevant force or flow at a joint or state, in the unit of its rate."""
    readings: Sequence[str]
    """Outputs and states that sensors measured."""
    pushes: Mapping[tuple[str, str], float]
    """Influence of an input on the rate of a state."""
    joints: Sequence[JointPort]
    """The joints."""
    run_length: float
    interval: float
    """Typical length of a run and sampling interval, s."""
    feeds: Mapping[str, str] = MappingProxyType({})
    """The state that a chamber feeds, by the chamber's own."""
    ends: Mapping[str, float] = MappingProxyType({})
    """Where readings stand exactly at the end of a sensor's range, that end."""
    one_sided: Mapping[str, int] = MappingProxyType({})
    """The side of those that read farther on the other one: 1 for an upper end, -1 for a lower one."""
    highs: Mapping[str, float] = MappingProxyType({})
    """Largest value of each state, where that is not its smallest and its range."""
    again: float = 0.0
    """Length of the longest run, s, where there are several."""
    links: Sequence[Link] = ()
    """Pairs of ports between which effects can act, whose differences have ranges in `spans`."""

    limited: Mapping[str, Limited] = MappingProxyType({})
    """The actuators whose forces a number may limit, by input, with the largest force along the log."""

    @property
    def time(self) -> float:
        """Scale of one second of the log, s."""
        return typical_second(self.run_length, self.interval)

    @property
    def driven(self) -> set[str]:
        """The states that an input of their own pushes, and no other state; an input at rest pushes none."""
        pushed: dict[str, list[str]] = {}
        for of, state in self.pushes:
            if self.spans.get(of, 0.0) > 0.0:
                pushed.setdefault(of, []).append(state)
        return {states[0] for states in pushed.values() if len(states) == 1}

    @classmethod
    def together(cls, each: Sequence[SignalSizes]) -> SignalSizes:
        """Return the sizes of the signals of several logs of one simulator."""

        def largest(what: str) -> dict[str, float]:
            found = [getattr(s, what) for s in each]
            return {name: max(f[name] for f in found if name in f) for f in found for name in f}

        lows, highs = (_extremes(each, which) for which in (min, max))
        spans = largest("spans")
        return each[0]._replace(
            spans={name: max(span, highs.get(name, 0.0) - lows.get(name, 0.0)) for name, span in spans.items()},
            tops=largest("tops"),
            lows=lows,
            highs=highs,
            again=max(s.again for s in each),
            gaps=largest("gaps"),
            readings=list(dict.fromkeys(n for s in each for n in s.readings)),
            ends={k: v for s in reversed(each) for k, v in s.ends.items()},
            one_sided={k: v for s in reversed(each) for k, v in s.one_sided.items()},
            limited={k: max(s.limited[k] for s in each if k in s.limited) for s in each for k in s.limited},
        )

    def turns(self, name: str) -> bool:
        """Return whether a signal has both signs: otherwise nothing shows how an effect depends on them."""
        low = self.lows.get(name, -1.0)
        return low < 0.0 < low + self.spans.get(name, 0.0)


def typical_second(run_length: float, interval: float) -> float:
    """Return the scale of one second of a log, s: runs of unusual length are scaled to usual ones."""
    usual = _RUNS[0] <= run_length <= _RUNS[1] and interval <= 0.02
    return 1.0 if usual or run_length <= 0.0 else _RUN / run_length


def _extremes(each: Sequence[SignalSizes], which: Callable[..., float]) -> dict[str, float]:
    """Return the smallest or largest value of each signal over several logs."""
    found: dict[str, list[float]] = {}
    for s in each:
        for name, low in s.lows.items():
            high = s.highs.get(name, low + s.spans.get(name, 0.0))
            found.setdefault(name, []).append(low if which is min else high)
    return {name: which(values) for name, values in found.items()}
