"""The antagonistic bench as a right-hand side: one joint, two muscles, many runs side by side."""

from collections.abc import Sequence

import numpy as np

from ..effects.base import Effect, Signals
from .muscles import Muscles
from .parameters import BenchParameters


class Antagonist:
    r"""Two muscles on one pulley; the state of each run is (q, q̇, P₁, P₂), one column per run.

    .. math:: L_{1,2} = L_0 (1 - \varepsilon_0) \mp r q, \qquad J\ddot q = r\,(F_1 - F_2) - b_q\,\dot q
    """

    def __init__(self, params: BenchParameters, n_runs: int, effects: Sequence[Effect] = ()) -> None:
        self.muscles = Muscles(params, (2, n_runs), effects)
        self.plant = self.muscles.plant
        r = params.joint.pulley_radius
        self._radius = np.array(r)
        self._middle = np.array(params.muscle.rest_length * (1.0 - params.muscle.initial_contraction))
        self._torque = np.array(r / params.joint.inertia)
        self._damping = np.array(params.joint.viscous_damping / params.joint.inertia)
        self._inertia = params.joint.inertia
        self._L, self._L_rate = np.empty((2, n_runs)), np.empty((2, n_runs))
        self._L1, self._L2 = self._L
        self._L1_rate, self._L2_rate = self._L_rate
        self._drag = np.empty(n_runs)
        self._torques = [e for e in effects if "torque" in e.hooks()]
        self._memory: dict[int, np.ndarray] = {}
        self._base = Signals()

    def _lengths(self, y: np.ndarray) -> None:
        drag = self._drag
        np.multiply(y[0], self._radius, drag)
        np.subtract(self._middle, drag, self._L1)
        np.add(self._middle, drag, self._L2)
        np.multiply(y[1], self._radius, self._L2_rate)
        np.negative(self._L2_rate, self._L1_rate)

    def rates(self, y: np.ndarray, out: np.ndarray, ahead: float) -> None:
        """Write ẏ into ``out``; ``ahead`` is the time since the start of the integration step, s."""
        self._lengths(y)
        m = self.muscles
        m.evaluate(self._L, self._L_rate, y[2:], out[2:], ahead)
        drag, speed, acceleration = self._drag, y[1], out[1]
        out[0] = speed
        np.subtract(m.F[0], m.F[1], acceleration)
        np.multiply(acceleration, self._torque, acceleration)
        np.multiply(speed, self._damping, drag)
        np.subtract(acceleration, drag, acceleration)
        if self._torques:
            s = Signals(position=y[0], velocity=y[1])
            for e in self._torques:
                x = self._memory.get(id(e))
                if x is not None and ahead > 0.0:
                    x = e.step(x, self._base, s, ahead, self.plant)
                acceleration += e.torque(s, x, self.plant) / self._inertia

    @property
    def remembers(self) -> bool:
        """Whether anything has memory."""
        return bool(self.muscles.remembering or self._memory)

    # --- memory ---------------------------------------------------------------------------------------------
    def start_memory(self, y: np.ndarray, dt: float) -> None:
        """Put all memory at rest at the state ``y``."""
        self._lengths(y)
        self.muscles.start_memory(self._L, self._L_rate, y[2:].copy(), dt)
        self._base = Signals(position=y[0].copy(), velocity=y[1].copy())
        self._memory = {id(e): e.start(self._base, self.plant, dt) for e in self._torques if e.n_states}

    def carry_memory(self, y: np.ndarray, h: float) -> None:
        """Carry memory over the integration step of ``h`` seconds that ended at ``y``."""
        if self.muscles.remembering:
            self._lengths(y)
            self.muscles.carry_memory(self._L, self._L_rate, y[2:].copy(), h)
        if self._memory:
            s = Signals(position=y[0].copy(), velocity=y[1].copy())
            self._memory = {
                id(e): e.step(self._memory[id(e)], self._base, s, h, self.plant) for e in self._torques if e.n_states
            }
            self._base = s
