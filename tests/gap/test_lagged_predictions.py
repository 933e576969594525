"""What a sensor with memory reads of runs that are predicted: from where it begins, and of their initial states."""

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

from pamid.gap.inference.first_order import FirstOrder
from pamid.gap.inference.gauss_newton import Fitter
from pamid.gap.residuals.between_rows import PIECES, curved
from pamid.gap.residuals.jumps import NOTE
from pamid.gap.residuals.shooting import ShootingEvidence
from pamid.simulators import EquationSimulator, Port
from pamid.simulators.port_log import port_log

CHAIN = EquationSimulator(
    {"dx/dt": "(u - x)/0.3", "dy/dt": "(x - y)/0.4"},
    [Port("u", "input", "V"), Port("x", "state", "V"), Port("y", "state", "V", column="y")],
    {},
)
LAG, DT, NOISE = 0.6, 0.05, 1e-3


def lagged(lengths=(400, 523, 467)):
    """Runs of different lengths in which one of two states is read, late."""
    rng, runs, parts = np.random.default_rng(5), [], 100
    for run, rows in enumerate(lengths):
        u = np.repeat(rng.uniform(-1.0, 1.0, rows // 40 + 1), 40)[:rows]
        x, y, read, kept = rng.uniform(-3.0, 3.0), rng.uniform(-3.0, 3.0), None, []
        for drive in u:
            read = y if read is None else read
            kept.append(read)
            for _ in range(parts):
                h = DT / parts
                x, y, read = x + h * (drive - x) / 0.3, y + h * (x - y) / 0.4, read + h * (y - read) / LAG
        noisy = np.array(kept) + NOISE * rng.standard_normal(rows)
        runs.append(pd.DataFrame({"trajectory": str(run), "time": DT * np.arange(rows), "u": u, "y": noisy}))
    return pd.concat(runs, ignore_index=True)


@pytest.fixture(scope="module")
def evidence():
    return ShootingEvidence(port_log(lagged(), CHAIN), CHAIN)


def late(evidence, seconds):
    """Return a lag of the reading, in the pace of the evidence."""
    return {"sensor_lag@y": {"time_constant": seconds * evidence.placements["sensor_lag@y"].scales.time, "second": 0.0}}


def test_a_lag_begins_with_each_run(evidence):
    active = evidence.active(late(evidence, LAG))
    x0 = evidence._x0 + 1.0
    read = evidence._predict(x0, active, evidence.simulator.numbers)
    begins = np.isin(evidence._firsts, evidence.log.starts)
    assert read[0, evidence._firsts[begins]] == pytest.approx(x0[1, begins])


def test_a_lag_goes_on_from_stretch_to_stretch(evidence):
    active = evidence.active(late(evidence, LAG))
    assert len(evidence.stretches) > 3
    x0 = evidence._x0.copy()
    x0[1] += np.where(np.isin(evidence._firsts, evidence.log.starts), 0.0, 1.0)
    read, true = (evidence._predict(x0, some, evidence.simulator.numbers)[0] for some in (active, []))
    within = [f for f in evidence._firsts if f not in evidence.log.starts]
    jumps, steps = (np.array([abs(x[f] - x[f - 1]) for f in within]) for x in (read, true))
    assert np.all(steps > 0.5) and np.all(jumps < 0.3 * steps)  # V


def test_initial_states_act_on_a_late_reading_as_it_shows_them(evidence):
    fit = Fitter(evidence).refine(late(evidence, 0.5 * LAG))
    [[size, *_], [expected, *_]] = [list(spec["sensor_lag@y"].values()) for spec in (fit.spec, late(evidence, LAG))]
    assert size == pytest.approx(expected, rel=0.03)
    assert fit.scales < 1.2
    begun = [np.flatnonzero(evidence.run == k)[:5] for k in range(3)]
    left = evidence.raw(fit.z)[np.concatenate(begun)]
    assert np.max(np.abs(left)) < 4.0


def test_a_late_sensor_holds_what_jumps_between_uneven_rows_change():
    """What an instant that nobody knows changes lasts as long as the lag, and is no gap."""
    rng, runs, parts = np.random.default_rng(1), [], 100
    h = DT / parts
    for run, rows in enumerate((900, 1100)):
        stamps = (parts * (np.arange(rows) + rng.uniform(-0.3, 0.3, rows))).astype(int)
        fine = np.arange(stamps[-1] - stamps[0] + 1)
        at = np.sort(rng.integers(0, fine[-1], rows // 25))
        u = rng.uniform(-3.0, 3.0, len(at) + 1)[np.searchsorted(at, fine, side="right")]
        read = u
        for time in (0.3, 0.4, LAG):
            read = lfilter([h / time], [1.0, h / time - 1.0], read)
        stamps -= stamps[0]
        noisy = read[stamps] + NOISE * rng.standard_normal(rows)
        runs.append(pd.DataFrame({"trajectory": str(run), "time": h * stamps, "u": u[stamps], "y": noisy}))
    evidence = ShootingEvidence(port_log(pd.concat(runs, ignore_index=True), CHAIN), CHAIN)
    assert NOTE in evidence.notes and len(evidence.stretches) == 2
    assert evidence.widening({}) is None
    found = FirstOrder(evidence, []).hypothesis(Fitter(evidence).refine(late(evidence, LAG)))
    assert np.max(found.left) < 1.2  # twice that if the noise is taken to last no longer than without the lag


def test_a_signal_with_corners_is_curved_between_its_rows():
    dt, starts = 0.1, np.array([0, 37])
    fine = np.arange(60 * PIECES) * dt / PIECES
    found = curved(corners(fine[::PIECES]), starts)
    within = np.arange(60 * PIECES) // PIECES
    kept = ~np.isin(within, [36, 59])
    error = np.abs(found - corners(fine))[kept]
    straight = np.abs(np.interp(fine, fine[::PIECES], corners(fine[::PIECES])) - corners(fine))[kept]
    assert np.max(error) < 0.3 * np.max(straight)
    assert np.all(found[within == 36] == corners(3.6))  # the last row of a run is held


def corners(t):
    """A motion that turns every second."""
    return np.abs(np.sin(np.pi * np.asarray(t)))
