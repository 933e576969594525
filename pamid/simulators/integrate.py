"""Runs of a simulator from given states, many at once, with effects that act while it runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from ..effects import Effect
from .base import Simulator
from .chains import Chains
from .placement import Placement
from .sticking import ALL, Forces, Hold, Some, settled
from .structure import JointPort

Acting = Sequence[tuple[Placement, Effect]]
STEPS = 8
"""Steps of the Runge-Kutta method over a sample, from which no exact answer can be told."""
MOST = 1e9
"""Size, in spans of a state, at which a run has diverged: it is held there."""
_ROUNDS = 12
"""Most rounds of Newton's method."""
_EXACT = 1e-11
"""Share of a state's size that Newton's last round may move it."""
_FRESH = 0.1
"""Factor by which a round must come nearer for its Jacobian to serve the next one."""
_ASTRAY = 3
"""Rounds in turn that may come no nearer."""
_ALONGSIDE = 4_000
"""Runs whose arithmetic takes as long as a call of a simulator by itself."""
_MANY = 8_000_000
"""Most numbers of a Jacobian along all runs."""


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
        self, t: np.ndarray, x0: np.ndarray, u: np.ndarray, p: np.ndarray, acting: Acting = (), most: float = MOST,
        near: np.ndarray | None = None,
    ) -> np.ndarray:  # fmt: skip
        """Return the states along runs; from states near them, where these are known, at many steps at once."""
        wanted = {name for place, _ in acting for name in place.sources()}
        paths = [name for name in self.paths if name in wanted]
        x = np.vstack([x0, np.zeros((len(paths), x0.shape[1]))])
        memory: list[Any] = []
        for place, made in acting:
            s = place.signals(self._table(x, u[0], paths), t[0])
            memory.append(made.start(s, place.plant, self.dt * place.scales.time))
        out, k, length = np.empty((len(t), *x.shape)), 0, max(len(t) - 1, 1)
        at_once = near is not None and self.simulator.at_once
        near = near.copy() if near is not None else out
        least = _ROUNDS * (1 + sum(np.size(own) for own in (x, *memory)) // x.shape[1])
        while k + 1 < len(t):
            rows = slice(k, min(k + length, len(t) - 1) + 1)
            part = t[rows], x, u[rows], p[rows] if p.ndim == 3 else p, acting, memory, most, paths
            steps = min(length, len(t) - 1 - k) * self.substeps
            alone, together = steps * (_ALONGSIDE + x.shape[1]), least * (_ALONGSIDE + steps * x.shape[1])
            if at_once and length > 1 and alone > together:
                found = self._from_near(near[rows], *part)
                if found is None:
                    length //= 2
                    continue
            else:  # as fast as rounds over all these steps would be
                found = self._step_by_step(k, *part)
            known, memory = found
            out[k : k + len(known)] = known
            x, k, length = known[-1], k + len(known) - 1, 2 * (len(known) - 1)
        out[k] = x
        return out

    def kept(
        self, t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray, acting: Acting, memory: list[Any]
    ) -> np.ndarray | None:
        """Return how much remains of a small change just before the end of steps, shape (n_steps, n_states, n_states).

        None if nothing holds a motion: then all of it is.
        """
        if not any(made.holds for _, made in acting):
            return None

        def after(change: np.ndarray) -> np.ndarray:
            return self._step(t, self.dt, x, u, p, acting, memory, list(self.paths), change)[0]

        size = np.max(np.abs(x), axis=1)
        size = 1e-7 * np.where(size > 0.0, size, 1.0)
        base = after(np.zeros((len(x), 1)))
        columns = [(after(h * np.eye(len(x))[:, [k]]) - base) / h for k, h in enumerate(size)]
        return np.stack(columns, axis=1).transpose(2, 0, 1)

    def _step_by_step(
        self, first: int, t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray, acting: Acting,
        memory: list[Any], most: float, paths: Sequence[str],
    ) -> tuple[np.ndarray, list[Any]]:  # fmt: skip
        """Return the states at rows from a first one on, and the memory at the last."""
        out, h = np.empty((len(t), *x.shape)), self.dt / self.substeps
        out[0] = x
        for k in range(len(t) - 1):
            now = p[k] if p.ndim == 3 else p
            for j in range(self.substeps):
                ramp = (u[k + 1] - u[k]) / self.substeps if self.lines else 0.0
                middle = u[k] + (j + 0.5) * ramp
                x, memory = self._step(t[k] + j * h, h, x, middle, now, acting, memory, paths, ramp=ramp)
                if not np.abs(x).max(initial=0.0) < most:  # NaN is not less, either
                    if self.failed is None and not np.isfinite(x).all():
                        bad = ~np.isfinite(x[: len(self.simulator.states)])
                        run = int(np.argmax(bad.any(axis=0)))
                        self.failed = first + k, [self.simulator.states[j] for j in np.flatnonzero(bad[:, run])], run
                    x = np.clip(np.nan_to_num(x, nan=most), -most, most)
            out[k + 1] = x
        return out, memory

    def _from_near(
        self, near: np.ndarray, t: np.ndarray, x0: np.ndarray, u: np.ndarray, p: np.ndarray, acting: Acting,
        memory: list[Any], most: float, paths: Sequence[str],
    ) -> tuple[np.ndarray, list[Any]] | None:  # fmt: skip
        r"""Return the same by Newton's method over all steps at once, as far as it converges; None where it does not.

        All steps :math:`z_{k+1} = \Phi_k(z_k)` of states and memory are equations for a whole run. To first order
        their errors follow each other from step to step, so that each round calls the simulator a few times for all
        rows, not once for each. Kinks of an effect end it early: what it reached then becomes `near`, in place.
        """
        (n, many), m = x0.shape, self.substeps
        kept = [np.asarray(own).reshape(-1, many) for own in memory]
        begun = np.concatenate([x0, *kept])
        steps = (len(t) - 1) * m
        if steps < 2 or len(begun) ** 2 * steps * many > _MANY:
            return None
        at, share = np.repeat(np.arange(len(t) - 1), m), np.tile(np.arange(m) / m, len(t) - 1)[:, None, None]
        held = u[at] + (share + 0.5 / m) * (u[at + 1] - u[at]) if self.lines else u[at]
        ramp = _flat((u[at + 1] - u[at]) / m) if self.lines else 0.0
        now, times = p[at] if p.ndim == 3 else np.broadcast_to(p, (steps, *p.shape)), t[at] + share[:, 0] * self.dt
        inputs, numbers = _flat(held), _flat(now)
        ends = np.cumsum([len(own) for own in kept])

        def after(z: np.ndarray) -> np.ndarray:
            """Return states and memory after each step, from those before it, shape (n_states, n_steps * n_runs)."""
            own = [part.reshape(-1, z.shape[1]) for part in np.split(z[n:], ends[:-1])] if kept else []
            x, later = self._step(times.ravel(), self.dt / m, z[:n], inputs, numbers, acting, own, paths, ramp=ramp)
            return np.concatenate([x, *later])

        z = np.empty((steps + 1, len(begun), many))
        z[0] = begun
        guess = np.concatenate([near, np.zeros((len(t), n - near.shape[1], many))], axis=1)
        z[1:, :n] = guess[at] + (share + 1.0 / m) * (guess[at + 1] - guess[at])
        if len(begun) > n:
            rows = np.concatenate([held, held[-1:]]), np.vstack([times, t[-1:]])
            z[1:, n:] = self._remembered(acting, z[:, :n], *rows, paths)[1:]
        size = np.max(np.abs(z), axis=(0, 2))[:, None]
        size = np.where(size > 0.0, size, 1.0)
        chains, last, best, astray = None, np.inf, np.inf, 0
        for _ in range(_ROUNDS):
            here = _flat(z[:-1])
            if not np.abs(here).max() < most:
                return None
            there = after(here)
            if chains is None:
                steep = [(after(here + h) - there) / np.sum(h) for h in 1e-7 * size * np.eye(len(size))[:, :, None]]
                A = np.stack(steep, axis=1).reshape(len(size), len(size), steps, many).transpose(3, 2, 0, 1)
                if not np.isfinite(A).all():
                    return None
                chains = Chains(A.reshape(-1, *A.shape[2:]), (steps + 1) * np.arange(many), (steps + 1) * many)
            missed = (there - _flat(z[1:])).reshape(len(size), steps, many).transpose(2, 1, 0)
            moved = chains.followed(missed.reshape(-1, len(size))).reshape(many, steps + 1, len(size))
            z += moved.transpose(1, 2, 0)
            off = np.max(np.abs(moved[..., :n]) / size[:n, 0], axis=(0, 2))  # memory has kinks of its own
            far = float(np.max(off))
            astray, best = (0, far) if far < best else (astray + 1, best)
            if far <= _EXACT or astray == _ASTRAY:
                break
            chains, last = chains if far < _FRESH * last else None, far
        near[:] = z[::m, : near.shape[1]]
        good = max(int(np.argmax(off > _EXACT)) - 2, 0) // m if far > _EXACT else len(t) - 1
        return (z[::m, :n][: good + 1], list(np.split(z[good * m, n:], ends[:-1])) if kept else []) if good else None

    def _remembered(
        self, acting: Acting, x: np.ndarray, u: np.ndarray, t: np.ndarray, paths: Sequence[str]
    ) -> np.ndarray:
        """Return the memory along runs whose states are known, shape (n_rows, n_memory, n_runs)."""
        rows, _, many = x.shape
        # All rows of the first run, then those of the next.
        rows_of = np.concatenate([s.transpose(1, 2, 0).reshape(s.shape[1], rows * many) for s in (x, u)])
        table = dict(zip((*self.simulator.states, *paths, *self.simulator.inputs), rows_of, strict=True))
        starts, h, found = rows * np.arange(many), self.dt / self.substeps, [np.zeros((rows, 0, many))]
        for place, made in acting:
            if made.n_states:
                s = place.signals(table, t.T.ravel())
                own = np.asarray(made.trace(s, place.plant, h * place.scales.time, starts))
                found.append(own.reshape(-1, many, rows).transpose(2, 0, 1))
        return np.concatenate(found, axis=1)

    def _table(self, x: np.ndarray, u: np.ndarray, paths: Sequence[str]) -> dict[str, np.ndarray]:
        return dict(zip((*self.simulator.states, *paths, *self.simulator.inputs), (*x, *u), strict=True))

    def _step(
        self, t: np.ndarray, h: float, x: np.ndarray, u: np.ndarray, p: np.ndarray, acting: Acting,
        memory: list[Any], paths: Sequence[str], change: np.ndarray | float = 0.0, ramp: np.ndarray | float = 0.0,
    ) -> tuple[np.ndarray, list[Any]]:  # fmt: skip
        """Return states and memory after a step, with a change of the states just before what holds them acts.

        The inputs are those in the middle of the step, in which they change by `ramp`.
        """
        before = [place.signals(self._table(x, u, paths), t) for place, _ in acting]
        holding = [k for k, (_, made) in enumerate(acting) if made.holds]

        def after(held: Forces) -> tuple[np.ndarray, np.ndarray]:
            forces = dict(zip(holding, held, strict=True))

            def rate(later: float, y: np.ndarray) -> np.ndarray:
                driven = u + (later / h - 0.5) * ramp if self.lines else u
                now = self._moved(acting, memory, before, y, driven, later, t, paths, forces)
                return self._rate(t + later, y, driven, p, acting, now, paths, forces)

            a = rate(0.0, x)
            b = rate(h / 2, x + h / 2 * a)
            c = rate(h / 2, x + h / 2 * b)
            d = rate(h, x + h * c)
            return x + h / 6 * (a + 2 * b + 2 * c + d) + change, a

        holds = [self._hold(*acting[k], memory[k], before[k], x, u, t, h, paths) for k in holding]
        x = settled(after, holds, h) if holds else after([])[0]
        return x, self._moved(acting, memory, before, x, u, h, t, paths)

    def _hold(
        self, place: Placement, made: Effect, memory: Any, s0: Any, x: np.ndarray, u: np.ndarray, t: np.ndarray,
        h: float, paths: Sequence[str],
    ) -> Hold:  # fmt: skip
        """Return an effect that holds a motion, in a step."""

        def at_end(y: np.ndarray, some: Some) -> tuple[np.ndarray, np.ndarray]:
            begun, held, driven, at = s0, memory, u, t
            if some is not ALL:
                held, driven, at = np.asarray(memory)[..., some], u[:, some], np.broadcast_to(t, x.shape[1:])[some]
                begun = place.signals(self._table(x[:, some], driven, paths), at)
            s1 = self._came(place, begun, y, driven, h, at, paths)
            bent = made.step(held, begun, s1, h * place.scales.time, place.plant)
            return np.asarray(place.force(made, s1, bent)), s1.position - begun.position

        way, begun = h * place.scales.time * s0.velocity, np.asarray(place.force(made, s0, memory))
        return Hold(begun, way, made.turns_within, place.scales.target, at_end)

    def _came(
        self, place: Placement, before: Any, y: np.ndarray, u: np.ndarray, h: float, t: np.ndarray,
        paths: Sequence[str],
    ) -> Any:  # fmt: skip
        """Return the signals at the end of a step, the position where the speed there leads from its beginning."""
        s = place.signals(self._table(y, u, paths), t + h)
        return s.with_(position=before.position + h * place.scales.time * s.velocity)

    def _moved(
        self, acting: Acting, memory: list[Any], before: list[Any], x: np.ndarray, u: np.ndarray, later: float,
        t: np.ndarray, paths: Sequence[str], forces: Mapping[int, np.ndarray] = MappingProxyType({}),
    ) -> list[Any]:  # fmt: skip
        if later == 0.0 or not acting or not any(made.n_states for _, made in acting):
            return memory
        table, out = self._table(x, u, paths), []
        for k, ((place, made), m, s0) in enumerate(zip(acting, memory, before, strict=True)):
            if made.n_states and k not in forces:
                s1 = self._came(place, s0, x, u, later, t, paths) if made.holds else place.signals(table, t + later)
                out.append(made.step(m, s0, s1, later * place.scales.time, place.plant))
            else:
                out.append(m)
        return out

    def _rate(
        self, t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray, acting: Acting, memory: list[Any],
        paths: Sequence[str], forces: Mapping[int, np.ndarray],
    ) -> np.ndarray:  # fmt: skip
        simulator, n = self.simulator, len(self.simulator.states)
        if not acting and not paths:
            return simulator.rate(t, x, u, p)
        added = np.zeros_like(x)
        if acting:
            table, at, u = self._table(x, u, paths), (t, x[:n], u, p), u.copy()
            for k, ((place, made), m) in enumerate(zip(acting, memory, strict=True)):
                force = forces[k] if k in forces else place.force(made, place.signals(table, t), m)
                place.push(made, force, simulator, at, u, added)
        added[:n] += simulator.rate(t, x[:n], u, p)
        for k, name in enumerate(paths):
            added[n + k] = x[simulator.states.index(self.paths[name])]
        return added


def _flat(rows: np.ndarray) -> np.ndarray:
    """Return signals of all rows and runs side by side, shape (n_signals, n_rows * n_runs)."""
    return np.moveaxis(rows, 1, 0).reshape(rows.shape[1], len(rows) * rows.shape[2])


def substeps_for(
    simulator: Simulator, dt: float, t: np.ndarray, x0: np.ndarray, u: np.ndarray, p: np.ndarray,
    needed: Mapping[str, float], share: float, most: int = 32,
) -> int:  # fmt: skip
    """Return the steps per sample beyond which a run changes by less than a share of its range, and stays finite.

    Readings need an accuracy of their own, which is no finer than a millionth of their range.
    """
    least = np.array([needed.get(name, np.inf) for name in (*simulator.states, *simulator.outputs)])
    steps, near = 1, Runner(simulator, dt, (), 1).states(t, x0, u, p)
    coarse = _signals(simulator, near, t, u, p)
    while steps < most:
        near = Runner(simulator, dt, (), 2 * steps).states(t, x0, u, p, near=near)
        fine = _signals(simulator, near, t, u, p)
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
