"""What a diagnosis says: where simulator and log disagree, which effect is the cause, how much of the gap it closes."""

from __future__ import annotations

import json
import warnings
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any

import pandas as pd

from ...explained import explained_fields
from ...json_data import json_ready
from ..inference.so_far import INTERRUPTED
from .findings import (
    Band,
    Candidate,
    Cause,
    Closure,
    EquationFinding,
    Event,
    HypothesisFinding,
    NextExperiment,
    Region,
    TrajectoryShare,
)
from .rivals import Rival

if TYPE_CHECKING:
    from ..several.history import History, Round
    from ..several.result import Change, LogFinding

SCHEMA = 1
VERDICTS = ("cause", "class", "several", "unknown", "none", "untested")
"""One effect is the cause; one of a class that the data can't split; several causes; a gap that no effect of the
library explains; no gap beyond the noise; nothing on the log that could be tested."""


@explained_fields
@dataclass(repr=False)
class Diagnosis:
    """The answer to: where does the gap lie, what causes it, how far does it shrink.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.gap import diagnose
    >>> nominal = BenchParameters.for_muscle("B")
    >>> log = simulate(nominal, [sine(2, 10, 500), sine(6, 10, 500)], effects=["leakage"])
    >>> found = diagnose(log, nominal, ["leakage"])
    >>> found.verdict, found.causes[0].effects
    ('cause', ('leakage',))
    >>> print(str(found).splitlines()[0])
    One cause: leakage
    """

    verdict: Annotated[str, "One of `VERDICTS`."]
    p_value: Annotated[float, "Probability of as much evidence against the simulator without a gap."]
    equations: Annotated[list[EquationFinding], "Where the gap lies."]
    regions: Annotated[list[Region], "Where the gap lies."]
    bands: Annotated[list[Band], "Where the gap lies."]
    trajectories: Annotated[list[TrajectoryShare], "Where the gap lies."]
    candidates: Annotated[list[Candidate], "The whole library with ``none`` and ``unknown``, the likeliest first."]
    causes: Annotated[list[Cause], "The causes found, the largest share first."]
    closure: Annotated[list[Closure], "How far each equation's gap shrinks."]
    next_run: Annotated[NextExperiment | None, "What to record next."]
    notes: Annotated[list[str], "What the reader must know: what the log lacks, what the noise floor rests on."]
    nominal: Annotated[
        Any,
        "The BenchParameters or Simulator as given, refitted within its tolerances; None where a single equation was "
        "diagnosed.",
    ]
    corrected: Annotated[Any, "The BenchParameters or Simulator with the causes added, or None."]
    windows: Annotated[
        pd.DataFrame,
        "One row per window of 20 ms, equation and side: ``trajectory``, ``time`` (s), ``equation``, ``side``, "
        "the state at its centre, ``before`` and ``after`` (residuals without and with the causes) and ``noise``, "
        "in its unit.",
    ]
    families: Annotated[
        list[Cause],
        "Where the cause is unknown, but effects of the library close most of the gap on held-out runs: what acts "
        'like it, of the grade ``"family"``. The corrected simulator holds these.',
    ] = field(default_factory=list)
    leftover: Annotated[
        dict[str, Any], "For an unknown cause: what the leftover depends on, and its closest symbolic form."
    ] = field(default_factory=dict)
    remainder: Annotated[
        dict[str, Any],
        "What named causes leave: ``equation``, ``share`` of its gap's power, ``rmse`` (in its unit, beyond the "
        "noise), ``regions`` (queries) and ``depends_on`` (signals); empty where nothing is named.",
    ] = field(default_factory=dict)
    with_reserve: Annotated[bool, "Whether a cause is named with reservations, see `Cause`."] = False
    signs: Annotated[
        dict[str, float],
        "What speaks against the names of the best hypothesis, each sign where it is largest over its effects, "
        "see `pamid.gap.diagnosis.signs.signs_of`; empty where no effect explains anything.",
    ] = field(default_factory=dict)
    hypotheses: Annotated[list[HypothesisFinding], "The sets of effects that were refitted, the likeliest first."] = (
        field(default_factory=list)
    )
    deviations: Annotated[
        dict[str, float],
        "How far the parameters with a tolerance were refitted together with the causes, in tolerances.",
    ] = field(default_factory=dict)
    unexplained: Annotated[list[str], "Equations of whose gap the named causes close less than half."] = field(
        default_factory=list
    )
    not_tested: Annotated[dict[str, str], "Equations that were left out, and why."] = field(default_factory=dict)
    cannot_show: Annotated[
        list[str], "Effects of the library that change no equation that was tested: nothing is said about them."
    ] = field(default_factory=list)
    events: Annotated[
        list[Event], "Stretches of a run in which the causes leave far more than elsewhere, the largest first."
    ] = field(default_factory=list)
    rivals: Annotated[
        list[Rival],
        "The explanations that are not ruled out, refitted, the likeliest first: what a next run should separate.",
    ] = field(default_factory=list)
    logs: Annotated[
        list[LogFinding], "For several logs, each with its own parameters of the causes; empty for a single log."
    ] = field(default_factory=list)
    changes: Annotated[list[Change], "Causes that changed between logs, the clearest first."] = field(
        default_factory=list
    )
    rounds: Annotated[list[Round], "The answer after each further log, where this continues an earlier diagnosis."] = (
        field(default_factory=list)
    )
    history: Annotated[
        History | None,
        "The logs and the simulator, from which `pamid.diagnose` continues with further logs and `pamid.next_run` "
        "designs the next one; ``history.write(folder)`` keeps it.",
    ] = field(default=None, repr=False, compare=False)

    @property
    def tested(self) -> bool:
        """Whether anything could be tested."""
        return self.verdict != "untested"

    @property
    def gap(self) -> bool:
        """Whether simulator and log disagree beyond the noise; False as well where nothing could be tested."""
        return self.verdict not in ("none", "untested")

    @property
    def interrupted(self) -> bool:
        """Whether somebody interrupted the search: what it did not find may still be in the library."""
        return INTERRUPTED in self.notes

    @property
    def added(self) -> list[Cause]:
        """What the corrected simulator has and the given one lacks: the causes, or what acts like an unknown one."""
        return self.causes or self.families

    def as_dict(self) -> dict[str, Any]:
        """Return the diagnosis as plain numbers and text, the content of ``diagnosis.json``."""
        return json_ready(
            {
                "schema": SCHEMA,
                "gap": self.gap if self.tested else None,
                "p_value": self.p_value,
                "verdict": self.verdict,
                "where": {
                    "equations": self.equations,
                    "regions": self.regions,
                    "bands": self.bands,
                    "trajectories": self.trajectories,
                    "events": self.events,
                },
                "candidates": self.candidates,
                # The old name of distinguished_by is kept for one more version.
                "causes": [vars(c) | {"told_apart_by": c.distinguished_by} for c in self.causes],
                "families": self.families,
                "closure": self.closure,
                "next_run": self.next_run,
                "next_experiment": self.next_run,  # the old name, for one more version
                "leftover": self.leftover,
                "remainder": self.remainder,
                "with_reserve": self.with_reserve,
                "signs": self.signs,
                "hypotheses": self.hypotheses,
                "unexplained": self.unexplained,
                "not_tested": self.not_tested,
                "cannot_show": self.cannot_show,
                "rivals": self.rivals,
                "logs": self.logs,
                "changes": self.changes,
                "rounds": self.rounds,
                "notes": self.notes,
            }
        )

    @property
    def next_experiment(self) -> NextExperiment | None:
        """The old name of `next_run`, for one version."""
        warnings.warn("Diagnosis.next_experiment is called Diagnosis.next_run.", FutureWarning, stacklevel=2)
        return self.next_run

    def __str__(self) -> str:
        from ...report import answers  # the words are the report's; only printing needs them

        return str(answers(self))

    def __repr__(self) -> str:
        named = ", ".join(" or ".join(cause.effects) for cause in self.causes)
        return f"<{type(self).__name__} {self.verdict}{': ' if named else ''}{named}>"

    def to_json(self) -> str:
        """Return the content of ``diagnosis.json``."""
        return json.dumps(self.as_dict(), indent=1, allow_nan=False)
