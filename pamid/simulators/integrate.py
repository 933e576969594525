"""Runs of a simulator from given states, many at once, with effects that act while it runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..effects import Effect
from .base import Simulator
from .placement import Placement
from .structure import JointPort

Acting = Sequence[tuple[Placement, Effect]]
STEPS = 8
"""Steps of the Runge-Kutta method over a sample, from which no exact answer can be told."""
MOST = 1e9
"""Size, in spans of a state, at which a run has diverged: it is held there."""


def side_by_side(spans: Sequence[tuple[int, int]], length: int) -> np.ndarray:
    """Return the rows of runs side by side, the last one repeated where a run is shorter, shape (length, n_runs)."""
    return np.stack([np.minimum(a + np.arange(length), b - 1) for a, b in spans], axis=1)


class Runner:
    """Integrates a simulator by the classical Runge–Kutta method, inputs held over each sample or interpolated."""

    def __init__(
        self, simulator: Simulator, dt: float, joints: Sequence[JointPort] = (), substeps: int = 1, lines: bool = False
    ) -> None:
        self.simulator, self.dt, self.substeps, self.lines = simulator, dt, substeps, lines
        self.paths = {f"{j.name}.path": j.velocity for j in joints if not j.position}
        self.failed: tuple[int, list[str], int] | None = None
        """Row, states and run at which rates first led to what is no number."""

    @np.errstate(all="ignore")
    def states(
        self, t: np.ndarray, x0: np.ndarray, u: np.ndarray, p: np.ndarray, acting: Acting = (), most: float = MOST
    ) -> np.ndarray:
        """Return the states along runs."""
        wanted = {name for place, _ in acting for name in place.sources()}
        paths = [name for name in self.paths if name in wanted]
        x = np.vstack([x0, np.zeros((len(paths), x0.shape[1]))])
        out = np.empty((len(t), *x.shape))
        memory: list[Any] = []
        for place, made in acting:
            s = place.signals(self._table(x, u[0], paths), t[0])
            memory.append(made.start(s, place.plant, self.dt * place.scales.time))
        h = self.dt / self.substeps
        for k in range(len(t)):
            out[k] = x
            if k + 1 == len(t):
                break
            now = p[k] if p.ndim == 3 else p
            for j in range(self.substeps):
                held = u[k] + (j + 0.5) / self.substeps * (u[k + 1] - u[k]) if self.lines else u[k]
                x, memory = self._step(t[k] + j * h, h, x, held, now, acting, memory, paths)
                if not np.abs(x).max(initial=0.0) < most:  # NaN is not less, either
                    if self.failed is None and not np.isfinite(x).all():
                        bad = ~np.isfinite(x[: len(self.simulator.states)])
                        run = int(np.argmax(bad.any(axis=0)))
                        self.failed = k, [self.simulator.states[j] for j in np.flatnonzero(bad[:, run])], run
                    x = np.clip(np.nan_to_num(x, nan=most), -most, most)
        return out

    def _table(self, x: np.ndarray, u: np.ndarray, paths: Sequence[str]) -> dict[str, np.ndarray]:
        return dict(zip((*self.simulator.states, *paths, *self.simulator.inputs), (*x, *u), strict=True))

    def _step(
        self, t: np.ndarray, h: float, x: np.ndarray, u: np.ndarray, p: np.ndarray, acting: Acting,
        memory: list[Any], paths: Sequence[str],
    ) -> tuple[np.ndarray, list[Any]]:  # fmt: skip
        before = [place.signals(self._table(x, u, paths), t) for place, _ in acting]

        def rate(later: float, y: np.ndarray) -> np.ndarray:
            return self._rate(
                t + later, y, u, p, acting, self._moved(acting, memory, before, y, u, later, t, paths), paths
            )

        a = rate(0.0, x)
        b = rate(h / 2, x + h / 2 * a)
        c = rate(h / 2, x + h / 2 * b)
        d = rate(h, x + h * c)
        x = x + h / 6 * (a + 2 * b + 2 * c + d)
        return x, self._moved(acting, memory, before, x, u, h, t, paths)

    def _moved(
        self, acting: Acting, memory: list[Any], before: list[Any], x: np.ndarray, u: np.ndarray, later: float,
        t: np.ndarray, paths: Sequence[str],
    ) -> list[Any]:  # fmt: skip
        if later == 0.0 or not acting or not any(made.n_states for _, made in acting):
            return memory
        table, out = self._table(x, u, paths), []
        for (place, made), m, s0 in zip(acting, memory, before, strict=True):
            if made.n_states:
                s1 = place.signals(table, t + later)
                out.append(made.step(m, s0, s1, later * place.scales.time, place.plant))
            else:
                out.append(m)
        return out

    def _rate(
        self, t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray, acting: Acting, memory: list[Any],
        paths: Sequence[str],
    ) -> np.ndarray:  # fmt: skip
        simulator, n = self.simulator, len(self.simulator.states)
        if not acting and not paths:
            return simulator.rate(t, x, u, p)
        added = np.zeros_like(x)
        if acting:
            table, at, u = self._table(x, u, paths), (t, x[:n], u, p), u.copy()
            for (place, made), m in zip(acting, memory, strict=True):
                force = place.force(made, place.signals(table, t), m)
                place.push(made, force, simulator, at, u, added)
        added[:n] += simulator.rate(t, x[:n], u, p)
        for k, name in enumerate(paths):
            added[n + k] = x[simulator.states.index(self.paths[name])]
        return added


def substeps_for(
    simulator: Simulator, dt: float, t: np.ndarray, x0: np.ndarray, u: np.ndarray, p: np.ndarray,
    needed: Mapping[str, float], share: float, most: int = 32,
) -> int:  # fmt: skip
    """Return the steps per sample beyond which a run changes by less than a share of its range, and stays finite.

    Readings need an accuracy of their own, which is no finer than a millionth of their range.
    """
    least = np.array([needed.get(name, np.inf) for name in (*simulator.states, *simulator.outputs)])
    steps, coarse = 1, _signals(simulator, Runner(simulator, dt, (), 1).states(t, x0, u, p), t, u, p)
    while steps < most:
        fine = _signals(simulator, Runner(simulator, dt, (), 2 * steps).states(t, x0, u, p), t, u, p)
        size = np.ptp(fine, axis=(0, 2)) + 1e-300
        away = np.max(np.abs(fine - coarse), axis=(0, 2))
        if np.all(np.abs(fine) < MOST) and np.all(away < np.clip(least, 1e-6 * size, share * size)):
            break
        steps, coarse = 2 * steps, fine
    return steps


def _signals(simulator: Simulator, x: np.ndarray, t: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return states and outputs of runs side by side, shape (n_rows, n_signals, n_runs)."""
    if not simulator.outputs:
        return x
    with np.errstate(all="ignore"):
        y = [simulator.output(t[k], x[k], u[k], p) for k in range(len(x))]
    return np.concatenate([x, np.stack(y)], axis=1)
