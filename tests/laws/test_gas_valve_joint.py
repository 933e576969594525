"""Gas, valve and joint: conservation, limits, and the identified map of a valve."""

import math

import numpy as np
import pytest
import torch
from support.volumes import VOLUMES, states

from pamid.constants import ATMOSPHERIC_PRESSURE, GAS_CONSTANT, TEMPERATURE
from pamid.errors import ExcitationError, ParameterError, ShapeError
from pamid.laws.gas import entropic_content, mass_flow, pressure_rate
from pamid.laws.joint import AntagonisticJoint
from pamid.laws.thermodynamic import ThermodynamicFlow
from pamid.laws.valve import Valve, flow_function, valve_flow
from pamid.laws.valve_map import ValveMap


# --- gas ----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("gamma", [1.0, 1.2, 1.4])
def test_pressure_rate_inverts_mass_flow(gamma):
    s = states()
    V, dV = np.full(200, 1e-4) + 1e-5 * s.eps, 1e-5 * s.deps
    mdot = mass_flow(s.P, s.dP, V, dV, heat_capacity_ratio=gamma)
    np.testing.assert_allclose(pressure_rate(s.P, mdot, V, dV, heat_capacity_ratio=gamma), s.dP, rtol=1e-10, atol=1e-6)
    jet = VOLUMES["tondu_lopez with end caps"].jet(s)
    same = mass_flow(s.P, s.dP, jet.V, jet.V_eps * s.deps + jet.V_P * s.dP, heat_capacity_ratio=gamma)
    np.testing.assert_allclose(ThermodynamicFlow(gamma).predict(*jet, s), same, rtol=1e-12, atol=1e-18)


@pytest.mark.parametrize("gamma", [1.0, 1.3, 1.4])
def test_the_flow_equation_integrates_exactly(gamma):
    t = np.linspace(0.0, 1.0, 40001)
    P, dP = 3e5 + 2e5 * np.sin(9 * t), 18e5 * np.cos(9 * t)
    V, dV = 1e-4 + 4e-5 * np.sin(4 * t), 16e-5 * np.cos(4 * t)
    mdot = mass_flow(P, dP, V, dV, heat_capacity_ratio=gamma)
    content = entropic_content(P, V, heat_capacity_ratio=gamma)
    supply = P ** (1 / gamma - 1) * GAS_CONSTANT * TEMPERATURE * mdot
    np.testing.assert_allclose(np.gradient(content, t)[1:-1], supply[1:-1], rtol=1e-4, atol=1e-5 * np.abs(supply).max())
    np.testing.assert_allclose(np.trapezoid(supply, t), content[-1] - content[0], rtol=1e-6)


def test_a_sealed_chamber_is_adiabatic():
    V = np.array([1e-4, 2e-4])
    P = 5e5 * (V[0] / V) ** 1.4
    contents = entropic_content(P, V)
    assert math.isclose(contents[0], contents[1], rel_tol=1e-12)
    assert pressure_rate(5e5, 0.0, 1e-4, 1e-4) == -1.4 * 5e5


# --- valve --------------------------------------------------------------------------------------------------
VALVE = Valve(sonic_conductance=6e-9, critical_pressure_ratio=0.35, supply_pressure=7e5)


def test_no_flow_against_the_pressure():
    assert np.all(VALVE.flow(np.ones(5), np.linspace(7e5, 9e5, 5)) == 0)
    assert np.all(VALVE.flow(-np.ones(5), np.linspace(5e4, ATMOSPHERIC_PRESSURE, 5)) == 0)
    P = np.linspace(1.02e5, 6.99e5, 200)
    assert np.all(VALVE.flow(np.full(200, 0.3), P) > 0)
    assert np.all(VALVE.flow(np.full(200, -0.3), P) < 0)
    assert np.all(VALVE.flow(np.zeros(200), P) == 0)


def test_a_choked_valve_does_not_feel_downstream():
    filling = VALVE.flow(np.ones(50), np.linspace(1e5, 0.35 * 7e5, 50))
    np.testing.assert_allclose(filling, 6e-9 * 1.185 * 7e5, rtol=1e-14)
    P = np.linspace(ATMOSPHERIC_PRESSURE / 0.35, 7e5, 50)
    np.testing.assert_allclose(VALVE.flow(-np.ones(50), P), -6e-9 * 1.185 * P, rtol=1e-14)


def test_the_flow_function_is_continuous_and_falls():
    x = np.linspace(-0.2, 1.3, 30001)
    psi = flow_function(x, 0.35)
    assert np.all(np.diff(psi) <= 0)
    assert np.all((psi >= 0) & (psi <= 1))
    assert np.abs(np.diff(psi)).max() < 0.02  # √ of the step: the slope is infinite at 1
    assert flow_function(np.array([1.0]), 0.35)[0] == 0.0
    np.testing.assert_allclose(flow_function(np.array([0.675]), 0.35), math.sqrt(0.75))
    np.testing.assert_allclose(np.diff(VALVE.flow(np.linspace(-1e-3, 1e-3, 101), np.full(101, 3e5))), 0, atol=1e-6)


