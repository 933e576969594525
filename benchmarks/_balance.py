r"""Hold a simulation against the conservation laws, with the quadratures inside the integration.

Three balances are exact consequences of the nominal equations, so what they leave is the integrator's error:

* gas: :math:`\Delta(P^{1/\gamma} V) = \int P^{1/\gamma - 1} R T\,\dot m\,\mathrm{d}t`. Only for γ = 1 is that the mass
  balance Δ(PV/RT) = ∫ṁ dt; for other γ the flow equation keeps T fixed, and PV/RT is *not* conserved;
* energy of the gas: :math:`\Delta\frac{P V}{\gamma - 1} = \int \frac{\gamma}{\gamma - 1} R T\,\dot m\,\mathrm{d}t -
  \int P\,\mathrm{d}V`, for γ > 1: enthalpy in, work out;
* energy of the joint: :math:`\sum_i \int (P_i - P_\mathrm{atm})\,\mathrm{d}V_i = \Delta\tfrac12 J\dot q^2 +
  \int b_q\dot q^2\,\mathrm{d}t`: the work of the gas is what the joint keeps and what friction takes.
"""

from collections.abc import Sequence

import numpy as np

from pamid.bench.antagonist import Antagonist
from pamid.bench.controller import Controller, RunningController
from pamid.bench.integrate import RungeKutta4
from pamid.bench.parameters import BenchParameters
from pamid.bench.references import PERIOD, Trajectory


def balances(params: BenchParameters, runs: Sequence[Trajectory], substeps: int = 1) -> dict[str, float]:
    """Simulate the nominal bench and return what its balances leave."""
    params = params.replace(effects=())
    n, g = len(runs), params.gas.heat_capacity_ratio
    bench = Antagonist(params, n)
    control = RunningController(Controller(), params, runs)
    plant, r = bench.plant, params.joint.pulley_radius
    turn = np.array([[-r], [r]])
    J, damping = params.joint.inertia, params.joint.viscous_damping

    def rates(y: np.ndarray, out: np.ndarray, ahead: float) -> None:
        """Add to the rates of the bench those of the quadratures, net and absolute."""
        bench.rates(y[:4], out[:4], ahead)
        m, P = bench.muscles, y[2:4]
        supply = P ** (1.0 / g - 1.0) * plant.RT * m.mdot
        work = m.F * -(turn * y[1])  # p dV/dt of each muscle
        enthalpy = g * plant.RT * m.mdot
        against_gas = (g - 1.0) * (work + plant.atmospheric_pressure * work / (P - plant.atmospheric_pressure))
        out[4:6], out[6:8] = supply, np.abs(supply)
        out[8:10], out[10:12] = enthalpy - against_gas, np.abs(enthalpy) + np.abs(against_gas)
        out[12] = work.sum(0) - damping * y[1] ** 2
        out[13] = np.abs(work).sum(0)

    def volumes(y: np.ndarray) -> np.ndarray:
        lengths = plant.rest_length * (1.0 - plant.initial_contraction) + turn * y[0]
        return plant.volume(1.0 - lengths / plant.rest_length)

    y = np.zeros((14, n))
    y[0] = [run.q_ref[0] for run in runs]
    y[2:4] = control.initial_pressure()
    content, energy, motion = y[2:4] ** (1.0 / g) * volumes(y), y[2:4] * volumes(y), 0.5 * J * y[1] ** 2
    solver = RungeKutta4(rates, y.shape)
    for k in range(len(runs[0].q_ref)):
        bench.muscles.hold(control.command(k, y[0], y[2:4]))
        for _ in range(substeps):
            solver.first(y)
            solver.advance(y, PERIOD / substeps)
    out = {"gas": y[2:4] ** (1.0 / g) * volumes(y) - content - y[4:6]}
    scale = {"gas": y[6:8], "gas_energy": y[10:12], "joint_energy": y[13]}
    if g > 1.0:
        out["gas_energy"] = y[2:4] * volumes(y) - energy - y[8:10]
    out["joint_energy"] = 0.5 * J * y[1] ** 2 - motion - y[12]
    return {name: float(np.max(np.abs(value) / scale[name])) for name, value in out.items()}
