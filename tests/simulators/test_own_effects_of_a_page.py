"""A page's own effects act as it says, on whatever log, or are refused with the ports that there are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.cli import main
from pamid.effects import Effect, Parameter
from pamid.effects.plant import Surroundings
from pamid.errors import (
    EffectError,
    ExcitationWarning,
    ImplausibleParameterError,
    LackingNumberError,
    MissingColumnError,
    UnitWarning,
    UnknownOptionError,
)
from pamid.gap import evaluate_simulator
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port, port_effects, read_simulator
from pamid.simulators.catalogue import chosen
from pamid.simulators.port_log import port_log


def cart(*effects: tuple[str, str, dict[str, float]]) -> FunctionSimulator:
    ports = [Port("u", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]
    made = FunctionSimulator(lambda t, x, u, p: [x.v, u.u / 2.0], ports, {})
    return made.with_({}, list(effects))


def log(size: float) -> pd.DataFrame:
    """Return a cart that is pushed as by a drive with a dead zone of 0.3 N."""
    t = np.arange(0.0, 8.0, 0.01)
    u = size * (np.sin(1.3 * t) + 0.5 * np.sin(3.1 * t))
    force = np.sign(u) * np.maximum(np.abs(u) - 0.3, 0.0)
    v = np.concatenate([[0.0], np.cumsum(0.005 * force[:-1])])
    x = np.concatenate([[0.0], np.cumsum(0.005 * (v[1:] + v[:-1]))])
    return pd.DataFrame({"trajectory": "0", "time": t, "u": u, "x": x, "v": v})


@pytest.mark.parametrize("size", [2.0, 0.6, 0.3])
def test_a_width_is_what_the_page_says_on_small_logs_too(size: float) -> None:
    evidence = evidence_of(log(size), cart(("actuator_dead_zone", "u", {"width": 0.3})))
    [(place, made)] = evidence.active({})
    assert place.outward(made.values)["width"] == pytest.approx(0.3)
    drive = place.drive(made, np.array([0.2, -0.25, 0.5, -0.7]), 0.01, np.array([0]))
    assert drive == pytest.approx([0.0, 0.0, 0.2, -0.4])


def test_a_wrong_sign_is_refused() -> None:
    with pytest.raises(ImplausibleParameterError, match=r"actuator_dead_zone at u is -0\.3 N"):
        evidence_of(log(2.0), cart(("actuator_dead_zone", "u", {"width": -0.3})))


def test_an_unknown_port_is_refused_with_those_that_the_effect_can_have() -> None:
    with pytest.raises(UnknownOptionError, match="'w', which is no port") as error:
        evidence_of(log(2.0), cart(("viscous_friction", "w", {"coefficient": 1.0})))
    assert "one of x" in str(error.value)


def test_what_is_positive_is_not_zero_and_has_a_finite_square() -> None:
    with pytest.raises(ImplausibleParameterError, match=r"is 0 s\. Expected more than 0 s"):
        evidence_of(log(2.0), cart(("actuator_lag", "u", {"time_constant": 0.0})))
    with pytest.raises(ImplausibleParameterError, match=r"is 1e\+300 s"):
        evidence_of(log(2.0), cart(("actuator_delay", "u", {"delay": 1e300})))


def test_a_delay_longer_than_every_run_is_told() -> None:
    with pytest.warns(UnitWarning, match="actuator_delay at u delays by 1000 s, but the longest run of the log has"):
        evidence_of(log(2.0), cart(("actuator_delay", "u", {"delay": 1000.0})))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(
    ("effect", "at", "name"),
    [("actuator_dead_zone", "u", "width"), ("viscous_friction", "x", "coefficient"), ("sensor_bias", "x", "offset")],
)  # fmt: skip
def test_what_is_no_finite_number_is_refused(effect: str, at: str, name: str, value: float) -> None:
    with pytest.raises(ImplausibleParameterError, match=f"{name} of the effect {effect} at {at} is {value:g}"):
        evidence_of(log(2.0), cart((effect, at, {name: value})))


PAGE = """kind = "equations"
[equations]
"dx/dt" = "v"
"dv/dt" = "(u - c*v)/m"
[ports]
u = {{ kind = "input", unit = "N" }}
x = {{ kind = "state", unit = "m" }}
v = {{ kind = "state", unit = "m/s" }}
rail = {{ kind = "joint", unit = "N", position = "x", velocity = "v", through = "u" }}
[parameters]
m = {{ value = 2.0, unit = "kg" }}
c = {{ value = 0.0, unit = "N s/m" }}
[[effects]]
effect = "{}"
at = "{}"
"""


@pytest.mark.parametrize(
    ("effect", "at", "expected"),
    [("coulomb_friction", "u", "one of x, v, rail"), ("sensor_bias", "u", "one of x, v"),
     ("actuator_gain", "x", "one of u"), ("viscous_friction", "m", "one of x, v, rail"),
     ("parameter_deviation", "rail", "one of m, c"), ("leakage", "rail", "one of x, v")],
)  # fmt: skip
def test_an_effect_at_a_port_of_another_kind_is_refused(effect: str, at: str, expected: str, tmp_path: Path) -> None:
    page = tmp_path / "sim.toml"
    page.write_text(PAGE.format(effect, at), encoding="utf-8")
    with pytest.raises(UnknownOptionError, match=f"is at '{at}', a port of the kind") as error:
        read_simulator(page)
    assert expected in str(error.value)


def test_an_effect_that_a_log_leaves_without_motion_is_told(tmp_path: Path) -> None:
    page = tmp_path / "sim.toml"
    page.write_text(PAGE.format("actuator_dead_zone", "u") + "width = 0.1\n", encoding="utf-8")
    with pytest.warns(ExcitationWarning, match="actuator_dead_zone at u cannot act on this log"):
        evaluate_simulator(log(2.0).assign(u=0.0), read_simulator(page))


def test_a_friction_by_direction_acts_where_no_pressure_is_logged(tmp_path: Path) -> None:
    """It adds to the push by half the sum of both, and shifts it by half their difference."""
    page = tmp_path / "sim.toml"
    page.write_text(PAGE.format("directional_friction", "rail") + "forward = 0.4\nbackward = 0.2\n", encoding="utf-8")
    evidence = evidence_of(log(2.0), read_simulator(page))
    [(place, made)] = evidence.active({})
    still = place.signals({"x": np.zeros(2), "v": np.zeros(2)})
    assert place.force(made, still, np.array([[1.0, -1.0]])) == pytest.approx([-0.4, 0.2])


def test_a_friction_by_direction_is_not_sought_beside_an_offset_and_coulomb_friction() -> None:
    """It is the sum of both."""
    found = evidence_of(log(2.0), cart()).placements
    keys = chosen(found, "all")
    assert "coulomb_friction@x" in keys and not any(k.startswith(("directional_friction", "torque_loss")) for k in keys)
    assert chosen(found, ["directional_friction", "coulomb_friction"]) == [
        "directional_friction@x", "coulomb_friction@x",
    ]  # fmt: skip


def test_a_mistake_in_the_code_of_an_effect_is_told_with_its_line() -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Effect, "registry", dict(Effect.registry))

        class Misspelt(Effect):
            """An effect that reads a signal which it does not have."""

            name, family, equations, roles, kinds = "misspelt", "friction", ("force",), ("velocity",), ("joint",)
            source, parameters = "-", (Parameter("size", "N", 0.0, 10.0, 1.0, "its size", linear=True),)
            size: float

            def force(self, s, x, plant):
                return -self.size * np.sign(s.speed)

        with pytest.raises(EffectError, match=r"misspelt has failed with AttributeError.*speed.*page.py, line \d+"):
            evidence_of(log(1.0), cart())


def test_an_effect_that_needs_a_bench_is_none_of_a_port() -> None:
    assert "thread_extensibility" not in port_effects()
    with pytest.raises(LackingNumberError, match="'thread_length', which only a bench has"):
        _ = Surroundings().thread_length


@pytest.mark.parametrize("stands", [0.0, 1.5])
def test_an_input_without_a_column_stands_where_its_port_says(stands: float) -> None:
    ports = [Port("u", "input", "N"), Port("wind", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]
    blown = FunctionSimulator(lambda t, x, u, p: [x.v, (u.u + u.wind) / 2.0], ports, {})
    with pytest.raises(MissingColumnError, match=r"lacks wind.*start = VALUE"):
        evidence_of(log(1.0), blown)
    still = FunctionSimulator(blown.function, [replace(p, start=stands) if p.name == "wind" else p for p in ports], {})
    assert np.all(port_log(log(1.0), still).inputs(still)[1] == stands)


@pytest.mark.parametrize(
    ("effect", "at", "values", "found", "expected"),
    [
        ("actuator_dead_zone", "lift", "width = -1", "is -1 kN.", "at least 0 kN"),
        ("actuator_dead_zone", "lift", "skew = 3", "is 3.", "-0.9 to 0.9 ("),
        ("actuator_asymmetry", "lift", "asymmetry = -2", "is -2.", "-0.9 to 0.9 ("),
        ("actuator_delay", "lift", "delay = -1", "is -1 s.", " s ("),
        ("actuator_lag", "lift", "time_constant = -1", "is -1 s.", " s ("),
        ("sensor_lag", "z", "time_constant = -1", "is -1 s.", " s ("),
        ("viscous_friction", "z", "coefficient = -1", "is -1 ", "at least 0 "),
    ],
)
def test_a_value_out_of_bounds_is_told_in_the_words_and_units_of_the_port(
    tmp_path, capsys, effect, at, values, found, expected
):
    t = np.arange(0, 4, 0.02)
    table = {"time": t, "lift": np.sin(3 * t), "z": -np.sin(3 * t) / 9, "w": -np.cos(3 * t) / 3}
    pd.DataFrame(table).to_csv(tmp_path / "log.csv", index=False)
    (tmp_path / "sim.toml").write_text(
        'kind = "equations"\n[equations]\n"dz/dt" = "w"\n"dw/dt" = "lift"\n[ports]\n'
        'lift = { kind = "input", unit = "kN" }\nz = { kind = "state", unit = "mm" }\n'
        'w = { kind = "state", unit = "mm/s" }\n'
        f'[[effects]]\neffect = "{effect}"\nat = "{at}"\n{values}\n'
    )
    assert main(["evaluate", str(tmp_path / "log.csv"), "--sim", str(tmp_path / "sim.toml")]) == 2
    told = capsys.readouterr().err
    assert f"of the effect {effect} at {at} {found}" in told and expected in told
    assert "units are those of the ports" in told
    for word in ("valve", "vent", "inlet", "spool", "amplifier", "contraction", "inf", "SI"):
        assert word not in told.partition("See docs")[0], word


def test_creep_at_a_joint_has_no_start_in_a_muscle_and_takes_it_from_an_older_page(tmp_path):
    """`settled` counts from a muscle's neutral contraction: elsewhere it acts on nothing, and no fit may give it."""
    t = np.arange(0, 4, 0.02)
    log = pd.DataFrame({"time": t, "lift": np.sin(3 * t), "z": -np.sin(3 * t) / 9, "w": -np.cos(3 * t) / 3})
    page = (
        'kind = "equations"\n[equations]\n"dz/dt" = "w"\n"dw/dt" = "lift"\n[ports]\n'
        'lift = { kind = "input" }\nz = { kind = "state" }\nw = { kind = "state" }\n'
        '[[effects]]\neffect = "creep"\nat = "z"\nstiffness = 2.0\ntime_constant = 0.5\n'
    )
    errors = []
    for more in ("", "settled = 0.0\n"):
        (tmp_path / "sim.toml").write_text(page + more)
        simulator = read_simulator(tmp_path / "sim.toml")
        errors.append([e.rmse for e in evaluate_simulator(log, simulator).values()])
    assert errors[0] == errors[1]
    [creep] = [p for key, p in evidence_of(log, simulator).placements.items() if key == "creep@z"]
    assert [p.name for p in creep.effect.parameters][-2:] == ["slow_time_constant", "unknown"]
