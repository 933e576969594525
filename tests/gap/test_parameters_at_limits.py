"""A parameter that a fit moves to the end of its tolerance is said: more may be wrong with it than was allowed."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pamid.gap import diagnose
from pamid.simulators import FunctionSimulator, Port


def rates(t, x, u, p):
    """Return the rate of a heated body."""
    return [(u.power - p.loss * x.T) / p.capacity]


BODY = FunctionSimulator(
    rates, [Port("power", "input", "W"), Port("T", "state", "K")],
    {"capacity": (50.0, 0.0, "J/K"), "loss": (2.0, 0.1, "W/K")},
)  # fmt: skip


def log(loss: float) -> pd.DataFrame:
    """Return a log of two runs, with another loss."""
    rng, runs = np.random.default_rng(4), []
    for run in range(2):
        t, T = np.arange(0.0, 200.0, 1.0), 30.0
        power, rows = 100.0 + 60.0 * np.sin(0.05 * (1 + run) * t), []
        for P in power:
            rows.append(T)
            T = P / loss + (T - P / loss) * np.exp(-loss / 50.0)
        noisy = np.array(rows) + 0.05 * rng.standard_normal(len(t))
        runs.append(pd.DataFrame({"trajectory": str(run), "time": t, "power": power, "T": noisy}))
    return pd.concat(runs, ignore_index=True)


def test_a_parameter_at_the_end_of_its_tolerance_is_said() -> None:
    said = [n for n in diagnose(log(1.5), BODY, ["heat_loss"]).notes if "tolerance" in n]
    assert len(said) == 1 and said[0].startswith("loss is at the lower end of its tolerance, 1.8 W/K.")
    assert not [n for n in diagnose(log(1.9), BODY, ["heat_loss"]).notes if "tolerance" in n]
