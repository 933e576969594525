"""What the joint is told to do: the trajectories of the study and those that distinguish effects."""

import math
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from ..errors import ParameterError
from ..explained import explained_by, explained_fields

PERIOD = 1e-3
"""Control and sampling period, s."""

LEAD = 0.6
"""Time before the recorded window, s: long enough for the transient of the start to fade."""


@explained_fields
@dataclass(frozen=True, eq=False)
class Trajectory:
    """One run: the reference angle, sample by sample, and the controller's other inputs.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.bench import Trajectory
    >>> q_ref = np.radians(10 * np.tanh(np.linspace(-3, 3, 400)))
    >>> Trajectory("swing", q_ref).n_samples
    400
    """

    name: Annotated[str, "Name of the run in the log."]
    q_ref: Annotated[np.ndarray, "Wanted joint angle, rad, lead-in included; shape (n_samples,)."]
    lead: Annotated[int, "Samples at the start that are not recorded."] = 0
    pressure_offset: Annotated[
        np.ndarray | None, "Added to the nominal pressure of both muscles, Pa; shape (n_samples,)."
    ] = None
    share: Annotated[
        tuple[float, float],
        "How much of the differential pressure each muscle takes; (2, 0) leaves muscle 2 at constant pressure.",
    ] = (1.0, 1.0)
    sealed: Annotated[np.ndarray | None, "Where both valves are shut; shape (n_samples,)."] = field(default=None)

    def __post_init__(self) -> None:
        n = len(self.q_ref)
        if not 0 <= self.lead < n:
            raise ParameterError(
                f"The trajectory {self.name} has {n} samples and a lead-in of {self.lead}.",
                "at least one recorded sample",
                "Lengthen the run or shorten its lead-in.",
            )
        for name in ("pressure_offset", "sealed"):
            value = getattr(self, name)
            if value is not None and len(value) != n:
                raise ParameterError(
                    f"{name} of the trajectory {self.name} has {len(value)} samples.", f"{n}, as q_ref", "Match them."
                )
        if not np.all(np.isfinite(self.q_ref)):
            raise ParameterError(
                f"The reference angle of {self.name} holds NaN or infinity.", "finite angles in rad", "Correct it."
            )

    @property
    def n_samples(self) -> int:
        """Number of recorded samples."""
        return len(self.q_ref) - self.lead


def _times(samples: int, lead: float) -> tuple[np.ndarray, int]:
    n_lead = round(lead / PERIOD)
    return (np.arange(samples + n_lead) - n_lead) * PERIOD, n_lead


def sine(frequency: float, amplitude: float, samples: int, phase: float = 0.0, lead: float = LEAD) -> Trajectory:
    """Return a sine.

    Parameters
    ----------
    frequency : float
        rad/s.
    amplitude : float
        Degrees.
    samples : int
        Recorded samples at 1 kHz.
    phase : float, default=0
        Phase at the first recorded sample, rad.
    lead : float, default=0.6
        Lead-in, s.

    Returns
    -------
    Trajectory
        Named ``sine-<frequency>-<amplitude>``.

    Examples
    --------
    >>> from pamid.bench import sine
    >>> run = sine(4, 15, 500)
    >>> run.name, round(float(abs(run.q_ref).max()), 3)  # rad
    ('sine-4-15', 0.262)
    """
    t, n_lead = _times(samples, lead)
    q = math.radians(amplitude) * np.sin(frequency * t + phase)
    return Trajectory(f"sine-{frequency:g}-{amplitude:g}", q, n_lead)


@explained_by(sine)
def triangle(frequency: float, amplitude: float, samples: int, phase: float = 0.0, lead: float = LEAD) -> Trajectory:
    """Return a triangle wave.

    Returns
    -------
    Trajectory
        Named ``triangle-<frequency>-<amplitude>``.

    Examples
    --------
    >>> from pamid.bench import triangle
    >>> run = triangle(4, 15, 500)
    >>> run.name, round(float(abs(run.q_ref).max()), 3)  # rad
    ('triangle-4-15', 0.262)
    """
    t, n_lead = _times(samples, lead)
    q = math.radians(amplitude) * 2.0 / math.pi * np.arcsin(np.sin(frequency * t + phase))
    return Trajectory(f"triangle-{frequency:g}-{amplitude:g}", q, n_lead)


@explained_by(sine)
def step(start: float, end: float, samples: int, at: float = 0.5, lead: float = LEAD) -> Trajectory:
    """Return a step.

    Parameters
    ----------
    start, end : float
        Angles before and after, degrees.
    at : float, default=0.5
        When the step comes, s from the first recorded sample.

    Returns
    -------
    Trajectory
        Named ``step-<start>-<end>``.

    Examples
    --------
    >>> from pamid.bench import step
    >>> run = step(0, 12, 1000)
    >>> run.name, round(float(abs(run.q_ref).max()), 3)  # rad
    ('step-0-12', 0.209)
    """
    t, n_lead = _times(samples, lead)
    q = np.where(t < at - 0.5 * PERIOD, math.radians(start), math.radians(end))
    return Trajectory(f"step-{start:g}-{end:g}", q, n_lead)


