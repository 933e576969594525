"""Effects that a user asks for and that have no place here are told, with what to declare."""

import re

import numpy as np
import pandas as pd
import pytest

import pamid
from pamid.errors import ParameterError, UnknownOptionError
from pamid.gap.residuals.untested import untested
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, FunctionSimulator, Port


def log():
    t = np.arange(0, 4, 0.01)
    rng = np.random.default_rng(0)
    runs = [np.sin((2 + k) * t) for k in range(3)]
    return pd.concat(
        [
            pd.DataFrame({"trajectory": f"r{k}", "time": t, "u": u, "w": u + 1e-3 * rng.standard_normal(len(t))})
            for k, u in enumerate(runs)
        ]
    )


def motor(unit="rad/s"):
    ports = [Port("u", "input", "V"), Port("w", "output", unit)]
    return FunctionSimulator(lambda u, p, x0: [u.u + 0.0], ports, {}, form="run")


def test_an_effect_without_a_place_is_told_with_what_to_declare():
    found = untested(evidence_of(log(), motor()), ["actuator_gain", "coulomb_friction", "viscous_friction"])
    assert len(found) == 1
    assert found[0].startswith("Not tested: coulomb_friction, viscous_friction, since no joint is known")
    assert 'kind = "joint"' in found[0]


def test_the_diagnosis_says_it():
    notes = pamid.diagnose(log(), motor(), effects=["actuator_gain", "coulomb_friction"]).notes
    assert any("coulomb_friction, since no joint is known" in note for note in notes)


def test_nothing_is_left_to_test_is_an_error():
    with pytest.raises(UnknownOptionError, match="coulomb_friction, since no joint is known"):
        pamid.diagnose(log(), motor(), effects="coulomb_friction")


def test_by_itself_it_is_told_where_something_moves():
    assert "friction and play are not tested" in untested(evidence_of(log(), motor()), "all")[0]
    assert untested(evidence_of(log(), motor("K")), "all") == []


def test_the_library_less_some_names_is_no_choice_of_each():
    from pamid.simulators import port_effects

    wanted = [name for name in port_effects() if name != "creep"]
    assert untested(evidence_of(log(), motor("K")), wanted) == []


def test_a_joint_that_the_equations_show_needs_no_declaration():
    ports = [Port("u", "input", "V"), Port("w", "state", "rad/s")]
    evidence = evidence_of(log(), EquationSimulator({"dw/dt": "20*u - 20*w"}, ports, {}))
    assert untested(evidence, "all") == []
    assert untested(evidence, ["coulomb_friction"]) == []


@pytest.mark.parametrize("ask", [pamid.diagnose, pamid.evaluate])
@pytest.mark.parametrize(("given", "said"), [("model.xml", "pamid.read_simulator('model.xml')"), (3, "of type int")])
def test_what_is_no_simulator_is_refused_in_words(ask, given, said):
    with pytest.raises(ParameterError, match=re.escape(said)):
        ask(pd.DataFrame({"time": [0.0, 1.0], "x": [0.0, 1.0]}), given)
