"""Stretches that are evaluated as one run give what each gives by itself, and filters over all what each gives."""

import numpy as np
import pytest

from pamid.bench import BenchParameters, simulate, sine, step
from pamid.effects import all_effects
from pamid.effects.registry import chosen_effects
from pamid.gap.residuals.bench import Evidence
from pamid.signals.paths import Path
from pamid.signals.recursion import recursive

NOMINAL = BenchParameters.for_muscle("B").replace(tolerance={"rest_diameter": 0.005, "sonic_conductance": 0.02})


@pytest.fixture(scope="module")
def log():
    return simulate(NOMINAL, [sine(2, 10, 807), step(3, 10, 633), sine(5, 11, 711)], seed=0)


@pytest.mark.parametrize("lacking", [[], ["F1", "F2"], ["mdot1", "mdot2"]], ids=["whole", "no force", "no flow"])
def test_joined_stretches_give_the_residuals_of_each(log, lacking):
    evidence = Evidence(log.drop(columns=lacking), NOMINAL)
    assert [len(places) for _, places in evidence._joined] == [3]
    one_by_one = [(run, range(k, k + 1)) for k, run in enumerate(evidence.runs)]
    for name in chosen_effects("all", "bench"):
        spec = {name: {p.name: p.nominal or 0.01 * p.upper for p in all_effects()[name].parameters}}
        together = evidence.z(spec)
        evidence._joined, kept = one_by_one, evidence._joined
        apart = evidence.z(spec)
        evidence._joined = kept
        # What the smoothing of the speed left out is scaled by its spread, which is that of all stretches together:
        # small differences count where friction fades at low speed.
        close = 1e-2 if "F1" in lacking else 1e-9
        assert np.max(np.abs(together - apart)) <= close * max(1.0, np.max(np.abs(apart))), name


def test_recursion_is_a_filter_that_begins_anew():
    from scipy.signal import lfilter

    x = np.random.default_rng(0).standard_normal((50, 2))
    starts = np.array([0, 20, 35])
    found = recursive(x, [0.7, -0.2], starts)
    for a, b in ((0, 20), (20, 35), (35, 50)):
        assert found[a:b] == pytest.approx(lfilter([1.0], [1.0, -0.7, 0.2], x[a:b], axis=0))
    changing = np.linspace(0.1, 0.9, 50)
    y = recursive(x[:, 0], [changing])
    assert y[30] == pytest.approx(x[30, 0] + changing[30] * y[29])


def test_a_path_turns_lane_by_lane():
    position = np.array([[0.0, 1.0], [1.0, 0.0], [0.5, 2.0], [2.0, 2.0], [1.0, 3.0]])
    turns = Path(position, np.array([0, 3])).turns
    assert turns.values.shape[1] == 4
    assert turns.values[:3, 0].tolist() == [0.0, 1.0, 0.5]
    assert turns.before[2].tolist() == [1.0, 0.0]
    assert turns.before[4].tolist() == [2.0, 2.0]
