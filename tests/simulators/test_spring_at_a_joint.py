"""A cable that pulls at a joint like a spring, of which the simulator knows nothing."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.simulators import FunctionSimulator, Port

PORTS = [Port("torque", "input", "N m"), Port("q", "state", "rad"), Port("dq", "state", "rad/s")]
LIBRARY = ["spring", "gravity", "nonlinear_stiffness", "hysteresis", "actuator_bias", "coulomb_friction"]


def log_of(stiffness: float, moment: float) -> pd.DataFrame:
    rng, runs, h = np.random.default_rng(4), [], 1e-3
    for run in "abc":
        rate, phase = 2 * np.pi * rng.uniform(0.1, 0.9, 3), rng.uniform(0, 6, 3)
        q, dq, rows = 0.0, 0.0, []
        for k in range(8000):
            if k % 10 == 0:
                torque = 0.15 * float(np.sum(np.sin(rate * h * k + phase)))
                rows.append((0.01 * (k // 10), torque, q, dq))
            pull = moment - stiffness * q
            dq += h * (torque - 0.08 * dq + pull) / 0.01
            q += h * dq
        runs.append(pd.DataFrame(rows, columns=["time", "torque", "q", "dq"]).assign(trajectory=run))
    log = pd.concat(runs)
    return log.assign(q=log.q + 1e-4 * rng.standard_normal(2400), dq=log.dq + 3e-3 * rng.standard_normal(2400))


@pytest.mark.parametrize(("stiffness", "names"), [(0.3, ("spring",)), (0.0, ("actuator_bias",))])
def test_a_spring_is_named_where_one_pulls_and_not_for_a_constant_torque(stiffness, names):
    parameters = {"J": (0.01, 0.05, "kg m^2"), "b": (0.08, 0.1, "N m s/rad")}
    head = FunctionSimulator(lambda t, x, u, p: [x.dq, (u.torque - p.b * x.dq) / p.J], PORTS, parameters)
    (cause,) = diagnose_simulator(log_of(stiffness, 0.05), head, LIBRARY).causes
    assert cause.effects == names
    size, wanted = ("stiffness", 0.3) if stiffness else ("offset", 0.05)
    assert cause.parameters[size].value == pytest.approx(wanted, rel=0.05)
