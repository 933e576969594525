"""One set of physics axioms, tested on every law and volume model, on numpy arrays and torch tensors."""

import math

import numpy as np
import pytest
import torch
from support.volumes import GEOMETRY, VOLUMES, states, tensors

from pamid.constants import ATMOSPHERIC_PRESSURE, GAS_CONSTANT, TEMPERATURE
from pamid.errors import UnknownOptionError, VolumeWarning
from pamid.laws.base import Law
from pamid.laws.gas import gas_mass
from pamid.laws.quasi_static import QuasiStaticForce
from pamid.laws.thermodynamic import ThermodynamicFlow
from pamid.signals.state import State
from pamid.volume import VolumeJet, all_volumes, check_volume, volume_class
from pamid.volume.bou_saba import BouSabaVolume, bou_saba
from pamid.volume.braided import BraidedVolume, chou_hannaford
from pamid.volume.classical import cylinder_volume
from pamid.volume.functions import flow, force
from pamid.volume.hildebrandt import HildebrandtVolume, hildebrandt
from pamid.volume.tondu_lopez import FRICTION_PARAMETERS, TonduLopezVolume, braid_friction, tondu_lopez

LAWS = {
    "force": QuasiStaticForce(0.2),
    "flow": ThermodynamicFlow(),
    "isothermal flow": ThermodynamicFlow(heat_capacity_ratio=1.0),
}


@pytest.fixture(params=VOLUMES)
def volume(request):
    return VOLUMES[request.param]


@pytest.fixture(params=LAWS)
def law(request):
    return LAWS[request.param]


# --- the volume ---------------------------------------------------------------------------------------------
def test_a_volume_is_positive_over_the_working_range(volume):
    assert np.all(volume.jet(states()).V > 0)


def test_a_jet_is_the_derivative_of_its_volume(volume):
    state = states()
    jet = volume.jet(state)
    h, k = 1e-6, 1.0
    V_eps = (volume.jet(state._replace(eps=state.eps + h)).V - volume.jet(state._replace(eps=state.eps - h)).V) / 2 / h
    V_P = (volume.jet(state._replace(P=state.P + k)).V - volume.jet(state._replace(P=state.P - k)).V) / 2 / k
    np.testing.assert_allclose(jet.V_eps, V_eps, rtol=1e-6, atol=1e-11)
    np.testing.assert_allclose(jet.V_P, V_P, rtol=1e-6, atol=1e-18)


def test_a_jet_equals_autograd_and_numpy_equals_torch(volume):
    state = states()
    t = tensors(state)
    eps, P = t.eps.requires_grad_(), t.P.requires_grad_()
    jet_np, jet = volume.jet(state), volume.jet(t)
    for a, b in zip(jet_np, jet, strict=True):
        assert isinstance(b, torch.Tensor)
        assert b.dtype == torch.float64
        assert b.shape == (200,)
        np.testing.assert_allclose(a, b.detach().numpy(), rtol=1e-13, atol=0)
    (V_eps,) = torch.autograd.grad(jet.V.sum(), eps, retain_graph=True)
    np.testing.assert_allclose(jet_np.V_eps, V_eps.numpy(), rtol=1e-10, atol=1e-16)
    V_P = torch.autograd.grad(jet.V.sum(), P, allow_unused=True)[0]
    np.testing.assert_allclose(jet_np.V_P, np.zeros(200) if V_P is None else V_P.numpy(), rtol=1e-10, atol=1e-24)


def test_parameters_may_be_tensors(volume):
    names = volume.parameter_names()
    if not names:
        return
    numbers = {n: torch.tensor(getattr(volume, n), dtype=torch.float64, requires_grad=True) for n in names}
    jet = type(volume)(**numbers).jet(tensors(states()))
    np.testing.assert_allclose(jet.V.detach().numpy(), volume.jet(states()).V, rtol=1e-13)
    gradients = torch.autograd.grad(jet.V.sum(), list(numbers.values()))
    for name, g in zip(names, gradients, strict=True):
        h = 1e-6
        up, down = (
            type(volume)(**{n: getattr(volume, n) + (s * h if n == name else 0.0) for n in names}) for s in (1, -1)
        )
        numeric = (up.jet(states()).V.sum() - down.jet(states()).V.sum()) / 2 / h
        assert math.isclose(float(g), numeric, rel_tol=1e-5), name


def test_a_volume_depends_on_pressure_only_if_it_says_so(volume):
    depends = np.any(volume.jet(states()).V_P != 0)
    assert not depends or volume.depends_on_pressure


