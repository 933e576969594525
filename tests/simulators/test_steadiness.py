"""Simulators that are random or keep something between calls are told; those that do not are not."""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd
import pytest

from pamid.errors import SimulatorWarning
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port

PORTS = [Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]
OUTWARD = [Port("F", "input", "N"), Port("y", "output", "m")]


def log() -> pd.DataFrame:
    t, rng = np.arange(0, 3, 0.01), np.random.default_rng(0)
    F = 6 * np.sin(3 * t)
    v = np.cumsum(F) * 0.01 / 2.0 + 1e-3 * rng.standard_normal(len(t))
    x = np.cumsum(v) * 0.01 + 1e-5 * rng.standard_normal(len(t))
    return pd.DataFrame({"trajectory": "a", "time": t, "F": F, "x": x, "v": v, "y": x})


def cart(kept: list, more):
    return FunctionSimulator(lambda t, x, u, p: [x.v, u.F / p.m + more(kept, u)], PORTS, {"m": 2.0})


def noisy(kept, u):
    return 1e-3 * kept[0].standard_normal()


def counting(kept, u):
    kept.append(0)
    return 1e-4 * len(kept)


def lagging(kept, u):
    kept[0], before = u.F, kept[0]
    return 0.01 * np.mean(before)


@pytest.mark.parametrize(
    ("kept", "more"), [([np.random.default_rng(1)], noisy), ([], counting), ([0.0], lagging)],
    ids=["random", "counting", "last input"],
)  # fmt: skip
def test_a_simulator_that_answers_differently_is_told(kept, more):
    sim = cart(kept, more)
    with pytest.warns(SimulatorWarning, match="different values of v"):
        evidence_of(log(), sim)
    with warnings.catch_warnings():
        warnings.simplefilter("error", SimulatorWarning)
        evidence_of(log(), sim)  # once is enough


def test_a_whole_run_that_goes_on_from_the_last_one_is_told():
    kept = [0.0]

    def run(u, p, x0):
        y = kept[0] + 0.01 * np.cumsum(u["F"])
        kept[0] = float(y[-1])
        return [y]

    with pytest.warns(SimulatorWarning, match="different values of y"):
        evidence_of(log(), FunctionSimulator(run, OUTWARD, form="run"))


def test_a_simulator_that_keeps_nothing_is_not_told():
    with warnings.catch_warnings():
        warnings.simplefilter("error", SimulatorWarning)
        evidence_of(log(), cart([], lambda kept, u: 0.0))
