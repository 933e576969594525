"""Equations at a few instants, where plain numbers take the place of arrays."""

import numpy as np
import pytest

from pamid.simulators import EquationSimulator, Port
from pamid.simulators.equation_model import FEW, FUNCTIONS

RIGHT = (
    "sqrt(abs(x)) + exp(-x) + log(1 + v^2) + sin(x)*cos(v) + tan(0.1*x) + atan(v) + tanh(u) + sign(v)*min(x, u)"
    " + max(x, v)"
)
PORTS = [Port("u", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]


def asked(equation, x, v, u):
    """Rates at a few instants, and the same among many, where arrays are used."""
    simulator = EquationSimulator({"dx/dt": "v", "dv/dt": equation}, PORTS, {"m": 2.0})
    n = len(x)
    assert n <= FEW
    given = [np.array([x, v], dtype=float), np.array([u], dtype=float), np.full((1, n), 2.0)]
    few = simulator.rate(np.zeros(n), *given)
    many = simulator.rate(np.zeros(10 * n), *(np.tile(rows, 10) for rows in given))[:, :n]
    return few, many


def test_all_functions_are_in_the_equation():
    assert all(f"{name}(" in RIGHT for name in FUNCTIONS)


def test_few_instants_give_what_many_give():
    few, many = asked(RIGHT, [0.3, -1.2, 0.0], [0.0, 2.0, -0.5], [1.0, -1.0, 0.0])
    assert np.allclose(few, many, rtol=1e-14, atol=0.0)


@pytest.mark.parametrize(
    "equation",
    ["1/x", "sqrt(x)", "log(x)", "x**0.5", "exp(1000*v)", "min(x, v)", "max(x, v)", "sign(x)", "(-8)**(1/3)*v"],
)
def test_what_is_not_finite_is_what_arrays_hold(equation):
    few, many = asked(equation, [0.0, -1.0, np.nan], [1.0, np.nan, 2.0], [0.0, 0.0, 0.0])
    assert np.array_equal(few, many, equal_nan=True)


def test_the_order_of_the_equations_is_that_of_the_ports_whatever_the_user_wrote_first():
    turned = EquationSimulator({"dv/dt": "u - x", "dx/dt": "v"}, PORTS)
    x, u = np.array([[1.0], [2.0]]), np.array([[4.0]])
    many = [np.repeat(values, FEW + 1, axis=1) for values in (x, u)]
    assert turned.rate(np.zeros(1), x, u, np.zeros((0, 1)))[:, 0].tolist() == [2.0, 3.0]
    assert turned.rate(np.zeros(FEW + 1), *many, np.zeros((0, FEW + 1)))[:, 0].tolist() == [2.0, 3.0]
