"""How far a gap closes on a run that was left out: a refit without it stays where its parameters and the runs allow."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap.diagnosis.closure import Clusters
from pamid.gap.inference.gauss_newton import Fitter
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port

NAME = "coulomb_friction@x"
RAIL = FunctionSimulator(
    lambda t, x, u, p: [x.v, u.F / p.m],
    [Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")],
    {"m": (2.0, 0.05, "kg")},
)


@pytest.fixture(scope="module")
def fitter() -> Fitter:
    """Three runs of a mass on a rail with dry friction that fades at low speeds."""
    rng, runs = np.random.default_rng(3), []
    for k, size in enumerate((5.0, 5.0, 3.0)):
        t, x, v = np.arange(0, 8, 0.01), [0.0], [0.0]
        F = size * (np.sin((1 + k) * t) + 0.6 * np.sin(0.7 * t))
        for f in F[:-1]:
            v.append(v[-1] + 0.005 * (f - np.tanh(v[-1] / 0.3)))
            x.append(x[-1] + 0.005 * (v[-1] + v[-2]))
        noise = {"x": x + 1e-5 * rng.standard_normal(800), "v": v + 1e-3 * rng.standard_normal(800)}
        runs.append(pd.DataFrame({"trajectory": f"{k}", "time": t, "F": F, **noise}))
    return Fitter(evidence_of(pd.concat(runs, ignore_index=True), RAIL))


@pytest.fixture
def clusters(fitter: Fitter) -> Clusters:
    size = fitter.evidence.placements[NAME].factor("amplitude")
    return Clusters(fitter, fitter.refine({NAME: {"amplitude": 1.0 / size}}))


def rms(z: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(z))))


def far(clusters: Clusters, t: int) -> np.ndarray:
    """Return the long step that the other runs take without bounds, once slopes promise them much of it."""
    other = (t + 1) % len(clusters.H)
    clusters.g[other] = 1e4 * clusters.g[other] + 1e3 * clusters.size
    H, g = clusters.H.sum(axis=0) - clusters.H[t] + clusters.prior, clusters.g.sum(axis=0) - clusters.g[t]
    return clusters._solve(H, g, clusters.moving)


def test_beside_the_fit_nothing_is_extrapolated(clusters: Clusters) -> None:
    nothing = np.zeros(clusters.A.shape[1])
    np.testing.assert_allclose(clusters._at(nothing), clusters.z, atol=1e-9)
    step = 1e-4 * clusters._without(0)
    change = clusters.A @ step
    assert rms(clusters._at(step) - clusters.z - change) < 0.2 * rms(change)


def test_a_step_that_slopes_promise_ends_at_the_bounds_and_where_the_other_runs_want_it(clusters: Clusters) -> None:
    t, m = 2, len(clusters.evidence.free)
    rows = clusters.pieces == t
    linear = clusters.z[rows] + clusters.A[rows] @ far(clusters, t)
    assert rms(linear) > 20.0 * rms(clusters.z)  # what an extrapolation says
    step = clusters._without(t)
    for (name, p), by in zip(clusters.slots, step[m:], strict=True):
        assert p.lower - 1e-12 <= clusters.fit.spec[name][p.name] + by <= p.upper + 1e-12
    x = clusters.fit.x + step[:m]
    assert np.all((clusters.fit.low <= x) & (x <= clusters.fit.high))
    held = clusters.held_out()[rows]
    assert rms(held) < 2.0 * rms(clusters.z)
    reachable = [clusters.z, *(clusters._at(much * step) for much in (1.0, 0.35, 0.1))]
    assert any(np.array_equal(held, z[rows]) for z in reachable)


def test_the_run_that_is_left_out_has_no_say_in_the_values(clusters: Clusters) -> None:
    t = 1
    rows, step = clusters.pieces == t, clusters._without(t)
    before = clusters._exact(t, step)
    clusters.z = np.where(rows, 1e3, clusters.z)
    clusters.H[t] *= 1e3
    clusters.g[t] += 1e6
    np.testing.assert_allclose(clusters._without(t), step, rtol=1e-6)
    after = clusters._exact(t, step)
    np.testing.assert_array_equal(after[~rows], before[~rows])


def test_where_a_run_hardly_moves_the_fit_nothing_is_computed_anew(
    clusters: Clusters, monkeypatch: pytest.MonkeyPatch
) -> None:
    clusters.z = clusters.z + 10.0  # beside that, what leaving a run out changes is nothing
    monkeypatch.setattr(Clusters, "_at", lambda *_: pytest.fail("computed anew"))
    assert rms(clusters.held_out()) > 5.0
