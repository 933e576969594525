"""Numbers of a simulator that are wrong by orders of magnitude: a servo that is fifty times too stiff."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.gap.inference.sensitivity import _far
from pamid.gap.residuals.response import Drive
from pamid.gap.residuals.shooting import ShootingEvidence
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.of_parameters import ParameterDeviation
from pamid.simulators.port_log import port_log

DT = 0.02


def followed(u, p, x0):
    """Return the angle of a damped servo, exact between commands."""
    share, angle, out = np.exp(-p.stiffness * DT / p.damping), u["command"][0], []
    for command in u["command"]:
        out.append(angle)
        angle = command + (angle - command) * share
    return [np.array(out)]


def servo(stiffness):
    ports = [Port("command", "input", "rad"), Port("angle", "output", "rad")]
    return FunctionSimulator(
        followed, ports, {"stiffness": (stiffness, 0.0, "N m/rad"), "damping": (2.0, 0.0, "N m s/rad")}, form="run"
    )


def log(stiffness, many=4):
    rng, runs = np.random.default_rng(2), []
    for run in range(many):
        command = np.repeat(rng.uniform(-0.5, 0.5, 12), 25)
        angle = servo(stiffness).run(
            DT * np.arange(300), command[None], np.array([stiffness, 2.0]), np.zeros(0)
        )[0] + 1e-4 * rng.standard_normal(300)  # fmt: skip
        runs.append(pd.DataFrame({"trajectory": str(run), "time": DT * np.arange(300), "command": command,
                                  "angle": angle}))  # fmt: skip
    return pd.concat(runs, ignore_index=True)


@pytest.mark.parametrize(("given", "true"), [(1000.0, 20.0), (0.4, 20.0)])
def test_a_stiffness_far_off_is_found_by_its_factor(given, true):
    found = diagnose_simulator(log(true), servo(given), ["parameter_deviation@stiffness", "actuator_bias@command"])
    (cause,) = found.causes
    factor = 1.0 + cause.parameters["deviation"].value
    low, high = (1.0 + end for end in cause.parameters["deviation"].ci90)
    assert (cause.effects, cause.where) == (("parameter_deviation",), ("stiffness",))
    assert factor == pytest.approx(true / given, rel=0.01)
    assert 0.0 < low < true / given < high < 1.2 * true / given
    assert not cause.parameters["deviation"].at_bound


def test_a_deviation_of_any_positive_factor_keeps_an_interval_that_is_positive():
    (deviation,) = ParameterDeviation.parameters
    for value in (-0.99, 0.0, 99.0):
        low, high = deviation.interval(value, 0.5 * (1.0 + value))
        assert -1.0 < low < value < high
        assert (1.0 + low) * (1.0 + high) == pytest.approx((1.0 + value) ** 2)


def test_responses_that_nearly_cancel_are_no_substitute_for_a_run():
    """The difference of two known responses that hardly differ holds little but what is not linear in them."""

    def read(u, p, x0):
        return [1e-3 * np.round(followed(u, p, x0)[0] / 1e-3)]  # an encoder of 1 mrad

    ports = [Port("command", "input", "rad"), Port("angle", "output", "rad")]
    simulator = FunctionSimulator(read, ports, {"stiffness": 20.0, "damping": 2.0}, form="run")
    some = log(20.0, 1)
    evidence = ShootingEvidence(port_log(some, simulator), simulator)
    none, u = np.zeros((0, 1)), some["command"].to_numpy()[None]
    p = np.repeat(simulator.numbers[:, None], len(some), axis=1)
    step, wave = 0.2 * np.ones_like(u), 0.1 * np.sin(some["time"].to_numpy())[None]

    def answered(change):
        return evidence._combined(none, Drive(u, p, []), Drive(u + change, p, []))

    answered(step)
    answered(step + 0.1 * wave)
    exact = evidence._ran(none, u + wave, p)
    assert np.max(np.abs(answered(wave) - exact)) < 2e-3


@pytest.mark.parametrize(
    ("left", "most"), [(lambda f: 1.0 + 30.0 / f, 9), (lambda f: 1.0 + 30.0 / (1.0 + f / 1e4), 13)]
)
def test_no_larger_factor_is_tried_where_the_likelihood_levels_off(left, most):
    asked, noise = [], np.random.default_rng(0).standard_normal(400)

    def tangent(spec, x):
        asked.append(1.0 + spec["parameter_deviation@speed"]["deviation"])
        return left(asked[-1]) * noise

    evidence = SimpleNamespace(
        free=[], J=np.zeros((400, 0)), z0=left(1.0) * noise, parts=[slice(0, 400)], weights=np.ones(1), tangent=tangent,
        effects={"parameter_deviation@speed": ParameterDeviation},
    )  # fmt: skip
    (deviation,) = ParameterDeviation.parameters
    (found,) = _far(evidence, "parameter_deviation@speed", deviation, -0.1 * noise)
    assert len(asked) <= most  # of thirteen that a deviation may have
    assert left(1.0 + found.fixed["deviation"]) < 2.0
