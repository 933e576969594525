"""Fast states between rows: a simulator that takes several steps a sample is not compared with runs of fewer."""

import numpy as np
import pandas as pd

from pamid.gap import diagnose_simulator
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, FunctionSimulator, ModelParameter, Port

RLC = EquationSimulator(
    {"dvc/dt": "i/C", "di/dt": "(e - R*i - vc)/L"},
    [Port("e", "input", "V"), Port("vc", "state", "V"), Port("i", "state", "A")],
    {"R": ModelParameter(4.0, 0.1), "L": ModelParameter(0.012, 0.1), "C": ModelParameter(9e-5, 0.1)},
)


def test_predictions_are_those_of_the_present_steps():
    rng, dt, rows = np.random.default_rng(0), 2e-4, 900
    e = np.interp(np.arange(rows), np.arange(0, 925, 25), rng.uniform(-10, 10, 37))
    vc, i, read = 0.0, 0.0, []
    for k in range(rows):
        read.append(vc)
        for j in range(20):
            now = e[k] + j / 20 * (e[min(k + 1, rows - 1)] - e[k])
            i += dt / 20 * (now - 4.1 * i - vc) / 0.0121
            vc += dt / 20 * i / 9.1e-5
    log = pd.DataFrame({"trajectory": "1", "time": dt * np.arange(rows), "e": e, "vc": read})
    log["vc"] += 2e-3 * rng.standard_normal(rows)
    evidence = evidence_of(log, RLC, refit=True)
    numbers = evidence.simulator.numbers
    found = {}
    for steps in (1, 8, 1):
        evidence.substeps = steps
        evidence._along.clear()
        found.setdefault(steps, evidence._predict(evidence._x0, [], numbers))
    assert 1e-6 < np.max(np.abs(found[1] - found[8])) < 1.0


class AnyStep(FunctionSimulator):
    """A function that runs over any times, as an FMU does."""

    kinds = ()
    any_step = True


def lagging(u, p, x0):
    """A coil behind a voltage, which is held over each step of the times that are asked for."""
    i, share = np.zeros(len(u.time)), np.exp(-np.diff(u.time) / 7e-4)
    for k in range(len(share)):
        i[k + 1] = u.u[k] / p.R + share[k] * (i[k] - u.u[k] / p.R)
    return [i]


def test_whole_runs_go_with_inputs_in_lines_where_that_explains_more():
    rng, t = np.random.default_rng(0), 5e-3 * np.arange(1200)
    fine = np.linspace(0.0, t[-1], 40 * (len(t) - 1) + 1)
    u = 5.0 * np.sin(9.0 * fine) + 3.0 * np.sin(23.0 * fine)
    i, h = np.zeros(len(fine)), fine[1] - fine[0]
    for k in range(len(fine) - 1):
        i[k + 1] = i[k] + h * (0.5 * (u[k] + u[k + 1]) / 1.1 - i[k]) / 7e-4 * (1.0 - 0.5 * h / 7e-4)
    log = pd.DataFrame({"trajectory": "1", "time": t, "u": u[::40], "i": i[::40] + 5e-3 * rng.standard_normal(len(t))})
    ports = [Port("u", "input", "V"), Port("i", "output", "A")]
    coil = AnyStep(lagging, ports, {"R": ModelParameter(1.1, 0.05, "Ohm")}, form="run")
    found = diagnose_simulator(log, coil, ["sensor_lag", "actuator_delay"])
    assert found.verdict == "none"
    assert any("interpolated between rows" in note for note in found.notes)