def test_the_linear_stretch_has_a_finite_slope_and_joins_on():
    x = np.linspace(0.0, 1.0, 100001)
    psi, smooth = flow_function(x, 0.35), flow_function(x, 0.35, 0.99)
    assert np.array_equal(psi[x < 0.99], smooth[x < 0.99])
    assert np.abs(np.diff(smooth)).max() < 2e-4
    t = torch.tensor([0.2, 0.5, 0.995, 1.0], dtype=torch.float64, requires_grad=True)
    flow_function(t, 0.35, 0.99).sum().backward()
    assert torch.all(torch.isfinite(t.grad))
    t = torch.tensor([0.2, 0.35, 0.5, 1.0, 1.2], dtype=torch.float64, requires_grad=True)
    flow_function(t, 0.35).sum().backward()
    assert torch.all(torch.isfinite(t.grad))


def test_the_valve_on_torch_equals_numpy_and_inverts():
    rng = np.random.default_rng(1)
    u, P = rng.uniform(-1, 1, 300), rng.uniform(0.9e5, 7.5e5, 300)
    mdot = VALVE.flow(u, P)
    np.testing.assert_allclose(VALVE.flow(torch.tensor(u), torch.tensor(P)).numpy(), mdot, rtol=1e-12, atol=1e-18)
    flows = mdot != 0
    np.testing.assert_allclose(VALVE.command(mdot, P)[flows], u[flows], rtol=1e-12)
    assert np.all(VALVE.command(np.array([1e-3, -1e-3, 0.0]), np.array([8e5, 9e4, 8e5])) == [np.inf, -np.inf, 0.0])
    same = valve_flow(0.4, 3e5, 7e5, sonic_conductance=6e-9, critical_pressure_ratio=0.35)
    assert float(same) == float(VALVE.flow(0.4, 3e5)) > 0


# --- joint --------------------------------------------------------------------------------------------------
JOINT = AntagonisticJoint(0.04, 0.2, 0.12, inertia=0.02, viscous_damping=0.08)


def test_the_joint_shortens_muscle_1_and_stretches_muscle_2():
    eps1, eps2 = JOINT.contractions(np.array([-0.3, 0.0, 0.3]))
    assert np.all(np.diff(eps1) > 0)
    np.testing.assert_allclose(eps1 + eps2, 0.24)
    np.testing.assert_allclose(JOINT.angle(eps1), [-0.3, 0.0, 0.3])
    L1, L2 = JOINT.lengths(0.3)
    assert L1 < L2


def test_the_stronger_muscle_turns_the_joint_its_way():
    assert JOINT.acceleration(300.0, 200.0, 0.0) > 0 > JOINT.acceleration(200.0, 300.0, 0.0)
    assert JOINT.acceleration(250.0, 250.0, 1.0) == -0.08 / 0.02
    assert JOINT.acceleration(250.0, 250.0, 0.0, external_torque=0.1) == pytest.approx(5.0)
    ddq = JOINT.acceleration(300.0, 200.0, 0.7)
    assert JOINT.residual(300.0, 200.0, 0.7, ddq) == pytest.approx(0.0, abs=1e-12)


def test_power_of_the_joint_is_power_of_the_muscles():
    q, dq, F1, F2 = 0.2, 1.3, 310.0, 260.0
    h = 1e-6
    dL1, dL2 = ((a - b) / 2 / h * dq for a, b in zip(JOINT.lengths(q + h), JOINT.lengths(q - h), strict=True))
    assert math.isclose(JOINT.torque(F1, F2) * dq, -F1 * dL1 - F2 * dL2, rel_tol=1e-8)


# --- the valve's map ------------------------------------------------------------------------------------------
def measured_valve(n=3000, seed=0, leak=0.0):
    rng = np.random.default_rng(seed)
    u, P = rng.uniform(-1, 1, n), rng.uniform(1.4e5, 5.5e5, n)
    iso = Valve(sonic_conductance=6e-9, critical_pressure_ratio=0.35, supply_pressure=7e5)
    return u, P, iso.flow(u, P) + leak + rng.normal(0, 3e-6, n), iso


def test_a_map_identified_from_flow_is_the_valve_s_and_its_command_its_inverse():
    u, P, mdot, iso = measured_valve(leak=2e-5)
    known = ValveMap.fit(u, P, mdot, supply_pressure=7e5)
    new_u, new_P, _, _ = measured_valve(seed=1)
    error = known.flow(new_u, new_P) - iso.flow(new_u, new_P) - 2e-5
    assert np.std(error) < 1e-3 * np.std(mdot)
    np.testing.assert_allclose(known.command(known.flow(new_u, new_P), new_P), new_u, rtol=1e-9, atol=1e-9)
    both = known.flow(torch.as_tensor(new_u), torch.as_tensor(new_P))
    np.testing.assert_allclose(both.numpy(), known.flow(new_u, new_P), rtol=1e-12)
    assert known.flow(1.0, 9e5) == known.flow(1.0, known.highest)  # held where the polynomials know nothing


def test_a_map_is_not_identified_from_one_way_or_one_pressure():
    u, P, mdot, _ = measured_valve(400)
    with pytest.raises(ExcitationError, match="venting"):
        ValveMap.fit(np.abs(u), P, mdot, supply_pressure=7e5)
    with pytest.raises(ExcitationError, match="coefficients"):
        ValveMap.fit(u, 0 * P + 3e5, mdot, supply_pressure=7e5)
    with pytest.raises(ParameterError, match="degree"):
        ValveMap.fit(u, P, mdot, supply_pressure=7e5, degree=-1)
    with pytest.raises(ShapeError, match="samples"):
        ValveMap.fit(u[1:], P, mdot, supply_pressure=7e5)
