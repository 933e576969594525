"""What a diagnosis is made of: findings about equations and regions, candidates, causes, closure, the next run."""

import math
import warnings
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Self

from ...explained import explained_fields

Interval = tuple[float, float]


@explained_fields
@dataclass(frozen=True)
class EquationFinding:
    """The share of the gap in one equation.

    Examples
    --------
    >>> from pamid.gap import EquationFinding
    >>> EquationFinding("flow", share=0.99, p_value=1e-6, excess=12.0).equation
    'flow'
    """

    equation: Annotated[str, "Its name."]
    share: Annotated[float, "Share of the explainable gap, 0 to 1; over all equations it adds to one."]
    p_value: Annotated[float, "Probability of at least this excess without a gap."]
    excess: Annotated[float, "Root mean square of the residual beyond its noise, in units of the noise."]
    unit: Annotated[str, "Unit of its residual."] = ""


@explained_fields
@dataclass(frozen=True)
class Region:
    """A region of the state in which the gap lies.

    Examples
    --------
    >>> from pamid.gap import Region
    >>> region = Region("force", "deps1 > 0 and P1 > 3e5", share=0.8, samples=0.3)
    >>> f"{region.share:.0%} of the gap in {region.samples:.0%} of the samples"
    '80% of the gap in 30% of the samples'
    """

    equation: Annotated[str, "Its equation."]
    query: Annotated[
        str, "A query for `pandas.DataFrame.query` on the table that `pamid.gap.state_table` makes of a log."
    ]
    share: Annotated[float, "Share of the equation's gap that lies in it."]
    samples: Annotated[float, "Share of the samples that lie in it."]


@explained_fields
@dataclass(frozen=True)
class Band:
    """The share of an equation's gap in a band of frequencies.

    Examples
    --------
    >>> from pamid.gap import Band
    >>> Band("force", from_hz=0.0, to_hz=1.0, share=0.9).to_hz  # Hz
    1.0
    """

    equation: Annotated[str, "Its equation."]
    from_hz: Annotated[float, "The band, Hz."]
    to_hz: Annotated[float, "The band, Hz."]
    share: Annotated[float, "Share of the equation's gap."]


@explained_fields
@dataclass(frozen=True)
class Event:
    """A stretch of a run in which the residual of the causes is far beyond the noise and its usual size.

    Examples
    --------
    >>> from pamid.gap import Event
    >>> event = Event("joint", "b", begins=12.3, ends=14.1, excess=35.0)
    >>> f"{event.ends - event.begins:.1f} s"
    '1.8 s'
    """

    equation: Annotated[str, "Its equation."]
    trajectory: Annotated[str, "The name of the run."]
    begins: Annotated[float, "Time of its first and last window, s."]
    ends: Annotated[float, "Time of its first and last window, s."]
    excess: Annotated[float, "Largest error in it, in units of the noise."]


@explained_fields
@dataclass(frozen=True)
class TrajectoryShare:
    """The share of the gap in one run.

    Examples
    --------
    >>> from pamid.gap import TrajectoryShare
    >>> TrajectoryShare("sine-4-15", share=0.6).trajectory
    'sine-4-15'
    """

    trajectory: Annotated[str, "Its name."]
    share: Annotated[float, "Share of the whole gap."]


@explained_fields
@dataclass(frozen=True)
class ParameterEstimate:
    """An identified parameter of an effect.

    Examples
    --------
    >>> from pamid.gap import ParameterEstimate
    >>> amplitude = ParameterEstimate(6.0, "N", (5.7, 6.3))
    >>> f"{amplitude.value:g} {amplitude.unit}"
    '6 N'
    """

    value: Annotated[float, "The estimate."]
    unit: Annotated[str, "Its unit."]
    ci90: Annotated[Interval, "90 % interval over runs; infinite where the data do not bound it."]
    at_bound: Annotated[bool, "Whether the fit ended at a physical bound that is not its usual value."] = False
    physical: Annotated[
        str,
        'The same as a force or torque, such as ``"349 N"``, where it is in the unit of an acceleration or of a '
        "command and a parameter of the simulator is the mass; else empty.",
    ] = ""

    def scaled(self, factor: float, unit: str) -> Self:
        """Return the estimate in another unit; one of its unit is ``factor`` of the other."""
        low, high = sorted((self.ci90[0] * factor, self.ci90[1] * factor))
        return replace(self, value=self.value * factor, unit=unit, ci90=(low, high))


@explained_fields
@dataclass(frozen=True)
class Candidate:
    """An effect of the library, ``none`` or ``unknown``, and its evidence.

    Examples
    --------
    >>> from pamid.gap import Candidate
    >>> Candidate("leakage", confidence=0.98, score=812.0, closed_share=0.99, ruled_out="").effect
    'leakage'
    """

    effect: Annotated[str, "Name."]
    confidence: Annotated[float, "Probability; over all candidates it adds to one."]
    score: Annotated[float, "Logarithm of the likelihood ratio to no effect, less a penalty for each parameter."]
    closed_share: Annotated[float, "Share of the explainable gap that it closes on this log, by itself."]
    ruled_out: Annotated[str, "Why it is not the answer; empty for what is."] = ""
    where: Annotated[str, "Port of the simulator at which it would act; empty where the effect itself says so."] = ""


