"""Mechanisms written with numpy's matrices are asked for many instants at once, with the same answers."""

from __future__ import annotations

import numpy as np
import numpy.linalg as la
import pytest
from numpy import array, where
from numpy.linalg import inv

from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.ports import Values

PORTS = [Port("tau", "input", "N m"), *(Port(name, "state", "rad") for name in ("a", "b", "wa", "wb"))]
WEIGHT, STATE = np.array([3.0, 1.0]), np.arange(16.0).reshape(4, 4)


def inertia(a, b):
    c = np.cos(a - b)
    return np.array([[3.0, c], [c, 1.0]])


def solved(t, x, u, p):
    r = np.array([u.tau - p.c * x.wa, -9.81 * np.sin(x.b)])
    r[0] += p.c * (x.wb - x.wa)
    s = np.linalg.solve(inertia(x.a, x.b), r)
    return [x.wa, x.wb, s[0], s[1]]


def inverted(t, x, u, p):
    q, dq = x[:2], x[2:]
    M = array([[3.0, 0.2 * np.sin(q[1])], [0.2 * np.sin(q[1]), 1.0]])
    C = array([[p.c, dq[0]], [-dq[1], 0.0]])
    force = array([u[0], 0.0]) - C @ dq - where(q[0] > 0.0, 1.0, 2.0) * q
    return np.concatenate([dq, inv(M) @ force])


def filled(t, x, u, p):
    M, B = np.zeros((2, 2)), np.array([[1.0], [0.0]])
    M[0, 0], M[0, 1], M[1, 0], M[1, 1] = 3.0, 0.5 * np.cos(x.b), 0.5 * np.cos(x.b), 1.0 + x.a**2
    force = B @ np.array([[u.tau]]) - np.eye(2) @ np.array([[p.c * x.wa], [x.wb]])
    acceleration = la.solve(M, force).flatten()
    energy = 0.5 * np.array([x.wa, x.wb]).dot(M.T).dot(np.array([x.wa, x.wb])) / la.det(M)
    return np.array([x.wa, x.wb, acceleration[0], acceleration[1] + 1e-3 * energy])


def weighed(t, x, u, p):
    return [*(WEIGHT * np.array([x.wa, x.wb])), float(np.dot([1.0, 2.0], [x.a, x.b])), max(x.wa, u.tau)]


def summed(t, x, u, p):
    r = np.array([x.wa, x.wb])
    return [r.sum(axis=-1), r.max() - np.min(r), np.sum(r) + np.mean(r), np.linalg.norm(r)]


def put_together(t, x, u, p):
    r, M = np.array([x.wa, u.tau]), np.outer(x[:2], WEIGHT) + np.diag([1.0, 2.0])
    wide = np.hstack([r, 1.0, np.cross([0.0, 0.0, 1.0], np.array([x.a, x.b, p.c]))])
    if np.any(np.abs(r) > 2.0):
        return wide[:4] * np.trace(M)
    return np.vstack([M, [r * WEIGHT]]).reshape(3, 2)[:2].ravel() + (x - np.array([1.0, 2.0, 3.0, 4.0]))


def linear(t, x, u, p):
    x = x - np.array([0.1, 0.0, 0.0, 0.2])
    x += 1.0
    return STATE @ x + np.array([[0.0], [0.0], [1.0], [2.0]]) @ u + np.array([0.0, 1.0, 0.0, p.c * x.sum()])


def fourth(t, x, u, p):
    return [*(WEIGHT * np.array([x.wa, x.wb])), x.wa[...].size, x.wb]


def given(n, seed=0):
    rng = np.random.default_rng(seed)
    return np.zeros(n), rng.normal(size=(4, n)), rng.normal(size=(1, n)), np.full((1, n), 0.3)


@pytest.mark.parametrize(
    ("function", "at_once"),
    [(solved, True), (inverted, True), (filled, True), (weighed, True), (summed, True), (put_together, True),
     (linear, True), (fourth, False)],
)  # fmt: skip
def test_many_instants_are_as_each_alone(function, at_once) -> None:
    simulator = FunctionSimulator(function, PORTS, {"c": 0.3})
    found = simulator.rate(*given(50))
    assert simulator.at_once is at_once
    for n in (50, 1, 2, 7):
        t, x, u, p = given(n, seed=n)
        alone = np.transpose([np.ravel(np.asarray(function(0.0, *row))) for row in named(simulator, x, u, p)])
        assert np.allclose(simulator.rate(t, x, u, p), alone, rtol=1e-12)
    assert type(found) is np.ndarray


def named(simulator, x, u, p):
    some = zip((x, u, p), (simulator.states, simulator.inputs, tuple(simulator.parameters)), strict=True)
    return zip(*([Values.of(row, names) for row in rows.T] for rows, names in some), strict=True)