def test_scalars_do_as_well_as_arrays(volume):
    jet = volume.jet(State(0.1, 0.0, 3e5, 0.0))
    arrays = volume.jet(State(*(np.array([s]) for s in (0.1, 0.0, 3e5, 0.0))))
    np.testing.assert_allclose([float(a) for a in jet], [a[0] for a in arrays], rtol=1e-15)


@pytest.mark.parametrize("name", all_volumes())
def test_every_model_of_one_geometry_starts_at_the_same_cylinder(name):
    model = all_volumes()[name].from_geometry(*GEOMETRY)
    jet = model.jet(State(np.zeros(1), np.zeros(1), np.full(1, 3e5), np.zeros(1)))
    np.testing.assert_allclose(jet.V, np.pi * 0.02**2 / 4 * 0.2, rtol=1e-14)
    if name != "cylinder":
        braided = BraidedVolume(*GEOMETRY).jet(states())
        for a, b in zip(braided, model.jet(states()), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-18)


def test_the_braid_keeps_its_thread_length():
    length, diameter, angle = GEOMETRY
    b, turns = length / math.cos(angle), length / math.cos(angle) * math.sin(angle) / (math.pi * diameter)
    eps = np.linspace(0, 0.3, 7)
    L = length * (1 - eps)
    V = BraidedVolume(*GEOMETRY).jet(State(eps, 0 * eps, 0 * eps, 0 * eps)).V
    D = np.sqrt(4 * V / (np.pi * L))
    np.testing.assert_allclose(L**2 + (np.pi * D * turns) ** 2, b**2, rtol=1e-13)


def test_parameters_are_declared_with_units_and_bounds():
    for name, cls in all_volumes().items():
        model = VOLUMES[name]
        for p in cls.parameters:
            assert p.lower < getattr(model, p.name) < p.upper
            assert p.unit
            assert p.meaning
            assert cls.parameter(p.name) is p


def test_discovery_gives_the_published_models_and_words_an_unknown_one():
    assert {"chou_hannaford", "tondu_lopez", "bou_saba", "hildebrandt", "polynomial", "cylinder"} <= set(all_volumes())
    with pytest.raises(UnknownOptionError, match="chou_hannaford"):
        volume_class("chou")


# --- force --------------------------------------------------------------------------------------------------
def test_no_force_without_gauge_pressure(volume):
    eps = np.linspace(0, 0.25, 11)
    assert np.all(force(volume, np.full(11, ATMOSPHERIC_PRESSURE), eps) == 0.0)


def test_force_falls_with_contraction_where_the_model_claims_it(volume):
    eps = np.linspace(-0.02, 0.25, 300)
    falls = [np.all(np.diff(force(volume, np.full(300, P), eps)) < 0) for P in (1.5e5, 3e5, 7e5)]
    assert all(falls) or not volume.force_falls
    if volume.pulls:
        assert np.all(force(volume, np.full(300, 3e5), eps)[:150] > 0)


def test_a_cylinder_pushes_with_pressure_times_area():
    F = force(VOLUMES["cylinder"], np.array([ATMOSPHERIC_PRESSURE + 1e5]), np.array([0.1]))
    np.testing.assert_allclose(F, -1e5 * np.pi * 0.01**2)


def test_work_of_the_force_is_work_of_the_gas(volume):
    P = 4e5
    eps = np.linspace(0.0, 0.25, 4001)
    F = force(volume, np.full(eps.shape, P), eps)
    V = volume.jet(State(eps, 0 * eps, np.full(eps.shape, P), 0 * eps)).V
    by_force = np.trapezoid(F, volume.rest_length * eps)  # −∫ F dL
    np.testing.assert_allclose(by_force, (P - ATMOSPHERIC_PRESSURE) * (V[-1] - V[0]), rtol=1e-6)
    steps = F[:-1] * volume.rest_length * np.diff(eps)
    np.testing.assert_allclose(steps, (P - ATMOSPHERIC_PRESSURE) * np.diff(V), rtol=2e-2, atol=1e-6)


def test_a_cycle_of_contraction_and_pressure_conserves_energy(volume):
    """Without a volume that depends on pressure, ∮ F dL = −∮ p dV around a closed path of (ε, P)."""
    t = np.linspace(0, 2 * np.pi, 20001)
    eps, P = 0.12 + 0.1 * np.sin(t), 3.5e5 + 1.5e5 * np.cos(t)
    F = force(volume, P, eps)
    jet = volume.jet(State(eps, 0 * t, P, 0 * t))
    out = np.trapezoid(F, volume.rest_length * eps)
    gas = np.trapezoid(P - ATMOSPHERIC_PRESSURE, jet.V)
    swelling = np.trapezoid((P - ATMOSPHERIC_PRESSURE) * jet.V_P, P)  # work on the braid at constant length
    np.testing.assert_allclose(out, gas - swelling, rtol=1e-6)
    assert abs(out) > 0.1  # J: a loop that does work
    if not np.any(jet.V_P):
        still = np.trapezoid(force(volume, np.full(t.shape, 3e5), eps), eps)
        assert abs(still) < 1e-9  # at constant pressure the gas gives back what it took


