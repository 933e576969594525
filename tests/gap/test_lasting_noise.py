"""Noise of readings that lasts, as filters of sensors leave it: it is no gap, and hides none."""

import numpy as np
import pandas as pd
import pytest

import pamid
from pamid.gap.inference.gauss_newton import Fitter
from pamid.gap.residuals.lasting_noise import Octaves, lasting, likeliest, memories
from pamid.gap.residuals.measured_inputs import white_over
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, Port

TANK = EquationSimulator(
    {"dh/dt": "(q - c*sqrt(h))/A"},
    [Port("q", "input", "m^3/s"), Port("h", "state", "m")],
    {"c": (0.4, 0.05), "A": (30.0, 0.05, "m^2")},
)
LIBRARY = ["parameter_deviation", "actuator_gain", "actuator_bias", "sensor_gain", "sensor_bias", "leakage"]
MEMORY = 6.0


def filled(seed: int, area: float = 30.0, exponent: float = 0.5, ripple: float = 0.0) -> pd.DataFrame:
    """Return three runs of a tank whose level sensor filters its noise, or reads in waves instead."""
    rng, runs, fine = np.random.default_rng(seed), [], 10
    for run in range(3):
        q, h, rows = np.repeat(rng.uniform(0.1, 0.9, 40), 25), 1.5, []
        for now in q:
            rows.append(h)
            for _ in range(fine):
                h += (now - 0.4 * max(h, 0.0) ** exponent) / area / fine
        level, white = np.array(rows), rng.standard_normal(len(q))
        error = ripple * np.sin(60.0 * level) + 2e-3 * white if ripple else 4e-3 * lasting_noise(white, MEMORY)
        table = {"trajectory": str(run), "time": np.arange(len(q)), "q": q, "h": level + error}
        runs.append(pd.DataFrame(table))
    return pd.concat(runs, ignore_index=True)


def lasting_noise(white: np.ndarray, memory: float) -> np.ndarray:
    """Return noise of a first-order filter."""
    rho, out = np.exp(-1.0 / memory), white.copy()
    for k in range(1, len(out)):
        out[k] = rho * out[k - 1] + np.sqrt(1.0 - rho**2) * white[k]
    return out


def test_draws_last_and_show_what_neighbouring_samples_do() -> None:
    spans = [(0, 4000), (4000, 9000)]
    drawn = lasting(8.0, 0.2, spans, 5, np.random.RandomState(1))
    one = drawn[0, 4000:]
    assert np.corrcoef(one[:-8], one[8:])[0, 1] == pytest.approx(np.exp(-1.0), abs=0.06)
    assert np.mean([white_over(x, spans, 10) for x in drawn]) == pytest.approx(0.2, rel=0.05)
    assert np.std(drawn) > 2.0 * 0.2  # most of it does not show from sample to sample


def test_a_memory_is_found_from_powers_in_octaves() -> None:
    rng, n = np.random.RandomState(2), 6000
    octaves = Octaves([slice(0, n)], np.repeat([0, 1], n // 2))
    long = [2.0 ** (0.5 * k) for k in range(-1, 12)]
    drawn = [lasting(m, 1.0, [(0, n // 2), (n // 2, n)], 6, rng) for m in long]
    white = octaves.powers(rng.standard_normal((6, n))).mean(axis=0)
    noises = [np.array([white, *(octaves.powers(x).mean(axis=0) for x in drawn)])]
    [power] = octaves.powers(0.9 * lasting(MEMORY, 1.0, [(0, n // 2), (n // 2, n)], 1, rng))
    [found] = likeliest(octaves, power, noises)
    assert long[found.memory - 1] == pytest.approx(MEMORY, rel=0.2)
    assert found.size == pytest.approx(0.9, rel=0.1)
    assert octaves.within(power, found.size**2 * octaves.powers(drawn[found.memory - 1]))
    assert not octaves.within(1.6 * power, found.size**2 * octaves.powers(drawn[found.memory - 1]))
    [white] = octaves.powers(rng.standard_normal((1, n)))
    assert likeliest(octaves, white, noises)[0].memory == 0


def test_noise_is_shorter_than_the_motion_that_a_sensor_reads() -> None:
    wave = np.sin(2.0 * np.pi * np.arange(2000) / 100.0)
    assert max(memories(wave, [(0, 2000)])) == pytest.approx(16.0)  # a cosine has fallen to 1/e after 19 of 100 samples


def test_noise_that_lasts_is_no_gap() -> None:
    found = pamid.diagnose(filled(1), TANK, LIBRARY)
    assert found.verdict == "none"
    [said] = [note for note in found.notes if "lasts longer than a sample" in note]
    assert "noise of h (" in said


def test_a_cause_is_named_beside_it() -> None:
    [cause] = pamid.diagnose(filled(2, area=36.0), TANK, LIBRARY).causes
    assert (cause.effects[0], cause.where[0]) == ("parameter_deviation", "A")
    estimate = cause.parameters["deviation"]
    assert estimate.ci90[0] < 0.2 < estimate.ci90[1]


def test_a_law_that_differs_is_a_gap_beside_it() -> None:
    assert pamid.diagnose(filled(3, exponent=0.75), TANK, ["sensor_bias"]).verdict != "none"


def test_an_error_that_goes_with_the_reading_is_a_gap() -> None:
    found = pamid.diagnose(filled(4, ripple=4e-3), TANK, LIBRARY)
    assert found.verdict != "none"
    evidence = evidence_of(filled(4, ripple=4e-3), TANK)
    base = Fitter(evidence).base()
    noise, z0 = evidence.noise.copy(), evidence.z0.copy()
    assert not evidence.hear_memory(base)
    assert np.array_equal(evidence.noise, noise) and np.array_equal(evidence.z0, z0)
