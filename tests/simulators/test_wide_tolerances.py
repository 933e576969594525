"""Numbers that are hardly known: constants fitted without an effect have taken it on, and are fitted anew with it."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.gap.inference.discrepancy import Discrepancy
from pamid.gap.inference.gauss_newton import FINEST, Fitter
from pamid.gap.settings import TOLERANCE
from pamid.gap.simulated import evidence_of
from pamid.signals.ends import end_of
from pamid.simulators import FunctionSimulator, Port

NOISE = 0.01
TRUE = {"k1": 0.07, "k2": 0.04, "k3": 0.055, "k4": 0.05}


def tanks() -> FunctionSimulator:
    """Two tanks by Bernoulli's law, constants known to within 80 %, the upper level not logged."""

    def rates(t, x, u, p):
        one, two = np.sqrt(np.maximum(x.h1, 0.0)), np.sqrt(np.maximum(x.h2, 0.0))
        return [p.k4 * u.u - p.k1 * one, p.k2 * one - p.k3 * two]

    ports = [Port("u", "input", "V"), Port("h1", "state", "V", start=4.0), Port("h2", "state", "V", column="y")]
    return FunctionSimulator(rates, ports, {k: (0.05, 0.8) for k in TRUE})


def log(end: float = np.inf, steps: int = 20) -> pd.DataFrame:
    """Two runs of tanks whose upper one runs over at 7 V, half of it into the lower one, whose sensor may end."""
    rng, runs = np.random.default_rng(5), []
    for k in range(2):
        u = np.repeat(rng.uniform(0.6, 5.2, steps), 20)
        h1, h2, y = 4.0, 3.0 + k, []
        for v in u:
            y.append(h2)
            for _ in range(8):
                over = 0.2 * max(h1 - 7.0, 0.0)
                one, two = np.sqrt(max(h1, 0.0)), np.sqrt(max(h2, 0.0))
                h1 += 0.5 * (TRUE["k4"] * v - TRUE["k1"] * one - over)
                h2 += 0.5 * (TRUE["k2"] * one - TRUE["k3"] * two + 0.5 * over)
        read = np.minimum(np.array(y) + NOISE * rng.standard_normal(len(y)), end)
        runs.append(pd.DataFrame({"trajectory": str(k), "time": 4.0 * np.arange(len(u)), "u": u, "y": read}))
    return pd.concat(runs, ignore_index=True)


def test_an_overflow_that_constants_had_taken_on_is_found_with_them() -> None:
    found = diagnose_simulator(log(steps=10), tanks(), ["overflow", "leakage", "sensor_gain"])
    assert (found.verdict, found.causes[0].effects, found.causes[0].where) == ("cause", ("overflow",), ("h1",))
    [closure] = found.closure
    assert closure.rmse_after < 1.1 * NOISE < 0.2 * closure.rmse_before
    assert found.corrected is not None
    # How large the upper level is, no reading tells; the lower one's outlet is what it is.
    assert found.corrected.parameters["k3"].value == pytest.approx(TRUE["k3"], rel=0.05)


def test_an_overflow_beside_a_sensor_that_is_not_straight_is_what_comes_closest() -> None:
    # What is left lasts long, so that few windows count; the overflow does not quite halve the error, as a name has to.
    one = log().query("trajectory == '0'")
    bent = one.assign(y=one["y"] + 0.25 * np.sin(1.5 * one["y"]))
    found = diagnose_simulator(bent, tanks(), ["overflow"])
    assert found.verdict == "unknown" and "resembles overflow at h1" in str(found).splitlines()[0]
    [closure] = found.closure
    assert closure.closed_share > 0.5


def test_slopes_are_those_under_the_effects_that_stand() -> None:
    evidence = evidence_of(log(), tanks(), refit=True)
    assert evidence.curved
    place = evidence.placements["overflow@h1"]
    spec = {"overflow@h1": place.inward({"coefficient": 0.1, "level": 6.0, "returned": 0.5})}
    x = np.full(len(evidence.free), 0.05)
    found, step = evidence.slopes(spec, x), 0.01
    for k, name in enumerate(evidence.free[1:3], start=1):
        moved = dict(zip(evidence.free, x, strict=True))
        for _ in range(3):  # initial states are fitted anew with each
            evidence._kept.clear()
            here = evidence.z(spec, moved)
        for _ in range(3):
            evidence._kept.clear()
            there = evidence.z(spec, {**moved, name: moved[name] + step})
        change = (there - here) / step
        assert np.linalg.norm(change - found[:, k]) < 0.15 * np.linalg.norm(change)


def test_what_an_overflow_changes_is_what_the_tanks_do_without_it() -> None:
    evidence = evidence_of(log(steps=10), tanks(), refit=True)
    place = evidence.placements["overflow@h1"]
    # So fast that the level hardly rises further: about such a run, a little less of it changes next to nothing.
    spec = {"overflow@h1": place.inward({"coefficient": 0.25, "level": 6.0, "returned": 0.5})}
    fit = Fitter(evidence).at(spec)
    first_order = -evidence.change({}, spec, fit.x)
    changed = Discrepancy(evidence).whole(fit)["overflow@h1"]
    without = evidence.z({}, dict(zip(evidence.free, map(float, fit.x), strict=True)))
    np.testing.assert_allclose(changed, fit.z - without, atol=1e-6 * np.max(np.abs(without)))
    assert np.linalg.norm(first_order) < 0.2 * np.linalg.norm(changed)


def test_the_fit_that_is_told_ends_where_another_one_gains_nothing() -> None:
    evidence = evidence_of(log(steps=10), tanks(), refit=True)
    fitter, place = Fitter(evidence), evidence.placements["overflow@h1"]
    rough = fitter.refine({"overflow@h1": place.inward({"coefficient": 0.1, "level": 9.0, "returned": 0.1})})
    told = fitter.told(rough)
    worth = [fit.loglik - 0.5 * TOLERANCE * float(np.sum(np.square(fit.x + evidence.about)))
             for fit in (rough, told, fitter.told(told))]  # fmt: skip
    assert worth[0] <= worth[1]
    assert worth[2] == pytest.approx(worth[1], abs=2.0 * FINEST)


def test_readings_at_their_end_speak_for_it() -> None:
    limit = 0.9 * float(log()["y"].max())
    cut = log(end=limit)
    end = end_of(cut["y"].to_numpy(), [(0, 400), (400, 800)])
    assert end is not None
    assert end.limit == limit
    assert end_of(log()["y"].to_numpy(), [(0, 400), (400, 800)]) is None
    rounded = np.round(cut["y"].to_numpy(), 1)  # where readings repeat each other anyway, repeats say nothing
    assert end_of(rounded, [(0, 400), (400, 800)]) is None
    ended, free = (evidence_of(some, tanks()) for some in (cut, log()))
    assert ended.prior("sensor_saturation@h2") > 10.0
    assert free.prior("sensor_saturation@h2") == 0.0
    [limit] = ended.placements["sensor_saturation@h2"].effect.parameters
    assert limit.lower > 0.99 * limit.upper
