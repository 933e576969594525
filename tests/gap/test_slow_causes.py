"""A cause that acts slowly shows over long stretches, once the fast one that hid how exact an input is was named."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pamid.gap import diagnose_simulator
from pamid.simulators import EquationSimulator, Port

TANK = EquationSimulator(
    {
        "dT/dt": "(P*heater + UA*(Tj - T) - 50*(T - 18))/C",
        "dTj/dt": "(400*valve/100*(82 - Tj) - UA*(Tj - T) - 6*(Tj - 22))/Cj",
    },
    [Port("valve", "input", "%"), Port("heater", "input", "-"), *(Port(n, "state", "degC") for n in ("T", "Tj"))],
    {"P": (3000.0, 0.03, "W"), "UA": (420.0, 0.05, "W/K"), "C": (1.05e5, 0.03, "J/K"), "Cj": (2.4e4, 0.05, "J/K")},
)


def logged(power: float, lag: float, rows: int = 1500, fine: int = 10) -> pd.DataFrame:
    """Batches of a tank whose valve is logged to a percent, as it is commanded."""
    rng, parts, dt = np.random.default_rng(7), [], 0.5
    for batch in range(2):
        heater = (np.arange(rows) // 40 % rng.integers(2, 4) == 0).astype(float)
        valve = np.round(np.repeat(rng.uniform(5.0, 95.0, rows // 60 + 1), 60)[:rows] + rng.normal(0.0, 1.0, rows))
        T, Tj, read, found = 25.0, 25.0, 25.0, []
        for u, on in zip(valve, heater, strict=True):
            found.append((read, Tj))
            for _ in range(fine):
                h, over = dt / fine, 420.0 * (Tj - T)
                T += h * (power * on + over - 50.0 * (T - 18.0)) / 1.05e5
                Tj += h * (4.0 * u * (82.0 - Tj) - over - 6.0 * (Tj - 22.0)) / 2.4e4
                read += h * (T - read) / lag
        noisy = np.array(found) + 0.02 * rng.standard_normal((rows, 2))
        table = {"time": dt * np.arange(rows), "valve": valve, "heater": heater, "T": noisy[:, 0], "Tj": noisy[:, 1]}
        parts.append(pd.DataFrame({"trajectory": f"batch {batch}", **table}))
    return pd.concat(parts, ignore_index=True)


def test_a_wrong_power_shows_beside_a_sensor_that_lags() -> None:
    told: list[str] = []
    effects = ["sensor_lag", "parameter_deviation", "sensor_bias"]
    found = diagnose_simulator(logged(2580.0, 12.0), TANK, effects, progress=told.append)
    assert {(c.effects[0], c.where[0]) for c in found.added} == {("sensor_lag", "T"), ("parameter_deviation", "P")}
    sizes = {c.where[0]: next(iter(c.parameters.values())).value for c in found.added}
    assert abs(sizes["T"] - 12.0) < 0.6 and abs(sizes["P"] + 0.14) < 0.02
    assert any("over longer stretches" in text for text in told)
