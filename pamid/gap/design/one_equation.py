"""The next run for one equation: motions and pressures within what the log has visited."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...simulators.placement import Scales
from ..diagnosis.findings import NextExperiment
from ..diagnosis.rivals import Rival
from ..one_equation import Measured
from ..residuals.rates import with_rates
from ..residuals.single import SignalEvidence
from .plan import TELLS

MOVED = ("position", "pressure", "command")
"""Signals that a run may move."""
WITHIN = 0.05, 0.95
"""Quantiles of the log between which a run stays."""
Signals = dict[str, np.ndarray]


def next_for_equation(
    rivals: Sequence[Rival], m: Measured, scales: Scales, noise: float, *, designs: int = 60, seed: int = 0
) -> NextExperiment | None:
    r"""Return the run that best distinguishes the two likeliest explanations of one equation.

    Each signal that is driven is held, or moves as a sine, within what the log has visited. Their contributions differ
    by d, less what a change of the second one's size could explain:

    .. math:: D = \tfrac{n}{2} \log\Big(1 + \frac{\min_a \|d - a\,g_2\|^2}{n \sigma^2}\Big)

    with the noise σ of a window.
    """
    two, signals, dt = list(rivals)[:2], m.signals, m.dt
    may_move = MOVED[:1] if m.equation == "torque" else MOVED  # a joint's load follows from its motion
    moved = [role for role in may_move if role in m.columns and np.ptp(signals[role]) > 0.0]
    seconds = float(np.median(np.bincount(m.codes))) * dt
    n = round(seconds / dt)
    if len(two) < 2 or not moved or n < 50:
        return None
    rng = np.random.default_rng(seed)
    plans = [_drawn(rng, signals, moved, seconds) for _ in range(designs)]
    t = np.arange(n) * dt
    made: Signals = {role: np.full(designs * n, float(np.median(x))) for role, x in signals.items()}
    for role in moved:
        made[role] = np.concatenate([_wave(p[role], t) for p in plans])
    if "time" in made:
        made["time"] = np.tile(t, designs)
    codes = np.repeat(np.arange(designs), n)
    for rate, of in (("velocity", "position"), ("pressure_rate", "pressure")):
        if rate in made and of in moved:
            made[rate] = with_rates({of: made[of]}, codes, dt)[rate]
    nominal = m.usual(designs * n)
    source = SignalEvidence(made, nominal(made), nominal, codes, dt, m.equation, m.plant, scales)
    first, second = (source.means(r.effects) for r in two)
    run = source.run
    told = np.array([_difference(first[run == k], second[run == k], noise) for k in range(designs)])
    best = int(np.argmax(told))
    if not told[best] >= TELLS:
        return None
    names = tuple(" and ".join(r.names) or "no effect" for r in two)
    trajectory: dict[str, object] = {"kind": "run", "seconds": seconds}
    for role in moved:
        middle, amplitude, frequency = plans[best][role]
        trajectory |= {role: middle}
        trajectory |= {f"{role}_amplitude": amplitude, f"{role}_frequency": frequency} if amplitude else {}
    reason = (
        f"{names[0]} and {names[1]} would differ in log-likelihood by about {told[best]:.0f} over {seconds:.3g} s of it"
    )
    return NextExperiment(trajectory, names, float(told[best]), reason)


def _drawn(
    rng: np.random.Generator, signals: Mapping[str, np.ndarray], moved: Sequence[str], seconds: float
) -> dict[str, tuple[float, float, float]]:
    """Return for each signal its middle, its amplitude (0: held) and its frequency, rad/s."""
    found, moves = {}, rng.random(len(moved)) < 0.6
    moves[int(rng.integers(len(moved)))] = True
    slowest = 2.0 * np.pi / seconds
    for role, moving in zip(moved, moves, strict=True):
        low, high = np.quantile(signals[role], WITHIN)
        middle = float(rng.uniform(low, high))
        amplitude = float(rng.uniform(0.3, 1.0) * min(middle - low, high - middle)) if moving else 0.0
        found[role] = middle, amplitude, float(np.exp(rng.uniform(np.log(slowest), np.log(20.0 * slowest))))
    return found


def _wave(numbers: tuple[float, float, float], t: np.ndarray) -> np.ndarray:
    middle, amplitude, frequency = numbers
    return middle + amplitude * np.sin(frequency * t)


def _difference(first: np.ndarray, second: np.ndarray, noise: float) -> float:
    d, size = first - second, float(second @ second)
    left = d - second * (float(second @ d) / size) if size > 0.0 else d
    n = max(len(d), 1)
    return 0.5 * n * float(np.log1p(np.mean(np.square(left)) / max(noise, 1e-300) ** 2)) if len(d) else 0.0
