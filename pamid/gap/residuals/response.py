r"""The response of runs to a small change, to first order, from the rates along them: nothing is run again.

Along a run a change of the inputs, parameters or forces changes the rates by :math:`\delta f`, and the states follow

.. math:: \delta\dot x = A(t)\,\delta x + \delta f, \qquad A = \partial f/\partial x

solved from sample to sample with A and :math:`\delta f` held at their values in between.

References
----------
H. K. Khalil, "Nonlinear Systems", 3rd ed., Prentice Hall, 2002, section 3.3 (sensitivity equations).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from ...simulators.base import Simulator
from ...simulators.chains import Chains
from ...simulators.integrate import Runner
from ...simulators.placement import Placement
from ...simulators.port_log import PortLog
from ...simulators.structure import JointPort
from .between_rows import drawn
from .protocol import Active
from .states import integral
from .steps import earlier
from .tolerances import SMALL

_TERMS, _SMALL = 8, 0.25
_MOST = 1e12


class Drive:
    """Inputs, parameters and forces along a run, under effects and numbers."""

    def __init__(self, u: np.ndarray, p: np.ndarray, active: Active, lines: bool = False) -> None:
        self.u, self.p, self.lines = u, p, lines
        self.acting = [(place, made) for place, made in active if place.acts]

    def alike(self, other: Drive) -> bool:
        """Return whether another drive is the same: then no response differs."""
        same = self.lines == other.lines and self.acting == other.acting
        return same and np.array_equal(self.u, other.u) and np.array_equal(self.p, other.p)


class Response:
    """Changes of the states along one run of every stretch."""

    def __init__(
        self, simulator: Simulator, log: PortLog, firsts: np.ndarray, states: np.ndarray, drive: Drive,
        joints: Sequence[JointPort],
    ) -> None:  # fmt: skip
        self.simulator, self.log, self.firsts = simulator, log, firsts
        self.joints = joints
        self.paths = {f"{j.name}.path": simulator.states.index(j.velocity) for j in joints if not j.position}
        ends = np.append(firsts[1:], log.n)
        self.before = np.concatenate([np.arange(a, b - 1) for a, b in zip(firsts, ends, strict=True)]).astype(int)
        self.evaluations = 0.0
        """Times that the rates were asked for at every row."""
        self.drive = drive
        # How far a joint without an angle has moved is a state, too, of which effects may depend.
        rows = np.nan_to_num(states)
        self.x = np.vstack([rows, *(integral(rows[v], log, firsts) for v in self.paths.values())])
        self._slopes: dict[int, np.ndarray | None] = {}
        self._base = self._pushed(drive, self.x)
        self.rates = _held(self._asked(self.x, self._base[0], drive.p) + self._base[1])
        self._steps = self._transitions(drive)

    def _pushed(self, drive: Drive, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the inputs at mid-step, and the effects' additions to the rates themselves."""
        before, u = self.before, self._held_inputs(drive)
        added = np.zeros((len(x), len(before)))
        middle = self._own(0.5 * (x[:, before] + x[:, before + 1]))
        at = self.log.t[before], middle, u.copy(), drive.p[:, before]
        for place, made in drive.acting:
            force = self._force(place, made, x, drive.u)
            force = 0.5 * (force[before] + force[before + 1])
            place.push(made, force, self.simulator, at, u, added)
        return u, added

    def _held_inputs(self, drive: Drive) -> np.ndarray:
        """Return a copy of the inputs at mid-step."""
        if not drive.lines:
            return drive.u[:, self.before].copy()
        whole = drawn(drive.u, self.log.starts, stairs=True)
        return np.asarray(0.5 * (whole[:, self.before] + whole[:, self.before + 1]))

    def _rates(self, drive: Drive, x: np.ndarray | None = None) -> np.ndarray:
        """Return the rates at mid-step, shape (n_states, n_steps), at other states if given."""
        x = self.x if x is None else x
        u, added = self._pushed(drive, x)
        return _held(self._asked(x, u, drive.p) + added)

    def _asked(self, x: np.ndarray, u: np.ndarray, p: np.ndarray, at: float = 0.5) -> np.ndarray:
        """Return the simulator's own rates within each step, at mid-step if not told otherwise."""
        log, before = self.log, self.before
        middle = (1.0 - at) * x[:, before] + at * x[:, before + 1]
        self.evaluations += 1.0
        with np.errstate(all="ignore"):
            found = self.simulator.rate(log.t[before] + at * log.dt, self._own(middle), u, p[:, before])
        return _held(np.vstack([found, middle[list(self.paths.values())]]))

    def _own(self, x: np.ndarray) -> np.ndarray:
        """Return the simulator's own states."""
        return x[: len(self.simulator.states)]

    def _force(self, place: Placement, made: object, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return an effect's contribution at each row, with its memory from the unchanged states."""
        s0 = place.signals(self._signals(self.x, u), self.log.t)
        memory = made.trace(s0, place.plant, self.log.dt * place.scales.time, self.firsts)  # type: ignore[attr-defined]
        s = s0 if x is self.x else place.signals(self._signals(x, u), self.log.t)
        return np.broadcast_to(place.force(made, s, memory), (self.log.n,)).astype(float)  # type: ignore[arg-type]

    def _signals(self, x: np.ndarray, u: np.ndarray) -> dict[str, np.ndarray]:
        return dict(zip((*self.simulator.states, *self.paths, *self.simulator.inputs), (*x, *u), strict=True))

    def _transitions(self, drive: Drive) -> tuple[np.ndarray, np.ndarray]:
        r"""Return :math:`e^{A h}` and :math:`\int_0^h e^{A s} \mathrm{d}s` of each step, matrices of the states."""
        n, dt = len(self.x), self.log.dt
        A = np.empty((len(self.before), n, n))
        for j in range(n):
            h = 1e-6 * (float(np.ptp(self.x[j])) or float(np.max(np.abs(self.x[j]))) or 1.0)
            A[:, :, j] = ((self._rates(drive, self.x + h * np.eye(n)[j][:, None]) - self.rates) / h).T
        A = np.clip(A, -_MOST, _MOST) * dt
        norm = float(np.max(np.sum(np.abs(A), axis=2), initial=0.0))
        halvings = int(np.clip(np.ceil(np.log2(max(norm, 1e-300) / _SMALL)), 0, 40))
        A = A / 2.0**halvings
        identity = np.broadcast_to(np.eye(n), A.shape)
        # The series of (e^A - 1) / A, and from it that of e^A; both doubled as often as A was halved.
        integral, term = identity.copy(), identity
        for k in range(2, _TERMS):
            term = term @ A / k
            integral = integral + term
        step = identity + A @ integral
        for _ in range(halvings):  # clipped in between, so that what grows without end stays finite
            integral = np.clip(0.5 * (integral + integral @ step), -_MOST, _MOST)
            step = np.clip(step @ step, -_MOST, _MOST)
        kept = self._kept(drive)
        return (step, integral * dt) if kept is None else (kept @ step, kept @ integral * dt)

    def _kept(self, drive: Drive) -> np.ndarray | None:
        """Return what effects that hold a motion leave of a change within each step; None without such effects."""
        at, u = self.before, self._held_inputs(drive)
        s = self._signals(self.x, drive.u)
        memory = [
            np.asarray(made.trace(place.signals(s, self.log.t), place.plant, self.log.dt * place.scales.time,
                                  self.firsts))[..., at] if made.n_states else np.zeros((0,))
            for place, made in drive.acting
        ]  # fmt: skip
        runner = Runner(self.simulator, self.log.dt, self.joints)
        return runner.kept(self.log.t[at], self.x[:, at], u, drive.p[:, at], drive.acting, memory)

    def to(self, drive: Drive) -> np.ndarray:
        """Return by how much the states change under another drive, shape (n_states, n)."""
        return self._followed(self._change(drive), np.zeros((len(self.x), len(self.firsts))))

    def _change(self, drive: Drive) -> np.ndarray:
        """Return by how much the rates change under another drive; for inputs alone by superposition."""
        if not np.array_equal(drive.p, self.drive.p):
            return self._rates(drive) - self.rates
        u, added = self._pushed(drive, self.x)
        out = added - self._base[1]
        for k, change in enumerate(u - self._base[0]):
            if np.any(change):
                slope = self._slope(k)
                if slope is None:
                    return self._rates(drive) - self.rates
                out = out + slope * change
        return out

    def _slope(self, k: int) -> np.ndarray | None:
        """Return the slope of the rates over an input at mid-step; None where they are nonlinear in it."""
        if k not in self._slopes:
            u, size = self._base[0], float(np.ptp(self.drive.u[k])) or 1.0
            own = self.rates - self._base[1]
            there = [
                self._asked(self.x, u + share * size * np.eye(len(u))[k][:, None], self.drive.p) for share in (1, -0.4)
            ]
            slope = (there[0] - own) / size
            reach = np.max(np.abs(slope), axis=1, keepdims=True) * size
            straight = np.all(np.abs(there[1] - own + 0.4 * size * slope) <= 1e-6 * reach + 1e-12)
            self._slopes[k] = slope if straight else None
        return self._slopes[k]

    def of_steps(self, new_speed: Sequence[int] = ()) -> np.ndarray:
        """Return by how much the states change with steps of Euler's method, for a whole sample to first order.

        Rows of ``new_speed`` are positions that go with the speed at the end of a step.
        """
        late, early = (self._rates(self.drive, earlier(self.x, by, self.log)) for by in (0.5 * SMALL, -0.5 * SMALL))
        late[list(new_speed)] = early[list(new_speed)]
        return self._followed((late - self.rates) / SMALL, np.zeros((len(self.x), len(self.firsts))))

    def of_whole_steps(self, new_speed: Sequence[int] = ()) -> np.ndarray:
        """Return the same, not only to first order, if each sample is one step."""
        first, last = (self._asked(self.x, self._base[0], self.drive.p, at) for at in (0.0, 1.0))
        first[list(new_speed)] = last[list(new_speed)]
        change = first + self._base[1] - np.diff(self.x)[:, self.before] / self.log.dt
        return self._followed(change, np.zeros((len(self.x), len(self.firsts))))

    def of_start(self, state: int) -> np.ndarray:
        """Return by how much the states change for a unit of an initial state, shape (n_states, n)."""
        start = np.zeros((len(self.x), len(self.firsts)))
        start[state] = 1.0
        return self._followed(np.zeros((len(self.x), len(self.before))), start)

    @cached_property
    def _chains(self) -> Chains:
        """All stretches, from step to step."""
        return Chains(self._steps[0], self.firsts, self.log.n)

    def _followed(self, change: np.ndarray, start: np.ndarray) -> np.ndarray:
        """Return the changes of the states along all stretches."""
        out = self._chains.followed(np.einsum("kij,jk->ki", self._steps[1], change), start.T)
        return self._own(np.clip(np.nan_to_num(out.T), -_MOST, _MOST))


def _held(rates: np.ndarray) -> np.ndarray:
    """Return finite numbers: those of a run that diverges, or of an effect on it, stay at a bound."""
    return np.clip(np.nan_to_num(rates), -_MOST, _MOST)