def test_shortcuts_by_name_equal_the_models():
    s = states()
    length, diameter, angle = GEOMETRY
    common = {"rest_diameter": diameter, "braid_angle": angle}
    pairs = [
        (chou_hannaford(s.P, s.eps, **common), BraidedVolume(*GEOMETRY)),
        (
            tondu_lopez(s.P, s.eps, **common, end_cap=1.1, end_cap_rise=0.4),
            TonduLopezVolume(*GEOMETRY, end_cap=1.1, end_cap_rise=0.4),
        ),
        (bou_saba(s.P, s.eps, **common, exponent=2.4), BouSabaVolume(*GEOMETRY, exponent=2.4)),
        (hildebrandt(s.P, s.eps, areas=(2e-3, -5e-3)), HildebrandtVolume(length, (2e-3, -5e-3))),
    ]
    for F, model in pairs:
        np.testing.assert_allclose(F, force(model, s.P, s.eps), rtol=1e-12, atol=1e-9)
        np.testing.assert_allclose(force(model, *(torch.tensor(a) for a in (s.P, s.eps))).numpy(), F, atol=1e-9)


def test_chou_hannaford_in_numbers():
    """3/tan² − 1/sin² at 25° times a disc of 20 mm times 2 bar, by hand."""
    a, b = 3 / math.tan(math.radians(25)) ** 2, 1 / math.sin(math.radians(25)) ** 2
    F = chou_hannaford(ATMOSPHERIC_PRESSURE + 2e5, 0.0, rest_diameter=0.02, braid_angle=math.radians(25))
    assert math.isclose(F, 2e5 * math.pi * 1e-4 * (a - b), rel_tol=1e-12)


def test_end_caps_fade_with_pressure():
    muscle = TonduLopezVolume(*GEOMETRY, end_cap=1.1, end_cap_rise=0.8)
    plain, capped = BraidedVolume(*GEOMETRY), TonduLopezVolume(*GEOMETRY, end_cap=1.1)
    eps = np.full(2, 0.15)
    P = np.array([1.2e5, 9e5])
    loss = force(capped, P, eps) / force(plain, P, eps)
    more = force(muscle, P, eps) / force(plain, P, eps)
    assert np.all(loss < 1)
    assert more[0] < 0.8 * loss[0]
    np.testing.assert_allclose(more[1], loss[1], rtol=1e-3)


def test_braid_friction_opposes_the_motion_and_needs_pressure():
    numbers = {"static_friction_area": 3e-5, "kinetic_friction_area": 1e-5, "stribeck_rate": 0.2}
    deps = np.linspace(-2, 2, 401)
    F = braid_friction(deps, np.full(401, 2e5), **numbers)
    assert np.all(F * deps >= 0)
    np.testing.assert_allclose(F, -F[::-1], atol=1e-12)
    assert F[200] == 0
    assert 5.0 < F.max() < 6.0  # static share: 2e5 Pa × 3e-5 m²
    assert math.isclose(F[-1], 2.0, rel_tol=1e-3)  # kinetic share
    assert np.all(braid_friction(deps, np.zeros(401), **numbers) == 0)
    torch_F = braid_friction(torch.tensor(deps), torch.full((401,), 2e5, dtype=torch.float64), **numbers)
    np.testing.assert_allclose(torch_F.numpy(), F, rtol=1e-12, atol=1e-12)
    assert {p.name for p in FRICTION_PARAMETERS} == set(numbers)


# --- the laws as functionals --------------------------------------------------------------------------------
def test_a_law_is_linear_in_the_volume(law):
    s = states()
    one, two = VOLUMES["chou_hannaford"].jet(s), VOLUMES["tondu_lopez with end caps"].jet(s)
    both = VolumeJet(*(2.0 * a - 3.0 * b for a, b in zip(one, two, strict=True)))
    np.testing.assert_allclose(
        law.predict(*both, s), 2.0 * law.predict(*one, s) - 3.0 * law.predict(*two, s), rtol=1e-10, atol=1e-12
    )
    assert np.all(law.predict(0 * s.P, 0 * s.P, 0 * s.P, s) == 0)


def test_a_law_is_the_same_on_numpy_and_torch(law):
    s, t = states(), tensors(states())
    jet, jet_t = VOLUMES["tondu_lopez with end caps"].jet(s), VOLUMES["tondu_lopez with end caps"].jet(t)
    np.testing.assert_allclose(law.predict(*jet_t, t).numpy(), law.predict(*jet, s), rtol=1e-12, atol=1e-15)
    for c in law.coefficients(t):
        assert isinstance(c, torch.Tensor)
        assert c.shape == (200,)


