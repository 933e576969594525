"""What a log rounds off a command acts on the system, and lasts as long as the command is held; a grid's values do not.

The stage is driven by pulses of any height, which the log has with two decimals, and by pulses of just these heights.
"""

import numpy as np
import pandas as pd
import pytest

from pamid import diagnose
from pamid.gap.residuals.measured_inputs import rounded_off, roundings
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, ModelParameter, Port

STAGE = EquationSimulator(
    {"dx/dt": "v", "dv/dt": "4*u - c*v"},
    [Port("u", "input", "V"), Port("x", "state", "m"), Port("v", "state", "m/s")],
    {"c": ModelParameter(6.0, 0.2, "1/s")},
)
DT, STEP = 2e-3, 0.01


def pulsed(exact, friction=0.0, rows=1500):
    """Return a log of a stage whose command is rounded before it acts, or only in the log."""
    rng, runs = np.random.default_rng(5), []
    for run in range(3):
        u, k = np.zeros(rows), 50
        for sign in np.resize([1.0, -1.0], 100):
            width = rng.integers(30, 75)
            u[k : k + width] = sign * rng.uniform(0.6, 3.0)
            k += width + rng.integers(25, 100)
        u[-100:] = 0.0
        read = STEP * np.round(u / STEP)
        v, path, speeds = 0.0, [0.0], [0.0]
        for now in np.repeat(read if exact else u, 10)[:-10]:
            v += DT / 10 * (4.0 * now - 6.0 * v - friction * np.tanh(v / 1e-3))
            path.append(path[-1] + DT / 10 * v)
            speeds.append(v)
        x = np.array(path[::10]) + 1e-6 * rng.standard_normal(rows)
        w = np.array(speeds[::10]) + 2e-3 * rng.standard_normal(rows)
        runs.append(pd.DataFrame({"trajectory": str(run), "time": DT * np.arange(rows), "u": read, "x": x, "v": w}))
    return pd.concat(runs, ignore_index=True)


def test_a_command_rounded_in_the_log_alone_is_no_gap():
    found = diagnose(pulsed(exact=False), STAGE)
    assert found.verdict == "none", str(found)
    assert [note for note in found.notes if "rounds off u" in note]
    assert len(set(found.notes)) == len(found.notes)


def test_a_small_cause_is_named_beside_a_command_that_is_exact():
    found = diagnose(pulsed(exact=True, friction=0.03), STAGE)
    assert [c.effects[0] for c in found.added] == ["coulomb_friction"], str(found)
    assert not any("rounds off" in note for note in found.notes)


def test_a_command_on_a_grid_is_exact():
    evidence = evidence_of(pulsed(exact=True), STAGE, refit=True)
    assert not evidence.hear_inputs(evidence.without_causes())


def test_rounding_is_that_of_a_fine_grid_and_beyond_the_noise():
    rng = np.random.default_rng(0)
    any_height = np.repeat(rng.uniform(-1.0, 1.0, 40), 50)
    u = np.array([any_height, np.round(any_height, 2), np.round(any_height)])
    assert roundings(u, np.zeros(3)) == pytest.approx([0.0, 0.01, 0.0])
    assert not roundings(u, np.full(3, 0.02)).any()


def test_what_is_rounded_off_lasts_as_long_as_a_value_is_held_and_zero_is_exact():
    u = np.array([[0.0, 0.0, 1.2, 1.2, 1.2, 0.0, 0.7, 0.7], np.zeros(8)])
    off, none = rounded_off(u, np.array([0.1, 0.0]), np.array([0, 4]), np.random.RandomState(0))
    assert off[2] == off[3] != off[4] and off[6] == off[7] != 0.0
    assert not off[u[0] == 0.0].any() and not none.any() and np.all(np.abs(off) <= 0.05)
