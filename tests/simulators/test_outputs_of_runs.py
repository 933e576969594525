"""What a function of whole runs gives that is no number is told, and never compared with the log."""

import numpy as np
import pandas as pd
import pytest

import pamid
from pamid.errors import MissingColumnError, SimulatorRunError
from pamid.simulators import FunctionSimulator, Port

PORTS = [Port("u", "input", "V"), Port("y", "output", "V")]


def log():
    t = np.arange(0, 5, 0.01)
    u = np.sin(2 * t)
    return pd.DataFrame(
        {"trajectory": "a", "time": t, "u": u, "y": u + 0.01 * np.random.default_rng(0).normal(size=500)}
    )


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e308])
def test_a_run_that_is_not_finite_is_told_with_its_output_and_time(value):
    def run(u, p, x0):
        y = u.u + 0.0
        y[300:310] = value
        return [y]

    with pytest.raises(SimulatorRunError, match=r"output y is .* after 3 s of a run"):
        pamid.evaluate(log(), FunctionSimulator(run, PORTS, {}, form="run"))


def test_a_healthy_one_is_compared():
    found = pamid.evaluate(log(), FunctionSimulator(lambda u, p, x0: [u.u + 0.0], PORTS, {}, form="run"))
    assert found["y"].rmse < 0.02


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_rates_of_a_hidden_state_that_are_not_finite_are_told_with_the_time(value):
    def rates(t, x, u, p):
        return [x.h - x.y, np.where(x.h > 0.1, value, u.u - x.h)]

    ports = [Port("u", "input", "V"), Port("y", "state", "V"), Port("h", "state", "V")]
    with pytest.raises(SimulatorRunError, match=r"prediction of .*h is not finite after .* s from .* s of 'a'"):
        pamid.evaluate(log(), FunctionSimulator(rates, ports, {}))


def test_outputs_that_are_not_finite_are_told_with_the_time():
    ports = [Port("u", "input", "V"), Port("h", "state", "V"), Port("y", "output", "V")]

    def rates(t, x, u, p):
        return [u.u - x.h]

    def outputs(t, x, u, p):
        return [np.where(x.h > 0.1, np.nan, x.h)]

    with pytest.raises(SimulatorRunError, match=r"prediction of y is nan after"):
        pamid.evaluate(log(), FunctionSimulator(rates, ports, {}, output=outputs))


def test_a_log_that_holds_only_where_runs_begin_is_refused():
    ports = [*PORTS, Port("h", "state", "V", start=0.0)]
    with pytest.raises(MissingColumnError, match=r"no output of the simulator.*at least one of y"):
        pamid.diagnose(
            log().rename(columns={"y": "h"}), FunctionSimulator(lambda u, p, x0: [u.u], ports, {}, form="run")
        )


def test_a_run_function_without_output_ports_is_told_so():
    ports = [Port("u", "input", "V"), Port("y", "state", "V", start=0.0)]
    with pytest.raises(MissingColumnError, match=r"no port for what it returns.*output port for each row"):
        pamid.diagnose(log(), FunctionSimulator(lambda u, p, x0: [u.u], ports, {}, form="run"))
