"""What a log of one run says of a drive: sizes with intervals over its pieces, also as forces."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.report import answers
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.forces import force_per_input
from pamid.simulators.structure import JointPort

MASS, GAIN, VISCOUS, DRY, STEP = 95.0, 35.0, 200.0, 20.0, 2e-3


def slide() -> pd.DataFrame:
    """One run of a slide on a screw, which its motor drives to and fro against viscous and dry friction."""
    rng, n, fine = np.random.default_rng(1), 5000, 10
    t = np.arange(n) * STEP
    volts = 2.5 * np.sin(2.0 * t) + 1.5 * np.sin(5.3 * t) + 1.0 * np.sin(0.9 * t + 1.0)
    q, v, path = 0.0, 0.0, np.empty(n)
    for k in range(n):
        path[k] = q
        for _ in range(fine):
            force = GAIN * volts[k] - VISCOUS * v
            moved = v + STEP / fine * (force - DRY * np.sign(v or force)) / MASS
            v = 0.0 if v * moved < 0.0 or (v == 0.0 and abs(force) < DRY) else moved
            q += STEP / fine * v
    return pd.DataFrame({"time": t, "U": volts, "q": path + 1e-6 * rng.standard_normal(n)})


def frictionless(**numbers: object) -> FunctionSimulator:
    ports = [Port("U", "input", "V"), Port("q", "state", "m"), Port("v", "state", "m/s")]
    known = {"M": (MASS, 0.03, "kg"), "k": (GAIN, 0.0, "N/V")} | numbers
    return FunctionSimulator(lambda t, x, u, p: [x.v, p.k * u.U / p.M], ports, known)


@pytest.fixture(scope="module")
def found():
    library = ["viscous_friction", "coulomb_friction", "quadratic_drag", "actuator_gain"]
    return diagnose_simulator(slide(), frictionless(), library)


def test_sizes_of_one_run_have_intervals_over_its_pieces(found):
    sizes = {c.effects[0]: next(iter(c.parameters.values())) for c in found.causes}
    assert set(sizes) == {"viscous_friction", "coulomb_friction"}
    for name, size, unit in (("viscous_friction", VISCOUS, "V s/m"), ("coulomb_friction", DRY, "V")):
        assert sizes[name].value * GAIN == pytest.approx(size, rel=0.1)
        assert sizes[name].unit == unit
        low, high = sizes[name].ci90
        assert 0.7 * size < low * GAIN < sizes[name].value * GAIN < high * GAIN < 1.4 * size
    assert found.closure[0].ci90[0] > 0.9


def test_sentences_say_sizes_of_several_causes_and_what_was_not_seen(found):
    told = answers(found)
    assert [line.partition(" ")[0] for line in told.which.splitlines()] == ["Viscous", "Coulomb", "Confidence"]
    assert "V s/m (" in told.which and " N s/m: " in told.which  # in the unit of the input, and as a force
    assert "on unseen pieces of the log" in told.how_far


def test_a_mass_among_the_numbers_says_newtons(found):
    [note] = [n for n in found.notes if n.startswith("With M, 1 V at U acts like 35 N at q: ")]
    wanted = {"viscous friction coefficient": (VISCOUS, "N s/m"), "coulomb friction amplitude": (DRY, "N")}
    for word, (size, unit) in wanted.items():
        assert float(note.split(f"{word} ")[1].split(f" {unit}")[0]) == pytest.approx(size, rel=0.1)


def test_a_number_in_kilograms_that_is_not_the_mass_says_nothing():
    t, x, u = np.linspace(0, 1, 50), np.zeros((2, 50)), np.ones((1, 50))
    joint = JointPort("q", "q", "v", "U", "V")
    found = force_per_input(frictionless(), joint, t, x, u)
    assert (found.unit, found.mass) == ("N", "M")
    assert found.factor == pytest.approx(GAIN)
    assert force_per_input(frictionless(M=(MASS, 0.03, "t")), joint, t, x, u) is None
    load = frictionless(load=(3.0, 0.0, "kg"), M=(MASS, 0.0, "-"))
    assert force_per_input(load, joint, t, x, u) is None
