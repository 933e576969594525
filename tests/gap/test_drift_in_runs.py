"""A parameter that drifts anew in every run, such as an activity that fades, or a store that empties."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.catalogue import in_port_units

PORTS = [Port("feed", "input", "mol/s"), Port("c", "state", "mol/m3")]
SHARES = ["actuator_bias", "actuator_gain", "parameter_deviation", "parameter_drift", "parameter_drift_in_runs"]
RATE = -0.006


def reactor():
    return FunctionSimulator(lambda t, x, u, p: [u.feed - p.k * x.c], PORTS, {"k": (0.2, 0.05, "1/s")})


def fading(runs, seconds=50.0, dt=0.1):
    """Return runs of a decay whose rate falls in each of them anew."""
    rng, found = np.random.default_rng(3), []
    for run in range(runs):
        t = np.arange(0.0, seconds, dt)
        feed, c, rows = 1.0 + 0.6 * np.sin((0.3 + 0.2 * run) * t), 4.0, []
        for time, f in zip(t, feed, strict=True):
            rows.append(c)
            for _ in range(5):
                c += dt / 5 * (f - 0.2 * (1.0 + RATE * time) * c)
        read = np.array(rows) + 0.005 * rng.standard_normal(len(t))
        found.append(pd.DataFrame({"trajectory": f"run {run}", "time": t, "feed": feed, "c": read}))
    return pd.concat(found, ignore_index=True)


def test_a_drift_that_begins_anew_in_every_run_is_named_with_its_rate() -> None:
    found = diagnose_simulator(fading(3), reactor(), SHARES)
    [cause] = found.causes
    assert cause.effects == ("parameter_drift_in_runs",) and cause.where == ("k",)
    rate = cause.parameters["rate"]
    assert rate.unit == "1/s" and rate.value == pytest.approx(RATE, rel=0.1)
    assert "drift of parameter k in each run" in str(found)
    assert ("parameter_drift_in_runs", "k", {"rate": rate.value}) in found.corrected.effects
    changed = in_port_units("parameter_drift_in_runs", "k", {"rate": RATE}).adjust({"value": 0.2, "since": 50.0})
    assert changed["value"] == pytest.approx(0.2 * (1.0 + 50.0 * RATE))


def test_in_a_single_run_there_is_one_drift() -> None:
    drifts = [evidence_of(fading(runs), reactor()).placements for runs in (1, 2)]
    assert ["parameter_drift_in_runs@k" in found for found in drifts] == [False, True]
    assert all("parameter_drift@k" in found for found in drifts)


def test_a_simulator_of_whole_runs_has_one_number_in_each():
    def whole(u, p, x0):
        c, out = 4.0, []
        for f in u["feed"]:
            out.append(c)
            c += 0.1 * (f - p["k"] * c)
        return [np.array(out)]

    simulator = FunctionSimulator(whole, [PORTS[0], Port("c", "output", "mol/m3")], {"k": (0.2, 0.05, "1/s")})
    assert not any("drift_in_runs" in name for name in evidence_of(fading(2), simulator).placements)
