"""Residuals with independent noise."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.bench import BenchParameters, simulate, sine, step
from pamid.equations import residuals
from pamid.gap.inference.gauss_newton import Fitter
from pamid.gap.inference.student_t import loglik
from pamid.gap.residuals.bench import Evidence
from pamid.gap.residuals.whitening import Whitening

BENCH = BenchParameters.for_muscle("B").replace(tolerance={})


@pytest.fixture(scope="module")
def log() -> pd.DataFrame:
    return simulate(BENCH, [sine(2, 15, 6000), sine(6, 10, 6000), step(0, 15, 4000)], seed=3)


def _lagged(evidence: Evidence, z: np.ndarray, equation: str) -> tuple[float, float]:
    """Return the correlation with the next window, and the deviation of sums over ten windows."""
    part = evidence.parts[evidence.equations.index(equation)]
    key = evidence.run[part] * 2 + evidence.side[part]
    series = [z[part][key == k] for k in np.unique(key)]
    products = sum(float(x[1:] @ x[:-1]) for x in series) / sum(float(x @ x) for x in series)
    slow = np.concatenate([x[: len(x) // 10 * 10].reshape(-1, 10).sum(axis=1) for x in series]) / np.sqrt(10)
    return products, float(np.std(slow))


@pytest.mark.parametrize("equation", ["flow", "joint"])
def test_noise_becomes_independent(log: pd.DataFrame, equation: str) -> None:
    evidence = Evidence(log, BENCH)
    before, slow_before = _lagged(evidence, evidence.raw(evidence.z0), equation)
    after, slow_after = _lagged(evidence, evidence.z0, equation)
    assert abs(after) < 0.12
    assert 0.75 < slow_after < 1.3
    if equation == "flow":  # whose noise is mostly that of the pressure's change
        assert before < -0.25
        assert slow_before < 0.7


def test_raw_undoes_white(log: pd.DataFrame) -> None:
    evidence = Evidence(log, BENCH)
    z = np.random.RandomState(0).standard_normal((len(evidence.z0), 3))
    np.testing.assert_allclose(evidence.raw(evidence.white(z)), z, atol=1e-12)
    np.testing.assert_allclose(evidence.white(z[:, 1]), evidence.white(z)[:, 1])


def test_raw_is_the_residual_of_the_equation(log: pd.DataFrame) -> None:
    evidence = Evidence(log, BENCH)
    part = evidence.parts[evidence.equations.index("flow")]
    raw = (evidence.raw(evidence.z0) * evidence.noise)[part]
    # A diagnosis leaves out the ends of runs, where an effect's memory is not yet known.
    whole = {t: r for t, e, r in residuals(log, BENCH, ["flow"])}
    for k, name in enumerate(evidence.trajectories):
        mine = (evidence.block[part] == k) & (evidence.side[part] == 0)
        at = np.searchsorted(whole[name].time, evidence.time[part][mine] - 1e-9)
        np.testing.assert_allclose(raw[mine], whole[name].value[at, 0], rtol=0.05, atol=2e-8)


def test_covariance_is_what_the_factor_gives() -> None:
    """White noise turned back has the covariance that was asked for."""
    w = Whitening()
    w.add(slice(0, 4000), [np.full(4000, -0.45)], 2)
    x = w.raw(np.random.RandomState(1).standard_normal(4000))
    assert np.mean(x[2:] * x[:-2]) == pytest.approx(-0.44, abs=0.05)
    assert abs(np.mean(x[1:] * x[:-1])) < 0.05
    assert np.mean(x**2) == pytest.approx(1.0, abs=0.08)


def test_flow_of_a_fast_motion_has_no_bias() -> None:
    """What flow and pressure change within a sample does not pose as a leak."""
    log = simulate(BENCH, [sine(10, 20, 4000)], seed=0)
    _, _, flow = next(residuals(log, BENCH, ["flow"]))
    assert abs(float(flow.value.mean())) < 1e-4 * float(np.abs(flow.measured).mean())


def test_a_covariance_that_is_none_is_trusted_less() -> None:
    w = Whitening()
    w.add(slice(0, 500), [np.full(500, -0.6)], 1)
    z = np.random.RandomState(2).standard_normal(500)
    assert np.all(np.isfinite(w.white(z)))
    np.testing.assert_allclose(w.raw(w.white(z)), z)


def test_no_columns_stay_none() -> None:
    """A simulator without tolerances has none."""
    w = Whitening()
    w.add(slice(0, 500), [np.full(500, -0.3)], 1)
    for _ in range(100):
        assert w.white(np.zeros((500, 0))).shape == (500, 0)


def test_a_nominal_bench_with_lagging_sensors_is_whitened(log: pd.DataFrame) -> None:
    lagging = BENCH.replace(effects=[("pressure_lag", {"time_constant": 0.02}), ("force_lag", {"time_constant": 0.02})])
    evidence = Evidence(log, lagging)
    assert np.all(np.isfinite(evidence.z0))
    np.testing.assert_allclose(evidence.white(evidence.raw(evidence.z0)), evidence.z0, atol=1e-9)


def test_an_unwhitened_fit_is_best_for_unwhitened_windows(log: pd.DataFrame) -> None:
    tolerance = {"rest_diameter": 0.005, "braid_angle": 0.005, "sonic_conductance": 0.02}
    off = simulate(BENCH.replace(effects=[("force_gain", {"deviation": 0.01})]), [sine(2, 15, 3000)], seed=1)
    evidence = Evidence(off, BENCH.replace(tolerance=tolerance))
    fitter = Fitter(evidence)
    base = fitter.base()
    seen = fitter.unwhitened(base)
    raw = [loglik(evidence.raw(f.z), evidence.parts)[0] for f in (base, seen)]
    white = [loglik(f.z, evidence.parts)[0] for f in (base, seen)]
    assert raw[1] >= raw[0] - 1e-6
    assert white[0] >= white[1] - 1e-6
    assert np.all(np.abs(seen.x) <= fitter.high)


@pytest.mark.parametrize("memory", [0.5, 0.9, 0.97])
def test_noise_that_a_simulator_adds_up_has_unit_size_once_it_is_white(memory: float) -> None:
    rng, drawn = np.random.default_rng(3), np.empty((6, 800))
    for one in drawn:  # a reading's own noise beside what lasts
        steps = rng.standard_normal(800)
        for k in range(1, 800):
            steps[k] += memory * steps[k - 1]
        one[:] = rng.standard_normal(800) + steps / np.std(steps)
    w = Whitening()
    w.learn(slice(0, 800), drawn / np.sqrt(2.0), np.zeros(800, dtype=int))
    white = np.array([w.white(one / np.sqrt(2.0)) for one in drawn])
    assert np.std(white) == pytest.approx(1.0, abs=0.05)
