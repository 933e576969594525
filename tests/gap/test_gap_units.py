"""Parameters of causes come in the units of the log, whatever scale the inference works on."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import GapDiagnoser

from pamid import diagnose
from pamid.effects import Signals, all_effects, make_effect
from pamid.errors import UnknownOptionError
from pamid.gap.residuals.on_equation import OnEquation
from pamid.gap.residuals.units import Units, powers_of
from pamid.report import answers
from pamid.report.sections import Source
from pamid.report.sections.parameters import ParametersSection
from pamid.simulators.placement import Scales
from pamid.systems.cylinder import Cylinder
from pamid.systems.joint import Joint

TIME = np.arange(0, 8, 0.004)
FEW = ["viscous_friction", "coulomb_friction", "force_bias", "bladder_elasticity"]


def runs(make, speeds=(1.0, 2.3, 4.0)):
    rng = np.random.default_rng(0)
    parts = [make(w, rng).assign(trajectory=f"run-{w:g}", time=TIME) for w in speeds]
    return pd.concat(parts, ignore_index=True)


@pytest.fixture(scope="module")
def damped():
    """A cylinder with viscous friction of exactly 200 N s/m."""

    def make(w, rng):
        x, v = 0.05 + 0.04 * np.sin(w * TIME), 0.04 * w * np.cos(w * TIME)
        P = 4e5 + 2e4 * np.sin(0.7 * w * TIME)
        F = (P - 101_325.0) * np.pi / 4 * 0.025**2 - 200.0 * v + 0.3 * rng.standard_normal(len(TIME))
        return pd.DataFrame({"x": x, "P": P, "F": F})

    log = runs(make)
    return log, diagnose(log, Cylinder(bore=0.025), FEW)


def test_a_cylinder_tells_newton_seconds_per_metre(damped):
    found = damped[1]
    assert found.causes[0].effects == ("viscous_friction",)
    p = found.causes[0].parameters["coefficient"]
    assert p.unit == "N s/m"
    assert p.value == pytest.approx(200.0, rel=0.02) and p.ci90[0] < 200.0 < p.ci90[1]
    assert "N s/m" in answers(found).which
    [cause] = ParametersSection(found, Source()).content()["causes"]
    assert [row["value"].split(" ", 1)[1] for row in cause["rows"]] == ["N s/m"]
    assert found.as_dict()["causes"][0]["parameters"]["coefficient"]["unit"] == "N s/m"
    assert found.closure[0].unit == "N"


def test_a_joint_tells_newton_metre_seconds_per_radian():
    def make(w, rng):
        q, dq, ddq = 0.5 * np.sin(w * TIME), 0.5 * w * np.cos(w * TIME), -0.5 * w * w * np.sin(w * TIME)
        drive = 0.02 * ddq + 0.8 * np.sin(q) + 0.05 * dq + 0.004 * rng.standard_normal(len(TIME))
        return pd.DataFrame({"q": q, "drive": drive})

    found = diagnose(runs(make), Joint(inertia=0.02, gravity=0.8, unit="N m"), FEW)
    assert found.causes[0].effects == ("viscous_friction",)
    p = found.causes[0].parameters["coefficient"]
    assert (p.unit, p.value) == ("N m s/rad", pytest.approx(0.05, rel=0.05))


@pytest.mark.parametrize("factor", [1.0, 1e3])
def test_a_table_tells_the_units_of_its_owner(factor):
    """Metres or millimetres: the same number of newton seconds per what the owner calls a unit."""
    rng = np.random.default_rng(1)
    x = np.concatenate([0.05 * np.sin(w * TIME) for w in (1.0, 2.3, 4.0)])
    v = np.concatenate([0.05 * w * np.cos(w * TIME) for w in (1.0, 2.3, 4.0)])
    X = pd.DataFrame({"t": np.tile(TIME, 3), "stroke": factor * x, "speed": factor * v})
    y, groups = -200.0 * v + 0.3 * rng.standard_normal(len(v)), np.repeat([0, 1, 2], len(TIME))
    signals = {"time": "t", "position": "stroke", "velocity": "speed"}
    found = GapDiagnoser(effects=FEW, signals=signals, random_state=0).fit(X, y, groups=groups)
    p = found.causes_[0].parameters["coefficient"]
    assert (p.value, p.unit) == (pytest.approx(200.0 / factor, rel=0.02), "target unit s per position unit")
    assert found.effects_["viscous_friction"]["coefficient"] == p.value
    found.set_params(units={"target": "N", "position": "mm"}).fit(X, y, groups=groups)
    assert found.causes_[0].parameters["coefficient"].unit == "N s/mm"
    with pytest.raises(UnknownOptionError, match="speed"):
        found.set_params(units={"speed": "m/s"}).fit(X, y, groups=groups)


@pytest.mark.parametrize(
    ("name", "parameter", "units", "expected"),
    [
        ("viscous_friction", "coefficient", Units(), "N s"),
        ("viscous_friction", "coefficient", Units("V", "rad", "V"), "V s/rad"),
        ("stribeck_friction", "velocity", Units("N", "m"), "m/s"),
        ("stribeck_friction", "velocity", Units(), "1/s"),
        ("quadratic_drag", "coefficient", Units("N", "m"), "N s^2/m^2"),
        ("coulomb_friction", "presliding", Units("N", "mm"), "mm"),
        ("coulomb_friction", "per_pressure", Units("V", "rad", "V"), "-"),
        ("coulomb_friction", "per_pressure", Units("N", "m", "bar"), "N/bar"),
        ("bladder_elasticity", "cubic", Units("N", "m"), "N/m^3"),
        ("back_emf", "constant", Units("V", "rad", "V"), "V s/rad"),
        ("joint_damping", "difference", Units("N m", "rad"), "N m s/rad"),
        ("gravity", "moment", Units("A", "rad"), "A"),
        ("overflow", "coefficient", Units("cm/s", "-", "cm"), "(cm/s)/cm"),
        ("leakage", "conductance", Units("kg/s"), "m^3/(s Pa)"),
    ],
)  # fmt: skip
def test_units_follow_from_dimensions(name, parameter, units, expected):
    effect = all_effects()[name]
    [p] = [p for p in effect.parameters if p.name == parameter]
    assert units.of(effect, p) == expected


def test_powers_of_a_unit():
    assert powers_of("m^3/(s Pa)") == {"m^3": 1, "s": -1, "Pa": -1}
    assert powers_of("N m s/rad") == {"N": 1, "m": 1, "s": 1, "rad": -1}
    assert powers_of("-") == {}


@pytest.mark.parametrize("name", [n for n, c in all_effects().items() if "force" in c.hooks() or "torque" in c.hooks()])
def test_a_parameter_changes_with_the_units_as_its_dimension_says(name):
    """What an effect adds is the same in millimetres and minutes, with its parameters as its placement has them."""
    cls = all_effects()[name]
    # The position of a muscle is its contraction ratio, whatever the units of a log.
    reach = 1.0 if set(cls.kinds) <= {"muscle"} else 40.0
    position = 8.0 + 6.0 * np.sin(0.2 * np.arange(300.0))
    pressure = 4.0e4 + 2.0e4 * np.cos(0.3 * np.arange(300.0))
    log = Signals(position=position, velocity=np.gradient(position, 0.5), pressure=pressure, force=pressure / 1e4)
    table = {role: getattr(log, role) for role in ("position", "velocity", "pressure", "force")}
    scales = Scales(position=reach, time=1 / 60, pressure=3.0, target=5.0)
    place = OnEquation(table, lambda t: t["position"], 0.5, np.array([0]), "torque").placements(scales)[name]

    class Bare:
        atmospheric_pressure = 0.0

    effect, inner = make_effect(name), place.signals(table)
    other = cls()
    for word, value in place.outward(effect.values).items():
        setattr(other, word, value)
    start, hook = np.array([0]), "torque" if "torque" in cls.hooks() else "force"
    try:
        want = getattr(effect, hook)(inner, effect.trace(inner, Bare, 0.5 / 60, start), Bare)
    except AttributeError:
        pytest.skip("it reads the numbers of a muscle, which are in SI")
    have = getattr(other, hook)(log, other.trace(log, Bare, 0.5, start), Bare)
    np.testing.assert_allclose(have, 5.0 * want, rtol=1e-9, atol=1e-9)
