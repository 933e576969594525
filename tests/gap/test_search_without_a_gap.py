"""Where nothing exceeds the noise, no set of several effects is refitted, nor one that cannot be a gap."""

import numpy as np
import pandas as pd

from pamid.gap import diagnose_simulator
from pamid.simulators import EquationSimulator, Port

TANKS = EquationSimulator(
    {"da/dt": "0.4*q - 0.3*a", "db/dt": "0.3*a - 0.2*b"},
    [Port("q", "input", "m3/s"), Port("a", "state", "m"), Port("b", "state", "m")],
    {},
)


def filled(rows=600, dt=0.1):
    rng, runs = np.random.default_rng(0), []
    for run in range(2):
        q, a, b, levels = np.repeat(rng.uniform(0, 2, rows // 30), 30), 1.0, 1.0, []
        for now in q:
            levels.append((a, b))
            for _ in range(20):
                a, b = a + dt / 20 * (0.4 * now - 0.3 * a), b + dt / 20 * (0.3 * a - 0.2 * b)
        read = np.array(levels) + 0.01 * rng.standard_normal((rows, 2))
        runs.append(pd.DataFrame({"trajectory": str(run), "time": dt * np.arange(rows), "q": q}))
        runs[-1][["a", "b"]] = read
    return pd.concat(runs, ignore_index=True)


def test_sets_are_not_refitted_where_nothing_exceeds_the_noise():
    said = []
    assert diagnose_simulator(filled(), TANKS, progress=said.append).verdict == "none"
    refitted = [text for text in said if text.startswith("refit with ")]
    assert not [text for text in refitted if "," in text]
    assert not [text for text in refitted if "gain" in text or "leakage" in text]
