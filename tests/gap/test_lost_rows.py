"""Logs that lack rows, or whose rows are unevenly spaced: what interpolation makes of noise and of jumping inputs."""

import numpy as np
import pandas as pd
import pytest

import pamid
from pamid.gap.residuals.jumps import NOTE
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, FunctionSimulator, Port
from pamid.simulators.interpolated import Interpolated

PORTS = [Port("heat", "input", "W"), Port("T", "state", "K")]
NUMBERS = {"k": (2.0, 0.05, "W/K"), "C": (60.0, 0.05, "J/K")}
OVEN = EquationSimulator({"dT/dt": "(heat - k*(T - 290))/C"}, PORTS, NUMBERS)


def oven_log(seed, lost=0.2, uneven=0.0, noise=0.06, k=2.0):
    """Return two runs of an oven that is heated in steps, whose rows are lost or unevenly spaced."""
    rng, runs = np.random.default_rng(seed), []
    for run in range(2):
        levels, T, rows, part = rng.choice([20.0, 60.0, 110.0], 40), 305.0, [], 50
        times = np.arange(1200) + uneven * rng.uniform(-0.5, 0.5, 1200)
        times -= times[0]
        fine = np.arange(0.0, times[-1] + 0.1, 1.0 / part)
        for t in fine:
            rows.append(T)
            T += (levels[int(t // 30.0)] - k * (T - 290.0)) / 60.0 / part
        read = np.interp(times, fine, rows) + noise * rng.standard_normal(len(times))
        table = {"trajectory": str(run), "time": times, "heat": levels[(times // 30.0).astype(int)], "T": read}
        keep = rng.random(len(times)) >= lost
        keep[0] = True
        runs.append(pd.DataFrame(table)[keep])
    return pd.concat(runs, ignore_index=True)


@pytest.mark.parametrize(("lost", "uneven"), [(0.0, 0.0), (0.2, 0.0), (0.0, 0.8)])
def test_the_noise_of_readings_is_known_though_rows_were_interpolated(lost, uneven):
    evidence = evidence_of(oven_log(1, lost, uneven), OVEN)
    assert evidence.channel_noise("T") == pytest.approx(0.06, rel=0.1)
    assert float(np.median(np.abs(evidence.z0))) / 0.6745 < 1.1


@pytest.mark.parametrize(("lost", "uneven"), [(0.2, 0.0), (0.0, 0.8)])
def test_inputs_that_jump_between_rows_are_no_gap(lost, uneven):
    found = pamid.diagnose(oven_log(2, lost, uneven, noise=0.01), OVEN)
    assert found.verdict == "none"
    assert NOTE in found.notes


def test_a_cause_is_named_though_rows_are_lost():
    some = ["parameter_deviation", "actuator_gain", "sensor_gain"]
    found = pamid.diagnose(oven_log(3, k=2.6, noise=0.01), OVEN, some)
    [cause] = found.causes
    assert (cause.effects[0], cause.where[0]) == ("parameter_deviation", "k")


def whole(u, p, x0):
    """The oven as a simulator of whole runs."""
    T, out = x0["T0"], []
    for heat in u["heat"]:
        out.append(T)
        for _ in range(5):
            T += 0.2 * (heat - p["k"] * (T - 290.0)) / p["C"]
    return {"T": np.array(out)}


WHOLE = FunctionSimulator(
    whole, [PORTS[0], Port("T", "output", "K"), Port("T0", "state", "K", start=305.0)], NUMBERS, form="run"
)


def test_a_simulator_of_runs_knows_the_instants_where_no_row_is_lost():
    log = pd.concat([oven_log(4, lost=0.0, noise=0.01), oven_log(5, noise=0.01).replace({"0": "2", "1": "3"})])
    evidence = evidence_of(log, WHOLE)
    assert NOTE in evidence.notes
    part = evidence.parts[0]
    known, open_ = (np.median(evidence.noise[part][evidence.run[part] == run]) for run in (0, 2))
    assert known < 1.2 * 0.01 and open_ >= known


def test_a_gap_does_not_hide_that_inputs_jump_between_rows():
    known, gap = (evidence_of(log, WHOLE) for log in (oven_log(6, noise=0.01), oven_log(6, noise=0.01, k=3.5)))
    assert NOTE in known.notes and NOTE in gap.notes
    assert np.all(gap.noise > 0.9 * known.noise)


def test_rows_lie_between_the_readings_of_their_run():
    one = Interpolated.of(np.array([0.0, 1.0, 3.0, 4.0, 5.0]), np.array([0.0, 0.0, 2.0, 2.0, 2.0]), np.arange(6.0))
    assert one.before.tolist() == [0, 0, 1, 1, 2, 3] and one.share.tolist() == [0.0, 1.0, 0.5, 1.0, 1.0, 1.0]
    assert one.jump.tolist() == [0.0, 0.0, 1.0, 0.0, 0.0, 0.0] and one.interpolated
    both = Interpolated.joined([one, one])
    assert both.before.tolist() == [0, 0, 1, 1, 2, 3, 5, 5, 6, 6, 7, 8]
    assert len(both.noise(np.random.RandomState(0))) == 12 and both.at(np.array([2, 8])).jump.tolist() == [1.0, 1.0]
