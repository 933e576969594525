"""Responses of runs to small changes, where an effect drives a run beyond all numbers."""

import numpy as np
import pandas as pd

from pamid.gap.residuals.response import Response
from pamid.gap.residuals.shooting import ShootingEvidence
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.port_log import port_log


def test_a_response_is_finite_where_an_effect_drives_a_run_beyond_all_numbers():
    t = 0.02 * np.arange(400)
    force = np.sin(3.0 * t)
    log = pd.DataFrame({"time": t, "force": force, "y": 0.01 * force})
    ports = [Port("force", "input", "N"), Port("y", "output", "m"), Port("x", "state", "m"), Port("v", "state", "m/s")]
    ports.append(Port("push", "state", "N"))
    simulator = FunctionSimulator(
        lambda t, x, u, p: [x.v, (x.push - p.k * x.x - 2.0 * x.v) / 1.5, 5.0 * (u.force - x.push)],
        ports, {"k": (80.0, 0.1, "N/m")}, output=lambda t, x, u, p: [x.x],
    )  # fmt: skip
    evidence = ShootingEvidence(port_log(log, simulator), simulator)
    drive = evidence._drive(
        evidence.active({"nonlinear_stiffness@x": {"square": 1.0, "cubic": 1.0}}), simulator.numbers
    )
    states = evidence.along.copy()
    states[:, 300:] = np.inf
    response = Response(simulator, evidence.log, evidence.log.starts, states, drive, evidence.joints)
    assert np.isfinite(response.rates).all()
    assert np.isfinite(response.of_start(0)).all()
