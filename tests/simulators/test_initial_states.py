"""Initial states fitted to a changed simulator, and what inputs do between rows where motion is fast."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from pamid.gap import diagnose_simulator
from pamid.gap.inference.gauss_newton import Fitter
from pamid.gap.residuals.shooting import ShootingEvidence
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.port_log import port_log
from pamid.simulators.structure import full_turns

FINE = 40


WHIRL, HOLD = 0.02, 50
"""Time between two readings of the pendulum, s, and readings over which its torque is constant."""


def rates(t, x, u, p):
    """Return the rates of a mass on a stiff spring."""
    return [x.v, (u.F - p.d * x.v - p.k * x.x) / p.m]


def spring(stiffness: float, damping: float) -> FunctionSimulator:
    """Return the simulator of a mass whose position is read."""
    ports = [
        Port("F", "input", "N"), Port("x", "state", "m", column="position"),
        Port("v", "state", "m/s", column="not logged"),
    ]  # fmt: skip
    return FunctionSimulator(rates, ports, {"m": (1.0, 0.05), "d": (damping, 0.1), "k": (stiffness, 0.1)})


def spring_log(stiffness: float, damping: float, hold: int, lines: bool, rows: int) -> pd.DataFrame:
    """Return runs from states that nobody reads, under forces that are held or go straight from row to row."""
    rng, runs, dt = np.random.default_rng(1), [], 0.01
    for run in range(3):
        x, v, read = rng.normal(0.0, 0.05), rng.normal(0.0, 1.0), []
        force = np.repeat(rng.normal(0.0, 0.01 * stiffness, rows // hold + 1), hold)[: rows + 1]
        for now, then in pairwise(force):
            read.append(x)
            for j in range(FINE):
                f = now + (j + 0.5) / FINE * (then - now) * lines
                v += dt / FINE * (f - damping * v - stiffness * x)
                x += dt / FINE * v
        position = np.array(read) + 1e-4 * rng.standard_normal(rows)
        time = dt * np.arange(rows)
        runs.append(pd.DataFrame({"trajectory": str(run), "time": time, "F": force[:rows], "position": position}))
    return pd.concat(runs, ignore_index=True)


WHIRLING = [
    Port("T", "input", "rad/s2"), Port("q", "state", "rad", column="angle"),
    Port("v", "state", "rad/s", column="not logged"),
]  # fmt: skip


def swing(t, x, u, p):
    """Return the rates of a pendulum."""
    return [x.v, u.T - p.d * x.v - p.g * np.sin(x.q)]


def whirling(share: float) -> pd.DataFrame:
    """Return the angle of a pendulum that is driven over the top again and again; its weight differs by a share."""
    rng, state, read = np.random.default_rng(2), np.array([0.5, 14.0]), []
    torque = np.repeat(rng.uniform(-2.0, 6.0, 8), HOLD)
    for drive in torque[::HOLD]:

        def turned(t: float, x: np.ndarray, drive: float = drive) -> list[float]:
            return [x[1], drive - 0.05 * x[1] - 40.0 * share * np.sin(x[0])]

        at = WHIRL * np.arange(HOLD + 1)
        found = solve_ivp(turned, (0.0, at[-1]), state, t_eval=at, rtol=1e-9, atol=1e-9).y
        read.extend(found[0, :-1])
        state = found[:, -1]
    angles = np.array(read) + 0.01 * rng.standard_normal(len(read))
    return pd.DataFrame({"trajectory": "0", "time": WHIRL * np.arange(len(read)), "T": torque, "angle": angles})


def test_with_its_true_parameters_a_simulator_explains_a_log_to_the_noise() -> None:
    """Initial states that fit the given spring would let the true one ring with another phase."""
    log, simulator = spring_log(412.0, 0.1, hold=50, lines=False, rows=700), spring(400.0, 0.1)
    evidence = ShootingEvidence(port_log(log, simulator), simulator)
    true = evidence.raw(evidence.z({}, {"k": 0.3}))
    assert np.sqrt(np.mean(np.square(evidence.z0))) > 15.0
    assert np.sqrt(np.mean(np.square(true))) < 1.5


@pytest.mark.parametrize(("lines", "stiffness"), [(False, 1000.0), (True, 4000.0)], ids=["held", "lines"])
def test_held_inputs_and_lines_are_within_reach_of_each_other(lines: bool, stiffness: float) -> None:
    """Which of them a log has may be told wrong, but is no cause: jumps of the force come every third row."""
    log, simulator = spring_log(stiffness, 12.0, hold=3, lines=lines, rows=500), spring(stiffness, 12.0)
    evidence = ShootingEvidence(port_log(log, simulator), simulator, refit=True, lines=not lines)
    fit = Fitter(evidence).base()
    assert np.all(fit.scales < 1.05)
    assert abs((evidence.about + fit.x)[evidence.free.index("bend of F")]) < 0.8


def test_how_inputs_go_from_row_to_row_is_asked_once_parameters_fit() -> None:
    """A stiffness that is 3 % wrong moves a ringing mass by more than lines do, and hides them until it is fitted."""
    log, simulator = spring_log(4120.0, 4.0, hold=25, lines=True, rows=300), spring(4000.0, 4.0)
    evidence = evidence_of(log, simulator, refit=True, simulated=True)
    assert evidence.lines
    assert np.all(Fitter(evidence).base().scales < 1.05)


def test_a_pendulum_that_whirls_is_lost_long_before_half_of_its_turns() -> None:
    """Over its turns the angle spreads by far more than the simulator may miss, which is a part of one turn."""
    log, pendulum = whirling(1.05), FunctionSimulator(swing, WHIRLING, {"g": (40.0, 0.1), "d": (0.05, 0.1)})
    found = diagnose_simulator(log, pendulum, ["viscous_friction", "coulomb_friction", "sensor_gain"], seed=0)
    assert found.verdict == "none", str(found)
    assert found.deviations["g"] == pytest.approx(0.5, abs=0.05)


def test_only_angles_that_come_round_have_turns() -> None:
    """A motor's angle changes nothing, and half a turn of a pendulum turns its weight around."""
    motor = FunctionSimulator(lambda t, x, u, p: [x.v, u.T], WHIRLING, {})
    pendulum = FunctionSimulator(swing, WHIRLING, {"g": 40.0, "d": 0.05})
    at = np.zeros(3), np.array([[0.1, 0.5, 2.0], [0.0, 1.0, 2.0]]), np.ones((1, 3))
    assert full_turns(motor, *at) == {}
    assert full_turns(pendulum, *at) == {"q": pytest.approx(2.0 * np.pi)}


