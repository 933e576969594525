"""A parameter that is wrong by more than its tolerance is one unknown, not two."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap.inference.gauss_newton import Fitter
from pamid.gap.residuals.shooting import ShootingEvidence
from pamid.simulators import EquationSimulator, Port
from pamid.simulators.port_log import port_log

R0, TOLERANCE, TRUE = 0.03, 0.1, 0.045
NAME = "parameter_deviation@R0"
CELL = EquationSimulator(
    {"dv1/dt": "(I*R1 - v1)/12", "v": "3.9 - R0*I - v1"},
    [Port("I", "input", "A"), Port("v1", "state", "V", start=0.0), Port("v", "output", "V")],
    {"R0": (R0, TOLERANCE, "ohm"), "R1": (0.02, 0.2, "ohm")},
)


@pytest.fixture(scope="module")
def evidence() -> ShootingEvidence:
    rng, runs = np.random.default_rng(0), []
    for run in range(3):
        t = np.arange(200.0)
        current = np.repeat(rng.uniform(-2.0, 5.0, 8), 25)
        v1 = np.zeros(len(t))
        for k in range(1, len(t)):
            v1[k] = 0.02 * current[k - 1] + (v1[k - 1] - 0.02 * current[k - 1]) * np.exp(-1.0 / 12.0)
        v = 3.9 - TRUE * current - v1 + 1e-3 * rng.standard_normal(len(t))
        runs.append(pd.DataFrame({"trajectory": f"run {run}", "time": t, "I": current, "v": v}))
    return ShootingEvidence(port_log(pd.concat(runs), CELL), CELL, refit=True)


def test_a_fit_has_all_of_a_wrong_parameter_in_its_deviation(evidence: ShootingEvidence) -> None:
    fitter, k = Fitter(evidence), evidence.free.index("R0")
    begun = fitter.base().x
    assert abs(evidence.about[k] + begun[k]) > 0.5  # within the tolerance it goes as far as it can
    fit = fitter.refine({NAME: {"deviation": 0.2}}, near=begun)
    assert fit.x[k] == pytest.approx(-evidence.about[k], abs=1e-6)
    assert R0 * (1.0 + fit.spec[NAME]["deviation"]) == pytest.approx(TRUE, rel=5e-3)
    assert not np.any(evidence.slopes(fit.spec, fit.x)[:, k])


def test_folding_changes_no_residual(evidence: ShootingEvidence) -> None:
    spec, x = {NAME: {"deviation": 0.2}}, np.linspace(0.1, 0.3, len(evidence.free))
    folded = evidence.folded(spec, x)
    assert folded[1] is not x and folded[0] != spec
    named = [(s, dict(zip(evidence.free, map(float, v), strict=True))) for s, v in ((spec, x), folded)]
    before, after = (evidence.z(*one) for one in named)
    assert after == pytest.approx(before, abs=1e-8)
