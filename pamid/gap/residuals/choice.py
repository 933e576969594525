"""Whether equations can be tested on a log directly, or have to be predicted over stretches."""

from __future__ import annotations

import numpy as np

from ...signals.ends import end_of
from ...signals.noise import quantisation_step
from ..settings import LEAST_GAIN
from .bends import MATTERS
from .direct import DirectEvidence
from .kinematic import both_measured
from .segments import SHORTEST
from .shooting import ShootingEvidence
from .stretches import BELOW, SHORT
from .tolerances import rms
from .window_length import HIDDEN, most_samples, window_noise

ENDED = (
    "A reading stands at the end of its sensor's range. This kind of model is evaluated row by row, so such rows are "
    "mistaken for real motion; simulating it over stretches would avoid this, but take too long. Leave these rows out."
)
PULLED = (
    "Noise in the readings biases fitted parameters by several standard errors: this kind of model is evaluated row by "
    "row; simulating it over stretches would avoid the bias, but take too long. Runs with larger motion help; "
    "more runs like these, or filtering the log, do not."
)
HIDES = (
    "Noise in the readings hides slow errors of the model's rates: this kind of model is evaluated row by row; "
    "simulating it over stretches, in which such errors add up and show, would take too long. Longer runs or "
    "less noise in the readings help."
)
BY_POSITION = (
    "The acceleration is derived from {position}, which gives it with less noise than {velocity} does; the two are "
    "also compared with each other."
)
AHEAD = 16
"""Rows over which it is asked whether a simulator goes on below zero: one alone may be less than the noise."""


def beside_inputs(found: ShootingEvidence) -> ShootingEvidence:
    """Return predictions over stretches so short that the noise of inputs counts no more than that of readings.

    In predictions that noise adds up, the longer the more, until it has the size of what an effect leaves, and lasts as
    long. A gap that is larger, but too small for stretches as short, is asked for over the shortest that show it.
    Inputs that look noisy may be exact, too, as a controller's are: then residuals are smaller than that noise.
    """
    shorter, simulator = found, found.simulator
    if simulator.form != "ode" or simulator.one_by_one:  # which would take too long
        return found
    shows, exact = found if found.beyond_inputs else None, False
    while shorter.by_inputs > 1.0:
        exact = shorter.exact_inputs  # the shorter the stretches, the better their noise is known
        if max(s.stop - s.first for s in shorter.stretches) < 2 * SHORTEST:
            break
        shorter = ShootingEvidence(
            found.log, found.given, refit=found.refit, lines=found.lines, like=shorter, halves=True
        )
        shows = shorter if shorter.beyond_inputs else shows
    chosen = found if exact else shows or shorter
    chosen.longer = None if chosen is found else found
    return chosen


def sensor_ends(found: DirectEvidence) -> bool:
    """Return whether a reading stands at the end of its sensor's range: how far the motion goes, predictions show."""
    ode, channels = found.simulator.form == "ode", found.log.channels
    return ode and any(end_of(channels[n], found.log.spans) for n in found.simulator.states if n in channels)


def noise_pulls(found: DirectEvidence) -> bool:
    """Return whether noise in modelled rates moves a parameter by as much as a false alarm needs."""
    return found.simulator.form == "ode" and found.pulled[0] > LEAST_GAIN


def noise_pulls_together(found: DirectEvidence) -> bool:
    """Return whether it moves parameters by as much that can compensate each other."""
    return found.simulator.form == "ode" and found.pulled[1] > LEAST_GAIN


