"""Inputs that jump between two rows: what a simulator of whole runs makes of the instants is no cause of a gap."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap.residuals.jumps import NOTE, jumps, off_rows
from pamid.gap.residuals.shooting import ShootingEvidence
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.port_log import port_log

DT, LATE = 0.02, 0.407


def travelling(u, p, x0):
    """Waves in a pipe with a closed end: what a valve sends comes back, in lines from row to row."""
    t, y = u["time"], p.K * u["valve"]
    for k in (1, 2, 3):
        y = y + p.K * (-0.6) ** k * (np.interp(t - k * LATE, t, u["valve"]) - u["valve"][0])
    return [y]


PIPE = FunctionSimulator(
    travelling, [Port("valve", "input", "-"), Port("p", "output", "kPa")], {"K": (100.0, 0.05)}, form="run"
)


def recorded(step, gain=1.0, rows=600):
    """A smooth input with jumps of a size anywhere between rows."""
    rng, runs = np.random.default_rng(2), []
    t = DT * np.arange(rows)
    for run in range(2):
        at = np.sort(rng.uniform(0.5, t[-1], 8))

        def valve(s, at=at, run=run):
            return 0.4 + 0.2 * np.sin((1.1 + run) * s) + step * (np.searchsorted(at, s) % 2)

        y = sum((-0.6) ** k * (valve(np.maximum(t - k * LATE, 0.0)) - valve(0.0) * (k > 0)) for k in range(4))
        y = gain * 100.0 * y + 0.2 * rng.standard_normal(rows)
        runs.append(pd.DataFrame({"trajectory": str(run), "time": t, "valve": valve(t), "p": y}))
    return pd.concat(runs, ignore_index=True)


def evidence(log):
    return ShootingEvidence(port_log(log, PIPE), PIPE, refit=True)


def test_what_unknown_instants_of_jumps_change_is_noise():
    found = evidence(recorded(0.25))
    assert NOTE in found.notes
    assert max(found.without_causes().scales) < 1.1


@pytest.mark.parametrize(("step", "gain"), [(0.0, 1.0), (0.0, 1.2)])
def test_without_jumps_nothing_is_unknown_whatever_the_gap(step, gain):
    found = evidence(recorded(step, gain))
    assert NOTE not in found.notes
    assert (max(found.without_causes().scales) > 2.0) == (gain > 1.0)


def test_jumps_leave_a_gap_what_it_is():
    found = evidence(recorded(0.25, 1.2))
    assert max(found.without_causes().scales) > 2.0
    assert NOTE not in found.notes  # a lag, too, would show after jumps: noise there would hide it


def test_smooth_inputs_have_no_jumps():
    log = port_log(recorded(0.0), PIPE)
    smooth = jumps(log.inputs(PIPE), log)
    assert np.max(np.abs(smooth)) < 1e-3
    stepped = port_log(recorded(0.25), PIPE)
    assert np.sum(np.abs(jumps(stepped.inputs(PIPE), stepped)) > 0.2) == 16


def test_a_log_without_inputs_has_no_jumps_though_its_rows_are_interpolated():
    """A falling ball whose readings are uneven in time, with a gap."""
    rng = np.random.default_rng(4)
    t = np.cumsum(rng.uniform(0.04, 0.09, 60))
    log = pd.DataFrame({"time": t, "h": 40.0 - 4.0 * t**2 + 1e-3 * rng.standard_normal(60)})
    ports = [Port("h", "state", "m"), Port("v", "state", "m/s")]
    ball = FunctionSimulator(lambda t, x, u, p: [x.v, -9.81 + 0.0 * x.v], ports, form="ode")
    found = ShootingEvidence(port_log(log, ball), ball)
    assert found.log.between and off_rows(ball.inputs, found.log).shape == (0, found.log.n)
    assert NOTE not in found.notes