def test_a_run_that_is_begun_wrongly_is_fitted_over_growing_parts() -> None:
    """From a pendulum's wrong swing over the top, the whole run leads to none of the right ones."""
    ports = [Port("T", "input", "rad/s2"), Port("q", "state", "rad"), Port("w", "state", "rad/s")]
    pendulum = FunctionSimulator(lambda t, x, u, p: [x.w, u.T - 9.81 * np.sin(x.q) - 0.2 * x.w], ports, {})
    rng, runs, t = np.random.default_rng(4), [], 0.01 * np.arange(600)
    for k in range(3):

        def swing(s: float, x: np.ndarray, k: int = k) -> list[float]:
            return [x[1], 6.0 * np.sin(1.3 * s + k) - 9.81 * np.sin(x[0]) - 0.2 * x[1]]

        q = solve_ivp(swing, (0.0, 6.0), [0.4 * k, 0.5], t_eval=t, rtol=1e-8).y[0] + 0.02 * rng.standard_normal(600)
        runs.append(pd.DataFrame({"trajectory": str(k), "time": t, "T": 6.0 * np.sin(1.3 * t + k), "q": q}))
    found = ShootingEvidence(port_log(pd.concat(runs, ignore_index=True), pendulum), pendulum)
    wrong = found._x0.copy()
    wrong[:, -1] += 0.3, 3.0
    nearby, error = found._fitted_from(wrong)
    assert np.sqrt(np.mean(np.square(error[:, found.stretches[-1].first :]))) > 4.0
    again = found._error(found._unless_apart(nearby, error))
    assert all(np.sqrt(np.mean(np.square(again[:, s.first : s.stop]))) < 1.5 for s in found.stretches)


def test_stretches_that_are_followed_are_taken_even_where_they_are_little_better(monkeypatch):
    simulator = spring(400.0, 2.0)
    log = port_log(spring_log(400.0, 2.0, 20, False, 160), simulator)
    missed = {160: 0.69, 80: 0.67, 40: 0.499}

    def misses(evidence, error):
        return missed.get(max(s.stop - s.first for s in evidence.stretches), 0.4)

    monkeypatch.setattr(ShootingEvidence, "_missed", misses)
    lengths = {s.stop - s.first for s in ShootingEvidence(log, simulator).stretches}
    assert lengths == {40}


def whirls(top: float, rows: int = 500) -> tuple[pd.DataFrame, list[Port]]:
    """Return a run of a pendulum that is let go so far from its top, read with noise, and its ports."""
    rng, t = np.random.default_rng(1), 0.02 * np.arange(rows)

    def swing(s: float, x: np.ndarray) -> list[float]:
        return [x[1], 3.0 * np.sin(0.9 * s) - 40.0 * np.sin(x[0]) - 0.1 * x[1]]

    x = solve_ivp(swing, (0.0, t[-1]), [np.pi - top, 0.0], t_eval=t, rtol=1e-9, atol=1e-9).y
    q, w = x + np.array([[0.05], [0.3]]) * rng.standard_normal(x.shape)
    ports = [Port("T", "input", "rad/s2"), Port("q", "state", "rad"), Port("w", "state", "rad/s")]
    return pd.DataFrame({"trajectory": "0", "time": t, "T": 3.0 * np.sin(0.9 * t), "q": q, "w": w}), ports


@pytest.mark.parametrize(("top", "whole"), [(0.02, False), (2.8, True)])
def test_runs_are_parted_where_the_noise_of_their_start_leads_elsewhere(top: float, whole: bool) -> None:
    """Whether a pendulum near its top falls to this side or that, its reading does not tell."""
    log, ports = whirls(top)
    pendulum = FunctionSimulator(lambda t, x, u, p: [x.w, u.T - 40.0 * np.sin(x.q) - 0.1 * x.w], ports, {})
    found = ShootingEvidence(port_log(log, pendulum), pendulum)
    assert (len(found.stretches) == 1) is whole
    assert ("whole runs" in found.how) is whole
    assert max(np.sqrt(np.mean(np.square(e))) for e in found._error(found._x0)) < 1.1


def test_runs_of_an_unstable_system_stay_whole_where_its_response_is_linear() -> None:
    ports = [Port("T", "input", "rad/s2"), Port("q", "state", "rad"), Port("w", "state", "rad/s")]
    unstable = FunctionSimulator(lambda t, x, u, p: [x.w, u.T + 4.0 * x.q], ports, {})
    rng, t = np.random.default_rng(0), 0.02 * np.arange(200)
    q = 0.01 * np.exp(2.0 * t)
    log = pd.DataFrame({"trajectory": "0", "time": t, "T": 0.0 * t, "q": q, "w": 2.0 * q})
    log[["q", "w"]] += 0.1 * rng.standard_normal((200, 2))
    assert len(ShootingEvidence(port_log(log, unstable), unstable).stretches) == 1
