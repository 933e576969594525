r"""Faults of a command that are equivalent to the same fault of a reading: the paths from one to the other.

Linear time-invariant systems commute: a lag, delay or gain before a plant G acts on the reading y = G u
as the same one after it,

.. math:: y = H\,(G\,u) = G\,(H\,u)

as long as that input moves only this reading, and no other input moves it. A gain does so where nothing constant, such
as a weight, acts beside the input. A delay commutes with any system that is the same at any time.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from .base import Simulator
from .placement import Placement
from .structure import spread_numbers

LINEAR: tuple[str, ...] = ("gain", "lag", "delay")
"""Linear, time-invariant faults of commands and readings: ``actuator_lag``, ``sensor_lag``."""


def commuting_paths(
    simulator: Simulator, t: np.ndarray, x: np.ndarray, u: np.ndarray, driven: Collection[str], read: Collection[str]
) -> dict[str, str]:
    """Return the reading of each input that moves it alone, where the simulator is linear; none elsewhere."""
    names = (*simulator.states, *simulator.outputs)
    slopes = _slopes(simulator, t, np.vstack([x, u]))
    if slopes is None:
        return {}
    n = len(simulator.states)
    # A signal reaches a state through rates, and other states through that; an output depends on its arguments.
    reach = np.abs(slopes[:n]) > 0.0
    for _ in range(n):
        reach = reach | (reach[:, :n].astype(int) @ reach.astype(int) > 0)
    shown = np.vstack([reach, (np.abs(slopes[n:]) > 0.0) | (np.abs(slopes[n:, :n]) > 0.0).astype(int) @ reach > 0])
    found = {}
    for name in driven:
        k = n + simulator.inputs.index(name)
        moved = [i for i, signal in enumerate(names) if signal in read and shown[i, k]]
        others = [n + simulator.inputs.index(o) for o in driven if o != name]
        if len(moved) == 1 and not shown[moved[0], others].any():
            found[name] = names[moved[0]]
    return found


def rests(simulator: Simulator, t: np.ndarray, u: np.ndarray, driven: Collection[str]) -> bool:
    """Return whether nothing but its initial state and the driven inputs moves a linear simulator."""
    p, x = spread_numbers(simulator, len(t)), np.zeros((len(simulator.states), len(t)))
    still = np.where([[name in driven] for name in simulator.inputs], 0.0, u)
    at = [simulator.rate(t, x, v, p) for v in (still, u)]
    shown = [simulator.output(t, x, v, p) for v in (still, u)] if simulator.outputs else at
    return all(float(np.max(np.abs(a))) <= 1e-9 * float(np.max(np.abs(b))) for a, b in (at, shown))


def delayed_path(
    simulator: Simulator, t: np.ndarray, x: np.ndarray, u: np.ndarray, driven: Collection[str], read: Collection[str]
) -> dict[str, str]:
    """Return the only reading of the only input that moves, unless time itself changes what follows from it.

    Whatever the simulator does in between, linear or not, it does so later by the same time.
    """
    shown = [name for name in (*simulator.states, *simulator.outputs) if name in read]
    if len(driven) != 1 or len(shown) != 1:
        return {}
    p, later = spread_numbers(simulator, len(t)), t + float(np.ptp(t))
    what = [simulator.rate, simulator.output] if simulator.outputs else [simulator.rate]
    alike = all(np.array_equal(says(t, x, u, p), says(later, x, u, p), equal_nan=True) for says in what)
    return dict(zip(driven, shown, strict=True)) if alike else {}


def twins_of(
    placements: Mapping[str, Placement], simulator: Simulator, t: np.ndarray, x: np.ndarray, u: np.ndarray,
    driven: Collection[str], read: Collection[str],
) -> dict[str, str]:  # fmt: skip
    """Return the effects at ports that are equivalent, each by the other's name."""
    found: dict[str, str] = {}
    words = LINEAR[1:]
    encoders = {place.at: place for place in placements.values() if len(place.readings) > 1}
    read = set(read).difference(*(place.readings[1:] for place in encoders.values()))
    if paths := commuting_paths(simulator, t, x, u, driven, read):
        words = LINEAR if rests(simulator, t, u, driven) else words
    else:
        paths, words = delayed_path(simulator, t, x, u, driven, read), ("delay",)
    for entry, reading in paths.items():
        for word in words:
            end = f"encoder_{word}@{encoders[reading].port}" if reading in encoders else f"sensor_{word}@{reading}"
            pair = f"actuator_{word}@{entry}", end
            if all(key in placements for key in pair):
                found[pair[0]], found[pair[1]] = pair[1], pair[0]
    return found


def _slopes(simulator: Simulator, t: np.ndarray, signals: np.ndarray) -> np.ndarray | None:
    """Return the slopes of rates and outputs over states and inputs; None where they are not constant."""
    n, p = len(simulator.states), spread_numbers(simulator, len(t))

    def answers(at: np.ndarray) -> np.ndarray:
        rates = simulator.rate(t, at[:n], at[n:], p)
        outputs = simulator.output(t, at[:n], at[n:], p) if simulator.outputs else np.zeros((0, len(t)))
        return np.vstack([rates, outputs])

    base, columns = answers(signals), []
    for k, signal in enumerate(signals):
        step = float(np.ptp(signal)) or 1.0
        moved = [signals.copy(), signals.copy()]
        moved[0][k] += step
        moved[1][k] -= 0.37 * step
        up, down = ((answers(m) - base) / d for m, d in zip(moved, (step, -0.37 * step), strict=True))
        slope = np.median(up, axis=1, keepdims=True)
        if np.any(np.abs(np.stack([up, down]) - slope) > 1e-6 * np.abs(slope) + 1e-9 * np.abs(base).max() / step):
            return None
        columns.append(np.where(np.abs(slope) > 1e-9 * np.abs(base).max() / step, slope, 0.0))
    return np.hstack(columns)
