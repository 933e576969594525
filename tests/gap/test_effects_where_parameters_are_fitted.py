"""What an effect changes in predictions is laid out where the parameters are fitted: they compensate most of it."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap.inference.gauss_newton import Fitter
from pamid.gap.inference.sensitivity import laid
from pamid.gap.simulated import evidence_of, learn
from pamid.simulators import EquationSimulator, Port

DT, LAG = 0.01, 0.115
ROCKET = EquationSimulator(
    {"dz/dt": "v", "dv/dt": "f - 9.81", "df/dt": "(kf*u - f)/tau"},
    [
        Port("u", "input", "-"), Port("z", "state", "m"), Port("v", "state", "m/s", start=0.0),
        Port("f", "state", "m/s^2", start=9.81),
    ],
    {"kf": (18.0, 0.05, "m/s^2"), "tau": (0.1, 0.2, "s")},
)  # fmt: skip


def flown() -> pd.DataFrame:
    """Return a flight of a rocket whose thrust lags more than its simulator says."""
    t, x, read, fine = DT * np.arange(300), np.array([0.0, 0.0, 9.81]), [], 20
    u = 0.545 + 0.05 * np.sin(3.0 * t)
    for now in u:
        read.append(x[0])
        for _ in range(fine):
            x = x + DT / fine * np.array([x[1], x[2] - 9.81, (18.0 * now - x[2]) / LAG])
    z = np.array(read) + 1e-3 * np.random.default_rng(0).standard_normal(len(t))
    return pd.DataFrame({"trajectory": "0", "time": t, "u": u, "z": z})


def test_effects_are_laid_out_where_parameters_are_fitted() -> None:
    evidence, name = evidence_of(flown(), ROCKET, refit=True), "actuator_bias@u"
    x = np.zeros(len(evidence.free))
    x[evidence.free.index("tau")] = -1.0
    at = dict(zip(evidence.free, map(float, x), strict=True))
    size = 0.1 * evidence.effects[name].parameters[0].nominal
    exact = (evidence.z({name: {"offset": size}}, at) - evidence.z({}, at)) / size
    there, here = (laid(evidence, name, at)[0].columns[:, 0] for at in (x, None))
    assert np.linalg.norm(there - exact) < 2e-3 * np.linalg.norm(exact) < np.linalg.norm(here - exact)


def test_they_are_laid_out_at_the_fit_without_effects(monkeypatch: pytest.MonkeyPatch) -> None:
    evidence, asked = evidence_of(flown(), ROCKET, refit=True), []
    fitted = Fitter(evidence).base().x
    monkeypatch.setattr("pamid.gap.simulated.laid", lambda *given: asked.append(given[2]) or laid(*given))
    learn(evidence, ["actuator_bias@u"])
    assert asked and all(np.array_equal(x, fitted) for x in asked)