@explained_fields
@dataclass(frozen=True)
class Cause:
    """One cause; more than one name where the data cannot distinguish them.

    Examples
    --------
    >>> from pamid.gap import Cause
    >>> either = Cause(("gas_temperature", "dead_volume"), "flow", 0.97, 1.0, share_ci90=(0.9, 1.0), parameters={})
    >>> len(either.effects)  # a class: the log cannot tell which
    2
    """

    effects: Annotated[tuple[str, ...], "The effect, or the class of effects, the likeliest first."]
    equation: Annotated[str, "Equation in which most of its share lies."]
    confidence: Annotated[float, "Probability that the cause is among `effects`."]
    share: Annotated[float, "Share of the explainable gap that it closes (with several causes: its Shapley value)."]
    share_ci90: Annotated[Interval, "90 % interval over runs."]
    parameters: Annotated[dict[str, ParameterEstimate], "Parameters of the first effect."]
    distinguished_by: Annotated[str | None, "What would split the class."] = None
    where: Annotated[
        tuple[str, ...],
        "Port of the simulator at which each of the effects acts; empty where the effects themselves say so.",
    ] = ()
    others: Annotated[
        tuple[dict[str, ParameterEstimate], ...],
        "Parameters of the other effects of a class, each fitted in the place of the first.",
    ] = ()
    with_reserve: Annotated[
        bool,
        'Whether it stands for the effect "or something that looks like it on this log": its estimated '
        "probability is at least one half, but below the bar whose aim is at most one wrong name in twenty.",
    ] = False
    signs: Annotated[dict[str, float], "What its confidence rests on, see `pamid.gap.diagnosis.signs.signs_of`."] = (
        field(default_factory=dict)
    )
    grade: Annotated[
        str,
        '``"sure"``, ``"reserve"`` (see `with_reserve`), or ``"family"``: it closes most of the gap on held-out '
        "runs, and the remainder shows that the cause is another, similar effect.",
    ] = "sure"
    family: Annotated[str, 'What kind of effect it is, such as ``"friction"``.'] = ""

    @property
    def told_apart_by(self) -> str | None:
        """The old name of `distinguished_by`, for one version."""
        warnings.warn("Cause.told_apart_by is called Cause.distinguished_by.", FutureWarning, stacklevel=2)
        return self.distinguished_by


@explained_fields
@dataclass(frozen=True)
class Closure:
    """How far the gap of an equation shrinks once the causes are added, predicted for unseen runs.

    Examples
    --------
    >>> from pamid.gap import Closure
    >>> share = {"closed_share": 0.999, "ci90": (0.998, 1.0)}
    >>> force = Closure("force", rmse_before=5.6, rmse_after=0.1, noise_floor=0.03, unit="N", **share)
    >>> f"{force.rmse_before:g} {force.unit} becomes {force.rmse_after:g} {force.unit}"
    '5.6 N becomes 0.1 N'
    """

    equation: Annotated[str, "Its equation."]
    rmse_before: Annotated[
        float, "Root mean square residual of runs that were held out of the fit, in the equation's unit."
    ]
    rmse_after: Annotated[
        float, "Root mean square residual of runs that were held out of the fit, in the equation's unit."
    ]
    noise_floor: Annotated[float, "What the channels' noise alone would leave, in the equation's unit."]
    closed_share: Annotated[float, "(MSE before − after) / (MSE before − noise floor), 0 to 1."]
    ci90: Annotated[Interval, "90 % interval over runs."]
    unit: Annotated[str, "The equation's unit."] = ""
    alone: Annotated[
        float,
        "Share that the corrected simulator closes on this log, where the fit allows for more than it holds, such "
        "as inputs half a sample early; NaN where it does not.",
    ] = math.nan
    allowed: Annotated[
        str,
        'What the fit allows for that closes most of the rest, such as ``"timing of road"``; empty where `alone` '
        "is not below `ci90`.",
    ] = ""
    again: Annotated[
        float,
        "Share that the corrected simulator, run again on this log, closes; NaN where it was not run, or its errors do "
        "not compare.",
    ] = math.nan

    def closed_by(self, rmse: float) -> float:
        """Return the share of the explainable mean square, 0 to 1, that is closed where a root mean square error is
        left.

        It is `closed_share` where nothing is explainable.
        """
        room = self.rmse_before**2 - self.noise_floor**2
        return min(max((self.rmse_before**2 - rmse**2) / room, 0.0), 1.0) if room > 0.0 else self.closed_share


@explained_fields
@dataclass(frozen=True)
class NextExperiment:
    """What to record next.

    Examples
    --------
    >>> from pamid.gap import NextExperiment
    >>> run = {"kind": "isobaric", "frequency": 4.0, "amplitude": 10.0}  # rad/s, degrees
    >>> NextExperiment(run, ("dead_volume", "gas_temperature"), expected=730.0, reason="they differ there").separates
    ('dead_volume', 'gas_temperature')
    """

    trajectory: Annotated[dict[str, Any], "``kind`` and its numbers, as ``pamid simulate`` takes them."]
    separates: Annotated[tuple[str, ...], "The two explanations that it would distinguish."]
    expected: Annotated[float, "Expected logarithm of their likelihood ratio after one such run, each refitted."]
    reason: Annotated[str, "One sentence."] = ""


@dataclass(frozen=True)
class HypothesisFinding:
    """A set of effects that was fitted to the whole of a log, and its evidence."""

    effects: tuple[str, ...]
    """The effects."""
    gain: float
    """Logarithm of its evidence over that of no effect."""
    log_likelihood: float
    """Gain in log-likelihood alone, its forms taken as exact and its parameters as free."""
