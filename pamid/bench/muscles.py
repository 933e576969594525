"""The right-hand side of many muscles at once: valve, gas and force, with the effects that enter them.

The same formulas stand, one by one, in `pamid.laws`; here they are fused over all muscles of a batch, into arrays
that are allocated once, because the time of a simulation goes into calls rather than into numbers.
"""

from collections.abc import Sequence

import numpy as np

from ..effects.base import Effect, Signals
from .parameters import BenchParameters

MUSCLE_HOOKS = ("force", "flow", "command", "supply", "valve")


class Muscles:
    r"""Muscles of one kind, each on its own valve (ISO 6358, its command held).

    .. math:: F = p\,\frac{3 L^2 - b^2}{4\pi n^2}, \qquad \dot P = \frac{\gamma\,(R T \dot m - P \dot V)}{V}
    """

    def __init__(self, params: BenchParameters, shape: tuple[int, ...], effects: Sequence[Effect] = ()) -> None:
        gas, valve = params.gas, params.valve
        self.plant = params.plant()
        self.rest_length = params.muscle.rest_length
        self.atmosphere = gas.atmospheric_pressure
        self.supply_pressure = gas.supply_pressure
        self.conductance = valve.sonic_conductance * valve.reference_density
        self.critical = valve.critical_pressure_ratio
        self.subsonic = 1.0 / (1.0 - self.critical)
        self.shape_factor = self.plant.shape
        self.thread_squared = self.plant.thread_length**2
        self.RT = self.plant.RT
        self.gamma = gas.heat_capacity_ratio
        used = [e for e in effects if e.site == "muscle" and set(e.hooks()) & set(MUSCLE_HOOKS)]
        self.by_hook = {hook: [e for e in used if hook in e.hooks()] for hook in MUSCLE_HOOKS}
        self.has_effects = bool(used)
        self.remembering = [e for e in used if e.n_states]
        # By identity: two alike effects in one chain of commands remember different things.
        self._base_memory: dict[int, np.ndarray] = {}
        self._inputs: dict[int, np.ndarray] = {}
        self._base = Signals()
        self.F, self.mdot = np.empty(shape), np.empty(shape)
        self._f, self._t, self._w = np.empty(shape), np.empty(shape), np.empty(shape)
        self._up, self._down = np.empty(shape), np.empty(shape)
        # Numbers as arrays without axes: numpy takes them at half the cost of a Python float.
        self._zero, self._one = np.array(0.0), np.array(1.0)
        self._critical, self._subsonic = np.array(self.critical), np.array(self.subsonic)
        self._slope_L2, self._slope_0 = (
            np.array(3.0 * self.shape_factor),
            np.array(self.shape_factor * self.thread_squared),
        )
        self._thread_squared, self._RT = np.array(self.thread_squared), np.array(self.RT)
        self._gamma_over_shape, self._ambient_0 = np.array(self.gamma / self.shape_factor), np.array(self.atmosphere)
        self._conductance, self._supply_0 = np.array(self.conductance), np.array(self.supply_pressure)
        self.u = np.zeros(shape)
        self._fill, self._vent = np.zeros(shape), np.ones(shape)
        self._supply, self._ambient = np.zeros(shape), np.full(shape, self.atmosphere)
        self._opening = np.zeros(shape)

    # --- valve ----------------------------------------------------------------------------------------------
    def _open(self, u: np.ndarray, supply: np.ndarray | float) -> None:
        """Note which way each valve is open, so that an evaluation needs no branch."""
        np.greater(u, self._zero, out=self._fill)
        np.subtract(self._one, self._fill, self._vent)
        np.multiply(self._fill, supply, self._supply)
        np.multiply(self._vent, self._ambient_0, self._ambient)
        np.multiply(u, self._conductance, self._opening)

    def hold(self, u: np.ndarray) -> None:
        """Hold the command ``u`` from now on."""
        self.u = u
        if self.remembering:
            self._base = self._base.with_(command=u)
        if not (self.by_hook["command"] or self.by_hook["supply"]):
            self._open(u, self._supply_0)

    def _valve(self, P: np.ndarray) -> None:
        up, x, multiply, add = self._up, self._down, np.multiply, np.add
        multiply(P, self._vent, up)
        add(up, self._supply, up)
        multiply(P, self._fill, x)
        add(x, self._ambient, x)
        np.divide(x, up, x)
        np.subtract(x, self._critical, x)
        multiply(x, self._subsonic, x)
        np.maximum(x, self._zero, out=x)
        multiply(x, x, x)
        np.subtract(self._one, x, x)
        np.maximum(x, self._zero, out=x)  # no flow against the pressure
        np.sqrt(x, x)
        multiply(x, up, x)
        multiply(x, self._opening, self.mdot)

    # --- one evaluation -------------------------------------------------------------------------------------
    def evaluate(self, L: np.ndarray, L_rate: np.ndarray, P: np.ndarray, P_rate: np.ndarray, ahead: float) -> None:
        """Write the pressure rate into ``P_rate``; tension and flow stand in `F` and `mdot` afterwards."""
        if self.has_effects:
            self._evaluate_with_effects(L, L_rate, P, P_rate, ahead)
            return
        f, t, w, multiply, subtract = self._f, self._t, self._w, np.multiply, np.subtract
        self._valve(P)
        multiply(L, L, t)
        multiply(t, self._slope_L2, f)
        subtract(f, self._slope_0, f)
        subtract(self._thread_squared, t, t)
        multiply(t, L, t)  # V / shape_factor
        multiply(P, f, P_rate)
        multiply(P_rate, L_rate, P_rate)
        multiply(self.mdot, self._RT, w)
        np.add(P_rate, w, P_rate)
        np.divide(P_rate, t, P_rate)
        multiply(P_rate, self._gamma_over_shape, P_rate)
        subtract(P, self._ambient_0, w)
        multiply(w, f, self.F)

    def signals(self, L: np.ndarray, L_rate: np.ndarray, P: np.ndarray) -> Signals:
        """Return the signals of the muscles by role."""
        return Signals(
            position=1.0 - L / self.rest_length, velocity=L_rate / -self.rest_length, pressure=P, command=self.u
        )

    def _memory_at(self, s: Signals, ahead: float) -> dict[int, np.ndarray]:
        if ahead == 0.0:
            return self._base_memory
        carried = {}
        for e in self.remembering:
            x = self._base_memory[id(e)]
            if e.sampled:
                carried[id(e)] = x
            elif "command" in e.hooks():
                held = self._base.with_(command=self._inputs[id(e)])
                carried[id(e)] = e.step(x, held, s.with_(command=self._inputs[id(e)]), ahead, self.plant)
            else:
                carried[id(e)] = e.step(x, self._base, s, ahead, self.plant)
        return carried

    def _evaluate_with_effects(
        self, L: np.ndarray, L_rate: np.ndarray, P: np.ndarray, P_rate: np.ndarray, ahead: float
    ) -> None:
        plant = self.plant
        s = self.signals(L, L_rate, P)
        memory = self._memory_at(s, ahead)
        u, supply = self.u, self.supply_pressure
        for e in self.by_hook["command"]:
            if ahead == 0.0:
                self._inputs[id(e)] = u
            u = e.command(u, s, memory.get(id(e)), plant)
        s.command = u
        for e in self.by_hook["supply"]:
            supply = e.supply(supply, s, memory.get(id(e)), plant)
        s.command = self.u
        if self.by_hook["command"] or self.by_hook["supply"]:
            self._open(u, supply)
        self._valve(P)
        for e in self.by_hook["valve"]:
            self.mdot += e.valve(s, memory.get(id(e)), plant)
        s.flow = self.mdot
        squared = L * L
        f = self.shape_factor * (3.0 * squared - self.thread_squared)
        V = self.shape_factor * (self.thread_squared - squared) * L
        into, per_rate = self.mdot + P * f * L_rate / self.RT, V / (self.gamma * self.RT)
        if self.by_hook["flow"]:  # an effect may go by whether the pressure rises
            np.divide(into, per_rate, out=P_rate)
            s.pressure_rate = P_rate
        for e in self.by_hook["flow"]:
            a, b = e.flow(s, memory.get(id(e)), plant)
            into = into - a
            per_rate = per_rate + b
        np.divide(into, per_rate, out=P_rate)
        s.pressure_rate = P_rate
        np.multiply(P - self.atmosphere, f, out=self.F)
        for e in self.by_hook["force"]:
            self.F += e.force(s, memory.get(id(e)), plant)

    # --- memory ---------------------------------------------------------------------------------------------
    def start_memory(self, L: np.ndarray, L_rate: np.ndarray, P: np.ndarray, dt: float) -> None:
        """Put all memory at rest at the state given; ``dt`` is the control period, s."""
        s = self.signals(L, L_rate, P)
        self._base = s
        self._base_memory = {id(e): e.start(s, self.plant, dt) for e in self.remembering}
        self._inputs = {id(e): self.u for e in self.by_hook["command"]}

    def carry_memory(self, L: np.ndarray, L_rate: np.ndarray, P: np.ndarray, h: float) -> None:
        """Carry continuous memory over a whole integration step of ``h`` seconds to the state given."""
        if not self.remembering:
            return
        s = self.signals(L, L_rate, P)
        self._base_memory = self._memory_at(s, h)
        self._base = s

    def sample_memory(self, before: np.ndarray, dt: float) -> None:
        """Carry sampled memory over one control period, from the command ``before`` to the one now held."""
        for e in self.remembering:
            if e.sampled:
                held = self._base.with_(command=before)
                now = self._base.with_(command=self.u)
                self._base_memory[id(e)] = e.step(self._base_memory[id(e)], held, now, dt, self.plant)