def test_a_law_says_what_it_predicts(law):
    assert isinstance(law, Law)
    assert {"force": "N", "flow": "kg/s"}[law.equation] == law.unit
    assert {"force": "F", "flow": "mdot"}[law.equation] == law.target


def test_flow_is_reversed_by_time(volume):
    s = states()
    there = flow(volume, s.P, s.dP, s.eps, s.deps)
    back = flow(volume, s.P, -s.dP, s.eps, -s.deps)
    np.testing.assert_allclose(there, -back, rtol=1e-12)
    assert np.all(flow(volume, s.P, 0 * s.dP, s.eps, 0 * s.deps) == 0)


def test_isothermal_flow_is_the_rate_of_the_mass(volume):
    t = np.linspace(0.0, 1.0, 20001)
    eps, P = 0.12 + 0.1 * np.sin(7 * t), 3e5 + 1e5 * np.cos(5 * t)
    deps, dP = 0.7 * np.cos(7 * t), -5e5 * np.sin(5 * t)
    V = volume.jet(State(eps, deps, P, dP)).V
    m = gas_mass(P, V)
    mdot = flow(volume, P, dP, eps, deps, heat_capacity_ratio=1.0)
    np.testing.assert_allclose(np.gradient(m, t)[1:-1], mdot[1:-1], rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(np.trapezoid(mdot, t), m[-1] - m[0], rtol=1e-5)


def test_flow_uses_absolute_and_force_gauge_pressure():
    s = states(50)
    muscle = VOLUMES["chou_hannaford"]
    jet = muscle.jet(s)
    still = s._replace(dP=0 * s.dP)
    np.testing.assert_allclose(
        ThermodynamicFlow().predict(*jet, still), s.P * jet.V_eps * s.deps / (GAS_CONSTANT * TEMPERATURE), rtol=1e-12
    )
    at_zero = force(muscle, np.zeros(50), s.eps)  # a vacuum inside: the ambient pressure pushes the muscle out
    np.testing.assert_allclose(at_zero, -ATMOSPHERIC_PRESSURE * jet.V_eps / 0.2, rtol=1e-12)
    higher = force(muscle, s.P + 1e5, s.eps, atmospheric_pressure=ATMOSPHERIC_PRESSURE + 1e5)
    np.testing.assert_allclose(higher, force(muscle, s.P, s.eps), rtol=1e-9)


# --- does a volume make sense -------------------------------------------------------------------------------
def test_a_sensible_volume_passes_the_check(recwarn):
    s = states()
    for model in (BraidedVolume(*GEOMETRY), TonduLopezVolume(*GEOMETRY, end_cap=1.1)):
        report = check_volume(model.jet(s), s, rest_volume=cylinder_volume(0.2, 0.02))
        assert report.sensible
        assert report.positive == report.growing == 1.0
        assert 1.0 < report.relative_size < 3.0
    assert not recwarn


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda j: VolumeJet(j.V - 1e-3, j.V_eps, j.V_P), "not positive"),
        (lambda j: VolumeJet(j.V, -j.V_eps, j.V_P), "falls with contraction"),
        (lambda j: VolumeJet(50 * j.V, 50 * j.V_eps, j.V_P), "times that of the cylinder"),
    ],
)
def test_a_senseless_volume_is_told(change, word):
    s = states()
    jet = change(BraidedVolume(*GEOMETRY).jet(s))
    with pytest.warns(VolumeWarning, match=word):
        report = check_volume(jet, s, rest_volume=cylinder_volume(0.2, 0.02))
    assert not report.sensible
    assert check_volume(VolumeJet(*(torch.tensor(a) for a in jet)), tensors(s), rest_volume=6e-5, warn=False).messages


def test_a_level_that_nothing_determines_is_not_judged():
    s = states()
    jet = BraidedVolume(*GEOMETRY).jet(s)
    report = check_volume(VolumeJet(jet.V - 1.0, jet.V_eps, jet.V_P), s, rest_volume=6e-5, level_known=False)
    assert report.sensible
    assert math.isnan(report.positive)


def test_no_law_of_the_package_is_left_out_of_the_axioms():
    import importlib
    import pkgutil

    import pamid.laws

    for module in pkgutil.iter_modules(pamid.laws.__path__):
        importlib.import_module(f"pamid.laws.{module.name}")
    of_the_package = {c for c in Law.__subclasses__() if c.__module__.startswith("pamid.laws.")}
    assert of_the_package == {type(law) for law in LAWS.values()}