@explained_by(sine)
def multisine(
    frequency: float, amplitude: float, samples: int, seed: int = 0, tones: int = 6, lead: float = LEAD
) -> Trajectory:
    """Return a sum of sines of random phase.

    Parameters
    ----------
    frequency : float
        Highest of the frequencies, of which the others are fractions, rad/s.
    amplitude : float
        Peak, degrees.
    seed : int, default=0
        Seed of the phases.
    tones : int, default=6
        Number of sines.

    Returns
    -------
    Trajectory
        Named ``multisine-<frequency>-<amplitude>``.

    Examples
    --------
    >>> from pamid.bench import multisine
    >>> run = multisine(10, 15, 500)
    >>> run.name, round(float(abs(run.q_ref).max()), 3)  # rad
    ('multisine-10-15', 0.262)
    """
    t, n_lead = _times(samples, lead)
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * math.pi, tones)
    w = frequency * np.arange(1, tones + 1) / tones
    q = np.sin(w[:, None] * t + phases[:, None]).sum(0)
    q *= math.radians(amplitude) / np.abs(q).max()
    return Trajectory(f"multisine-{frequency:g}-{amplitude:g}", q, n_lead)


@explained_by(sine)
def hold(angle: float, samples: int, lead: float = LEAD) -> Trajectory:
    """Return a run that holds an angle after a step from 0 in the middle of the lead-in.

    Parameters
    ----------
    angle : float
        Degrees.

    Returns
    -------
    Trajectory
        Named ``hold-<angle>``.

    Examples
    --------
    >>> from pamid.bench import hold
    >>> run = hold(10, 500)
    >>> run.name, round(float(abs(run.q_ref).max()), 3)  # rad
    ('hold-10', 0.175)
    """
    t, n_lead = _times(samples, lead)
    q = np.where(t < -0.5 * lead, 0.0, math.radians(angle))
    return Trajectory(f"hold-{angle:g}", q, n_lead)


@explained_by(hold)
def sealed_hold(angle: float, samples: int, after: float = 0.5, lead: float = LEAD) -> Trajectory:
    """Return a hold during which both valves shut.

    Parameters
    ----------
    after : float, default=0.5
        When the valves shut, s from the first recorded sample.

    Returns
    -------
    Trajectory
        Named ``sealed-<angle>``.

    Examples
    --------
    >>> from pamid.bench import sealed_hold
    >>> run = sealed_hold(10, 1000)
    >>> run.name, round(float(abs(run.q_ref).max()), 3)  # rad
    ('sealed-10', 0.175)
    """
    held = hold(angle, samples, lead)
    t, n_lead = _times(samples, lead)
    return Trajectory(f"sealed-{angle:g}", held.q_ref, n_lead, sealed=t >= after - 0.5 * PERIOD)


@explained_by(sine)
def isobaric(frequency: float, amplitude: float, samples: int, muscle: int = 1, lead: float = LEAD) -> Trajectory:
    """Return a sine during which one muscle stays at constant pressure and the other one moves the joint.

    Parameters
    ----------
    muscle : int, default=1
        The one at constant pressure, 1 or 2.

    Returns
    -------
    Trajectory
        Named ``isobaric<muscle>-<frequency>-<amplitude>``.

    Examples
    --------
    >>> from pamid.bench import isobaric
    >>> run = isobaric(4, 15, 500)
    >>> run.name, round(float(abs(run.q_ref).max()), 3)  # rad
    ('isobaric1-4-15', 0.262)
    """
    if muscle not in (1, 2):
        raise ParameterError(f"There is no muscle {muscle!r}.", "1 or 2", "Name one of the two muscles.")
    moved = sine(frequency, amplitude, samples, lead=lead)
    name = f"isobaric{muscle}-{frequency:g}-{amplitude:g}"
    return Trajectory(name, moved.q_ref, moved.lead, share=(0.0, 2.0) if muscle == 1 else (2.0, 0.0))


@explained_by(hold)
def isometric(angle: float, rise: float, samples: int, frequency: float = 1.0, lead: float = LEAD) -> Trajectory:
    """Return a run that holds an angle while both pressures go up and down.

    Parameters
    ----------
    rise : float
        How far the pressures rise, Pa.
    frequency : float, default=1
        Of the rise and fall, rad/s.

    Returns
    -------
    Trajectory
        Named ``isometric-<angle>-<rise in kPa>``.

    Examples
    --------
    >>> from pamid.bench import isometric
    >>> run = isometric(10, 5e4, 500)
    >>> run.name, round(float(abs(run.q_ref).max()), 3)  # rad
    ('isometric-10-50', 0.175)
    """
    held = hold(angle, samples, lead)
    t, n_lead = _times(samples, lead)
    offset = rise * 0.5 * (1.0 - np.cos(frequency * np.maximum(t, 0.0)))
    return Trajectory(f"isometric-{angle:g}-{rise / 1e3:g}", held.q_ref, n_lead, pressure_offset=offset)
