"""When within a sample an input acts is unknown of what a dead zone passes on, not of the command before it."""

import numpy as np
import pandas as pd

import pamid
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, Port

DT, WIDTH = 0.02, 1.5
PORTS = [Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]
RAIL = EquationSimulator(
    {"dx/dt": "v", "dv/dt": "(F - b*v - k*x)/m"}, PORTS, {"m": (2.0, 0.02, "kg"), "b": 3.0, "k": 40.0}
)


def log_of(late):
    """A rail behind a dead zone, whose input acts a share of a sample after its row."""
    rng, runs, parts = np.random.default_rng(5), [], 40
    for k in range(3):
        t = np.arange(0, 12, DT)
        F = 6 * np.sin((3 + 2 * k) * t) + 3 * np.sin(9.3 * t + k)
        passed = np.sign(F) * np.maximum(np.abs(F) - WIDTH, 0.0)
        x, v, rows = 0.0, 0.0, []
        for n in range(len(t)):
            rows.append((x, v))
            for j in range(parts):
                f = passed[n] if j >= late * parts else passed[max(n - 1, 0)]
                v += DT / parts * (f - 3.0 * v - 40.0 * x) / 2.0
                x += DT / parts * v
        x, v = np.array(rows).T
        noise = {"x": x + 2e-5 * rng.standard_normal(len(t)), "v": v + 1e-4 * rng.standard_normal(len(t))}
        runs.append(pd.DataFrame({"trajectory": str(k), "time": t, "F": F, **noise}))
    return pd.concat(runs, ignore_index=True)


def test_a_command_that_acts_half_a_sample_late_behind_a_dead_zone_is_no_delay():
    found = pamid.diagnose(log_of(0.5), RAIL, ["actuator_dead_zone", "actuator_delay", "actuator_lag", "actuator_gain"])
    assert [c.effects for c in found.causes] == [("actuator_dead_zone",)]
    assert abs(found.causes[0].parameters["width"].value - WIDTH) < 0.05


def test_a_delay_of_three_samples_behind_a_dead_zone_is_one():
    log = log_of(0.0)
    log["F"] = log.groupby("trajectory")["F"].shift(-3).ffill()
    found = pamid.diagnose(log, RAIL, ["actuator_dead_zone", "actuator_delay", "actuator_gain"])
    assert {c.effects[0] for c in found.causes} == {"actuator_dead_zone", "actuator_delay"}


def test_slopes_follow_what_the_effect_passes_on():
    evidence = evidence_of(log_of(0.0), RAIL, refit=True)
    spec, j = {"actuator_dead_zone@F": {"width": 0.15, "skew": 0.0}}, evidence.free.index("timing of F")
    x = 0.5 * np.eye(len(evidence.free))[j]
    moved = evidence.z(spec, dict(zip(evidence.free, x, strict=True))) - evidence.z(spec)
    assert np.allclose(0.5 * evidence.slopes(spec, 0.0 * x)[:, j], moved)
    assert np.linalg.norm(moved - 0.5 * evidence.slopes({}, 0.0 * x)[:, j]) > 0.1 * np.linalg.norm(moved)