def bridged(found: DirectEvidence) -> DirectEvidence:
    """Return the shortest windows in which noise pulls no parameter, where missing rows part the given ones.

    Windows bridge gaps of a quarter of their samples, and noise adds up between those that do not follow each other.
    """

    def pulls(one: DirectEvidence) -> bool:
        return noise_pulls(one) or noise_pulls_together(one)

    if not found.log.lost.any() or not pulls(found):
        return found
    n, most, other = 4 * (found.n // 4 + 1), most_samples(found.log), found
    while n <= most and pulls(other):
        other = DirectEvidence(found.log, found.given, found.derived, found.refit, found.lines, n)
        n *= 2
    return found if pulls(other) else other


def better_derived(found: DirectEvidence) -> dict[str, str]:
    """Return the logged velocities, by positions, whose noise hides more of an acceleration than the position's."""
    log, better = found.log, dict[str, str]()
    if found.runs_within_steps:  # positions at the rows do not show what happens between them
        return better
    for position, velocity in both_measured(found.pairs, log).items():
        noises = [window_noise(found.channel_noise(name), found.n, order, log.dt)
                  for name, order in ((position, 2), (velocity, 1))]  # fmt: skip
        if noises[0] < noises[1]:
            better[position] = velocity
    return better


def motion_is_hidden(found: DirectEvidence) -> bool:
    """Return whether noise, steps or the time between rows hide the motion of positions from row to row."""
    buried = any(noise > rms(modelled) for noise, modelled, _ in _accelerations(found))
    return bool(found.derived) and (buried or coarse(found) or fast(found))


def noise_hides(found: DirectEvidence) -> bool:
    """Return whether the noise of a derived acceleration hides something of interest, which predictions may show."""
    return bool(found.derived) and any(noise > HIDDEN * rms(modelled) for noise, modelled, _ in _accelerations(found))


def rates_are_hidden(found: DirectEvidence) -> bool:
    """Return whether the noise of a rate hides slow errors, which add up in predictions.

    So it is where a log has too few rows for windows as long as that noise asks for. `motion_is_hidden` judges
    accelerations, whose errors grow faster in predictions.
    """
    simulator, log = found.simulator, found.log
    if simulator.form != "ode" or found.derived or found.n < most_samples(log):
        return False
    sizes = [rms(found.modelled[b.row, : log.n]) for b in found.balances]
    return any(np.median(found.noise[p]) > HIDDEN * size > 0.0 for p, size in zip(found.parts, sizes, strict=True))


PREDICTED_IF = (
    (rates_are_hidden, 0, HIDES), (sensor_ends, 0, ENDED), (noise_pulls, 0, PULLED),
    (noise_pulls_together, SHORT, PULLED),
)  # fmt: skip
"""What predictions avoid, the longest stretches that it takes (0: whole runs), and what is said of a simulator for
which they take too long."""


def coarse(found: DirectEvidence) -> bool:
    """Return whether a velocity is derived from a position that moves by less than its resolution between rows."""
    for position, velocity in found.derived.items():
        way = np.abs(found.signals()[velocity]) * found.log.dt
        if rms(way) < quantisation_step(found.log.channels[position]):
            return True
    return False


def fast(found: DirectEvidence) -> bool:
    """Return whether an acceleration curves so much between rows, a'' h²/12, that lines miss its means."""
    begins = found.log.starts
    for noise, start, end in _accelerations(found):
        bend = np.diff(end - start, prepend=0.0) / 12.0
        bend[begins], bend[np.append(begins[1:], found.log.n) - 1] = 0.0, 0.0
        if rms(bend) > max(noise, MATTERS * rms(start)):
            return True
    return False


def _accelerations(found: DirectEvidence) -> list[tuple[float, np.ndarray, np.ndarray]]:
    """Return the noise of accelerations, and their modelled values at both ends of each step."""
    if found.says_forces:
        return []
    n = found.log.n
    return [
        (float(np.median(found.noise[part])), found.modelled[b.row, :n], found.modelled[b.row, n:])
        for part, b in zip(found.parts, found.balances, strict=True)
        if b.order == 2
    ]


def sign_may_be_lost(found: DirectEvidence) -> bool:
    """Return whether a nonnegative reading of a state belongs to a simulated state that goes below zero nearby."""
    log = found.log
    for name, rate in zip(found.simulator.states, found.modelled, strict=True):
        x = log.channels.get(name)
        if x is None or np.min(x) < (least := -BELOW * found.channel_noise(name)):
            continue
        way = np.concatenate([[0.0], np.cumsum(rate[: log.n]) * log.dt])
        for rows in range(1, min(AHEAD, log.n) + 1):
            below = x[: log.n + 1 - rows] + way[rows:] - way[:-rows] < least
            if np.any(below & (log.run[: log.n + 1 - rows] == log.run[rows - 1 :])):
                return True
    return False
