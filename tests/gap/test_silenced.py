"""A coil's current follows its drive at once: that its rate is nothing explains no wrong term of its equation."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.simulators import EquationSimulator, Port


def coil() -> EquationSimulator:
    ports = [Port("U", "input", "V"), Port("i", "state", "A")]
    return EquationSimulator({"di/dt": "(U - R*i)/L"}, ports, {"R": (2.0, 0.05, "ohm"), "L": (0.004, 0.1, "H")})


def log(*, bump: float = 0.0, inductance: float = 0.004) -> pd.DataFrame:
    rng, parts, dt, fine = np.random.default_rng(2), [], 0.004, 20
    for k in range(3):
        t = np.arange(1500) * dt
        U = np.repeat(rng.uniform(1.0, 10.0, 50), 30) + 0.5 * np.sin(9.0 * t)
        i, rows = U[0] / 2.0, []
        for u in U:
            rows.append(i)
            for _ in range(fine):
                i += dt / fine * (u - (2.0 + bump * np.exp(-(((i - 2.3) / 0.4) ** 2))) * i) / inductance
        read = np.array(rows) + 0.01 * rng.standard_normal(len(t))
        parts.append(pd.DataFrame({"trajectory": f"run{k}", "time": t, "U": U, "i": read}))
    return pd.concat(parts, ignore_index=True)


def test_a_parameter_that_silences_its_equation_is_no_cause() -> None:
    found = diagnose_simulator(log(bump=1.0), coil())
    assert found.verdict == "unknown" or all(c.where != ("L",) or c.with_reserve for c in found.causes), found.causes


@pytest.mark.parametrize("factor", [4.0, 60.0])
def test_one_that_is_far_larger_is(factor: float) -> None:
    [cause] = diagnose_simulator(log(inductance=0.004 * factor), coil()).causes
    [value] = (p.value for p in cause.parameters.values())
    assert cause.where == ("L",) and value == pytest.approx(factor - 1.0, rel=0.1)
