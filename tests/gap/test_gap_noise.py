"""Fits compared in units of the noise that each leaves, and intervals of few trajectories."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.bench import BenchParameters, simulate, sine, step
from pamid.gap import diagnose
from pamid.gap.diagnosis.closure import Clusters, _rescaled
from pamid.gap.diagnosis.localise import regions
from pamid.gap.inference.competition import Competition
from pamid.gap.inference.gauss_newton import Fitter
from pamid.gap.residuals.bench import Evidence

NOMINAL = BenchParameters.for_muscle("B").replace(
    tolerance={"rest_diameter": 0.005, "sonic_conductance": 0.02, "inertia": 0.02, "viscous_damping": 0.1}
)
RUNS = [sine(2, 15, 2500), sine(6, 10, 2500), step(0, 15, 2500)]


@pytest.fixture(scope="module")
def evidence() -> Evidence:
    return Evidence(simulate(NOMINAL, RUNS, seed=1), NOMINAL)


def spread(evidence: Evidence, name: str, **values: float) -> dict[str, float]:
    found = evidence.spread({name: values} if values else {}, np.zeros(len(evidence.free)))
    return {e: float(np.median(found[p])) for e, p in zip(evidence.equations, evidence.parts, strict=True)}


def test_noise_goes_with_what_a_fit_undoes(evidence: Evidence) -> None:
    assert spread(evidence, "nothing") == dict.fromkeys(evidence.equations, 1.0)
    gain = spread(evidence, "force_gain", deviation=0.1)
    assert 1 / 1.1 <= gain["joint"] < 0.97  # whose noise is mostly that of the forces
    assert 1 / 1.1 <= gain["force"] < 0.99
    assert gain["flow"] == gain["valve"] == 1.0
    # Twice the volume, by a hose or by the muscle, has twice the noise of a pressure that is differentiated.
    V = float(np.mean(NOMINAL.plant().volume(0.12)))
    assert spread(evidence, "dead_volume", volume=V)["flow"] == pytest.approx(2.0, rel=0.15)
    assert spread(evidence, "gas_temperature", difference=30.0, supplied=0.0)["flow"] < 0.95
    assert spread(evidence, "pressure_lag", time_constant=0.005)["force"] == 1.0  # `widening` says it


def test_parameters_count_as_effects_do(evidence: Evidence) -> None:
    k = evidence.free.index("rest_diameter")
    x = np.zeros(len(evidence.free))
    x[k] = 1.0
    by_tolerance = evidence.spread({}, x)
    by_effect = evidence.spread({"diameter": {"deviation": 0.005}}, np.zeros(len(x)))
    np.testing.assert_allclose(by_tolerance, by_effect, rtol=1e-9)


@pytest.mark.parametrize(
    ("name", "values"),
    [("force_gain", {"deviation": -0.01}), ("gas_temperature", {"difference": 3.0, "supplied": 0.0})],
)
def test_a_quieter_account_is_no_better_account(name: str, values: dict[str, float]) -> None:
    """A gain of the force, with a larger muscle, says what warm gas says; only noise can tell which is quieter."""
    loose = NOMINAL.replace(tolerance={**NOMINAL.tolerance, "rest_diameter": 0.02})
    log = simulate(loose.replace(effects=[(name, values)]), RUNS, seed=2)
    evidence = Evidence(log, loose)
    competition = Competition(evidence, ["force_gain", "gas_temperature"])
    outcome = competition.run()
    alone = [h for h in outcome.refitted if len(h.names) == 1]
    gain = {next(iter(h.names)): h.score - outcome.base.score for h in alone}
    other = "gas_temperature" if name == "force_gain" else "force_gain"
    assert gain[name] > 50.0
    assert gain[name] > gain.get(other, 0.0) - 2.0


def test_inside_the_tolerances_is_likelier(evidence: Evidence) -> None:
    competition = Competition(evidence, ["leakage"])
    fit = competition.base.fit
    assert competition.fitter.at({}).loglik == pytest.approx(fit.loglik, abs=0.1)
    assert competition.base.score == pytest.approx(fit.loglik - 1.5 * float(fit.x @ fit.x), abs=1.0)


def test_intervals_of_few_trajectories_are_wider() -> None:
    low, high = _rescaled((0.90, 0.99), 0.96, 4)
    assert low < 0.90 and 0.99 < high < 1.0
    assert np.log(1 - low) - np.log(0.04) == pytest.approx(np.sqrt(4 / 3) * np.log(0.10 / 0.04))
    many = _rescaled((0.90, 0.99), 0.96, 400)
    assert many == pytest.approx((0.90, 0.99), abs=1e-3)
    assert _rescaled((0.0, 1.0), 0.5, 3) == (0.0, 1.0)
    assert _rescaled((0.2, 0.9), 0.5, 1) == (0.2, 0.9)
    below, above = _rescaled((0.97, 1.0), 1.0, 5)
    assert 0.9 < below < 0.97 and above == 1.0


def test_a_parameter_at_its_bound_stays_there_held_out() -> None:
    log = simulate(NOMINAL.replace(effects=[("coulomb_friction", {"amplitude": 4.0})]), RUNS, seed=3)
    fitter = Fitter(Evidence(log, NOMINAL))
    fit = fitter.refine({"coulomb_friction": {"amplitude": 4.0, "per_pressure": 0.0, "presliding": 2e-4}})
    clusters = Clusters(fitter, fit)
    m = len(fitter.evidence.free)
    held = {p.name for moves, (_, p) in zip(clusters.moving[m:], clusters.slots, strict=True) if not moves}
    assert held == {p.name for _, p in clusters.slots if fit.spec["coulomb_friction"][p.name] in (p.lower, p.upper)}
    assert held, "the friction of this bench does not grow with the pressure"
    for k in range(len(fitter.evidence.trajectories)):
        step = clusters._without(k)
        assert not step[~clusters.moving].any()
        np.testing.assert_allclose(clusters._at(0.0 * step), clusters.z, atol=1e-6)
    amplitude = clusters.parameters()["coulomb_friction"]["amplitude"]
    assert amplitude.ci90[0] < 4.0 < amplitude.ci90[1]
    for name in held:  # which may be known well, all the same
        assert np.isfinite(clusters.parameters()["coulomb_friction"][name].ci90).all()


def test_few_windows_are_found_and_named(evidence: Evidence) -> None:
    """After a step the gap may be in a handful of windows, smaller than a leaf that spares no sample would be."""
    part = evidence.parts[evidence.equations.index("joint")]
    power = np.zeros(len(evidence.z0))
    jolts = np.argsort(-np.abs(evidence.state["dP"][part]))[:5]
    power[np.arange(part.start, part.stop)[jolts]] = 1.0
    found = regions(evidence, "joint", power)
    table = pd.DataFrame({evidence.column(n): evidence.state[n][part] for n in ("q", "dq", "P", "dP", "u")})
    named = set().union(*(table.query(r.query).index for r in found))
    assert len(named & set(jolts)) >= 4
    assert len(named) <= 7


def test_regions_go_by_energy_and_not_by_how_well_it_is_known() -> None:
    """Where the flow stops the valve's noise is large; in its units, little would seem to be there."""
    asymmetric = NOMINAL.replace(effects=[("valve_asymmetry", {"asymmetry": 0.05, "split": 0.0})])
    d = diagnose(simulate(asymmetric, RUNS, seed=4), NOMINAL, ["valve_asymmetry", "leakage"])
    w = d.windows[d.windows["equation"] == "valve"]
    energy = np.square(w["before"] - w["after"])
    named = np.zeros(len(w), dtype=bool)
    for region in (r for r in d.regions if r.equation == "valve"):
        for side in (1, 2):
            if f"{side} " in region.query:
                own = w.rename(columns={c: f"{c}{side}" for c in ("eps", "deps", "P", "dP", "u")})
                named |= (own.eval(region.query) & (w["side"] == side)).to_numpy()
    assert energy[named].sum() > 0.7 * energy.sum()
    shares = sum(r.share for r in d.regions if r.equation == "valve")
    assert shares == pytest.approx(energy[named].sum() / energy.sum(), abs=0.05)
