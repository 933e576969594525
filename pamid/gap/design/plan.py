"""The plan of the next runs: inputs, expected results, and the meaning of each outcome."""

from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from ...json_data import json_ready
from .rig import Family

AS_IT_IS = "as it is"
"""The rig without a change."""
TELLS = 3.0
"""Expected difference in log-likelihood, in nats, from which a run distinguishes two explanations: odds of twenty."""


@dataclass(frozen=True)
class Expected:
    """What is expected for two explanations, the first one true."""

    truth: tuple[str, ...]
    rival: tuple[str, ...]
    """Their effects."""
    nats: float
    """Expected difference in log-likelihood, the rival refitted."""
    low: float
    high: float
    """80 % interval, from the noise of one recording and the uncertainty of the parameters."""
    belief: float
    """Expected belief in the first one after the run, of these two."""
    equation: str
    """Where the rival's error is largest."""
    size: float
    """Root mean square of that, the rival refitted, in units of the noise."""


@dataclass(frozen=True)
class Plan:
    """What to record next."""

    purpose: str
    """``"discriminate"``, between explanations; ``"parameters"``, where only one is left; ``"unseen"``, where no
    effect is left, to show those that would not have shown; ``"none"``, where there is nothing to ask."""
    runs: list[Any]
    """The runs; empty where none would help."""
    limits: Family
    """What the rig allows."""
    explanations: list[tuple[str, ...]]
    """What is undecided, the likeliest first."""
    beliefs: list[float]
    """Their probabilities today."""
    expected: list[Expected]
    """Each pair of explanations, either one true."""
    clarity: float
    """What the runs were chosen by, in nats: the information that they are expected to give on which explanation is
    true, at most the entropy of the beliefs; on each effect that would not have shown; for parameters, half the
    gain in the logarithm of the determinant of their precision."""
    tells: bool
    """Whether the runs would distinguish the explanations."""
    alike: list[tuple[tuple[str, ...], tuple[str, ...]]] = field(default_factory=list)
    """Pairs that no run within the limits distinguishes."""
    needed: float = float("nan")
    """Seconds that such runs would have to last to distinguish them; NaN where they would not."""
    shrinks: dict[str, float] = field(default_factory=dict)
    """For parameters, how much narrower their intervals become, as a factor."""
    designs: int = 0
    """Designs that were evaluated."""
    usual: float = 0.0
    """Information of a run drawn at random, in nats: the median over those of the whole family. Where it is close to
    `clarity`, no design is much better than any other run."""
    right: float = float("nan")
    right_usual: float = float("nan")
    """Probability that the explanation that is true comes out first: after these runs, and after one drawn at random,
    in the median; NaN where nothing is to be discriminated."""
    closest: list[Any] = field(default_factory=list)
    """Where no run would distinguish them, those that come closest."""
    rig: dict[str, float] = field(default_factory=dict)
    """Numbers of the rig that are to be changed for the runs; empty where it stays as it is."""
    changed: dict[str, float] = field(default_factory=dict)
    """Information of the best runs after each change of the rig, in nats, by change: those that are allowed or, where
    no run distinguishes, some that are proposed."""

    @property
    def names(self) -> list[str]:
        """The names of the runs in a log."""
        return [f"next-{k}-{run.kind}" for k, run in enumerate(self.runs, start=1)]

    def trajectories(self) -> list[Any]:
        """Return the runs for `pamid.bench.simulate`."""
        return [run.trajectory(name) for name, run in zip(self.names, self.runs, strict=True)]

    def set_points(self) -> pd.DataFrame:
        """Return the set points of the runs, sample by sample, for the real rig."""
        parts = [run.set_points(name) for name, run in zip(self.names, self.runs, strict=True)]
        return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()

    def as_dict(self) -> dict[str, Any]:
        """Return the plan as plain numbers and text."""
        found: dict[str, Any] = json_ready(
            {
                **vars(self),
                "runs": [{**run.as_dict(), "words": run.words} for run in self.runs],
                "closest": [{**run.as_dict(), "words": run.words} for run in self.closest],
            }
        )
        return found
