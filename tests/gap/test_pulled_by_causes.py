"""Noise in a rate that a position gives: beside a leak it would change the bulk modulus, which alone it does not."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap.residuals.direct import DirectEvidence
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, Port
from pamid.simulators.port_log import port_log

DT, STEPS, STIFFNESS, LEAK = 0.01, 10, 2.33e6, 4.67
SIMULATOR = EquationSimulator(
    {
        "dphi/dt": "om",
        "dom/dt": "(250*p - 5886*cos(phi) - 3000*om)/900",
        "dp/dt": "k*(6.7e-4*u - 2.5e-3*om)",
    },
    [
        Port("u", "input", "-"),
        Port("phi", "state", "rad"),
        Port("om", "state", "rad/s", start=0.0),
        Port("p", "state", "bar"),
        Port("cylinder", "chamber", level="p"),
    ],
    {"k": (STIFFNESS, 0.1, "bar/m^3")},
)


@pytest.fixture(scope="module")
def leaking() -> pd.DataFrame:
    """Return a log of a boom on a hydraulic cylinder that leaks."""
    t, x, read = DT * np.arange(800), np.array([0.3, 0.0, 22.5]), []
    u = 0.07 + 0.3 * np.sin(1.3 * t) + 0.2 * np.sin(3.1 * t)

    def rates(x: np.ndarray, valve: float) -> np.ndarray:
        moved = (250.0 * x[2] - 5886.0 * np.cos(x[0]) - 3000.0 * x[1]) / 900.0
        return np.array([x[1], moved, STIFFNESS * (6.7e-4 * valve - 2.5e-3 * x[1]) - LEAK * x[2]])

    for valve in u:
        read.append(x)
        for _ in range(STEPS):
            x = x + DT / STEPS * rates(x + 0.5 * DT / STEPS * rates(x, valve), valve)
    phi, _, p = np.array(read).T
    rng = np.random.default_rng(0)
    phi, p = phi + 3.5e-4 * rng.standard_normal(len(t)), p + 0.15 * rng.standard_normal(len(t))
    return pd.DataFrame({"trajectory": "0", "time": t, "u": u, "phi": phi, "p": p})


def test_noise_pulls_a_parameter_beside_a_cause_that_compensates_it(leaking: pd.DataFrame) -> None:
    evidence = DirectEvidence(port_log(leaking, SIMULATOR), SIMULATOR, {"phi": "om"})
    place = evidence.placements["leakage@cylinder"]
    spec = {"leakage@cylinder": place.inward({"conductance": LEAK, "exponent": 1.0})}
    assert evidence.pulled_under(spec, np.zeros(len(evidence.free)))[1] > 10.0 * evidence.pulled[1]


def test_a_leak_is_a_share_of_the_pressure_each_second(leaking: pd.DataFrame) -> None:
    place = evidence_of(leaking, SIMULATOR).placements["leakage@cylinder"]
    values = {"conductance": LEAK, "exponent": 1.0}
    assert place.units["conductance"] == "1/s"
    p = np.array([20.0, 40.0])
    force = place.force(place.made(values), place.signals({"p": p}, np.zeros(2)), np.zeros((0, 2)))
    np.testing.assert_allclose(np.abs(force), LEAK * p, rtol=0.05)  # less near the pressure of the surroundings
