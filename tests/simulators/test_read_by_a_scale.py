"""A stage of which a scale alone is read: an amplifier that swings, and a scale whose error repeats."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pamid.effects.lags import ValveLag
from pamid.gap import diagnose_simulator
from pamid.simulators import FunctionSimulator, Port


def stage(t, x, u, p):
    return [x.v, 40.0 * u.V - 60.0 * x.s - 6.0 * x.v]


def stage_log(*, swing: bool = False, ripple: float = 0.0) -> tuple[pd.DataFrame, FunctionSimulator]:
    """Return a log of a stage of which a scale alone is read, and its simulator."""
    rng, parts, dt, fine = np.random.default_rng(4), [], 0.004, 20
    for k in range(3):
        V = np.repeat(rng.normal(size=40), 20)
        s = v = 0.0
        y, w, rows = V[0], 0.0, []
        for given in V:
            rows.append(s)
            for _ in range(fine):
                h = dt / fine
                if swing:  # 25 Hz, damping ratio 0.6
                    w += h * ((2 * np.pi * 25) ** 2 * (given - y) - 2 * 0.6 * 2 * np.pi * 25 * w)
                    y += h * w
                v += h * (40.0 * (y if swing else given) - 60.0 * s - 6.0 * v)
                s += h * v
        read = np.array(rows) + ripple * np.sin(30.0 * np.array(rows) + 1.0) + 2e-5 * rng.standard_normal(len(rows))
        parts.append(pd.DataFrame({"trajectory": f"run{k}", "time": dt * np.arange(len(V)), "V": V, "y": read}))
    ports = [Port("V", "input", "V"), Port("s", "state", "-", column=""), Port("v", "state", "-", column=""),
             Port("y", "output", "m")]  # fmt: skip
    simulator = FunctionSimulator(stage, ports, output=lambda t, x, u, p: [x.s])
    return pd.concat(parts, ignore_index=True), simulator


def test_an_amplifier_that_swings_is_one_cause() -> None:
    log, simulator = stage_log(swing=True)
    [cause] = diagnose_simulator(log, simulator).causes
    assert (cause.effects[0], cause.where[0]) == ("actuator_lag", "V")  # or the reading swings
    lag = ValveLag(**{name: p.value for name, p in cause.parameters.items()})
    frequency, damping = lag._spring()
    assert abs(frequency / (2 * np.pi * 25) - 1.0) < 0.1 and abs(damping - 0.6) < 0.1


def test_a_scale_in_metres_may_repeat_an_error() -> None:
    log, simulator = stage_log(ripple=4e-4)
    [cause] = diagnose_simulator(log, simulator).causes
    assert (cause.effects, cause.where) == (("sensor_ripple",), ("y",))
    assert abs(cause.parameters["rate"].value / 30.0 - 1.0) < 0.02
