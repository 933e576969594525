"""Refits of logs recorded in closed loop: instruments are not biased by what comes back through the controller."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.cli import main
from pamid.errors import IncompatibleError, MissingColumnError, ParameterError
from pamid.gap import Instrumented, refit_with_instruments
from pamid.simulators import EquationSimulator, FunctionSimulator, Port

MASS, VISCOUS, COULOMB = 2.0, 3.0, 1.5
PORTS = [Port("F", "input", "N"), Port("q", "state", "m"), Port("v", "state", "m/s")]
SEEDS = 3


def closed_loop(
    seed: int, disturbance: float = 0.15, seconds: float = 20.0, noise: float = 1e-4, opened: bool = False
) -> pd.DataFrame:
    """A mass with friction under a PD controller that differentiates a noisy reading; a slow force disturbs it."""
    dt, fine = 4e-3, 10
    rng, t = np.random.default_rng(seed), np.arange(0.0, seconds, dt)
    wanted = 0.2 * np.sin(1.7 * t) + 0.08 * np.sin(4.1 * t + 0.4)
    speed = np.gradient(wanted, dt)
    x, v, seen, last, push, rows = wanted[0], speed[0], speed[0], wanted[0], 0.0, []
    for k in range(len(t)):
        read = x + noise * rng.standard_normal()
        seen += 0.2 * ((read - last) / dt - seen)
        last = read
        force = 8.0 * np.sin(2.3 * t[k]) if opened else 400.0 * (wanted[k] - read) + 40.0 * (speed[k] - seen)
        push = 0.98 * push + disturbance * rng.standard_normal()
        rows.append((t[k], wanted[k], read, force))
        for _ in range(fine):
            v += dt / fine * (force + push - VISCOUS * v - COULOMB * np.tanh(v / 0.02)) / MASS
            x += dt / fine * v
    return pd.DataFrame(rows, columns=["time", "wanted", "q", "F"]).assign(trajectory="a")


def axis(tolerance: float = 0.5, **more: float) -> EquationSimulator:
    numbers = {"m": (2.2, tolerance, "kg"), "c": (2.7, tolerance, "N s/m"), "f": (1.6, tolerance, "N")}
    added = {k: (v, tolerance, "-") for k, v in more.items()}
    force = "F*gain" if "gain" in more else "F"
    return EquationSimulator(
        {"dq/dt": "v", "dv/dt": f"({force} - c*v - f*tanh(v/0.02))/m"}, PORTS, {**numbers, **added}
    )


def test_least_squares_are_biased_in_closed_loop_and_instruments_are_not():
    found = [refit_with_instruments(closed_loop(seed), axis(), "wanted").estimates for seed in range(SEEDS)]
    true = {"m": MASS, "c": VISCOUS, "f": COULOMB}
    for name, value in true.items():
        away = np.array([(e[name].value - value) / e[name].error for e in found])
        assert 0.2 < np.sqrt(np.mean(np.square(away))) < 2.0, name
        assert abs(np.mean(away)) < 3.0 / np.sqrt(SEEDS), name
    errors = np.array([e["m"].error for e in found]) / np.sqrt(SEEDS)
    pulled = np.mean([e["m"].least_squares for e in found]) - MASS
    assert pulled > 3.0 * np.mean(errors), "the disturbance returns through the controller, and looks like mass"
    assert all(e["m"].bias > 0.0 for e in found)


def test_sizes_of_the_simulators_own_effects_are_estimated():
    friction = {"amplitude": 1.2, "presliding": 1e-5, "transition": 0.02}
    model = EquationSimulator(
        {"dq/dt": "v", "dv/dt": "(F - c*v)/m"},
        [*PORTS, Port("slide", "joint", "N", position="q", velocity="v", through="F")],
        {"m": (2.2, 0.5, "kg"), "c": (2.7, 0.5, "N s/m")},
        [("coulomb_friction", "slide", friction)],
    )
    found = refit_with_instruments(closed_loop(0, 0.0, 6.0), model, "wanted")
    size = found.estimates["coulomb_friction@slide.amplitude"]
    assert size.value == pytest.approx(COULOMB, abs=0.1)
    assert size.unit == "N"
    assert found.params.effects[0][2]["amplitude"] == size.value
    assert found.estimates["m"].value == pytest.approx(MASS, rel=0.02)


def test_several_runs_of_unequal_length_are_simulated_side_by_side():
    log = closed_loop(1, 0.0, 8.0)
    pieces = pd.concat([log[:1200].assign(trajectory="a"), log[1200:].assign(trajectory="b")])
    one, two = (refit_with_instruments(part, axis(), "wanted").estimates["m"] for part in (log, pieces))
    assert two.value == pytest.approx(one.value, abs=2.0 * two.error)


def test_coupled_joints_have_a_reference_each():
    dt, rng, x, push, rows = 4e-3, np.random.default_rng(0), np.zeros(4), np.zeros(2), []
    t = np.arange(0.0, 10.0, dt)
    wanted = np.stack([0.3 * np.sin(1.7 * t), 0.2 * np.sin(2.9 * t + 1.0)])
    speed = np.gradient(wanted, dt, axis=1)
    x[:2], x[2:] = wanted[:, 0], speed[:, 0]
    for k in range(len(t)):
        read = x[:2] + 1e-4 * rng.standard_normal(2)
        force = 400.0 * (wanted[:, k] - read) + 40.0 * (speed[:, k] - x[2:])
        push = 0.98 * push + 0.1 * rng.standard_normal(2)
        rows.append((t[k], *wanted[:, k], *read, *force))
        for _ in range(10):
            pull = 30.0 * (x[0] - x[1]) * np.array([-1.0, 1.0])
            x = x + 0.1 * dt * np.concatenate([x[2:], (force + push - 3.0 * x[2:] + pull) / [2.0, 1.5]])
    log = pd.DataFrame(rows, columns=["time", "r1", "r2", "q1", "q2", "F1", "F2"]).assign(trajectory="a")
    kinds = {"input": (("F1", "N"), ("F2", "N")), "state": (("q1", "m"), ("q2", "m"), ("v1", "m/s"), ("v2", "m/s"))}
    arm = FunctionSimulator(
        lambda t, x, u, p: [
            x.v1,
            x.v2,
            (u.F1 - p.c * x.v1 - p.k * (x.q1 - x.q2)) / p.m1,
            (u.F2 - p.c * x.v2 + p.k * (x.q1 - x.q2)) / p.m2,
        ],
        [Port(name, kind, unit) for kind, ports in kinds.items() for name, unit in ports],
        {"m1": (2.2, 0.5, "kg"), "m2": (1.4, 0.5, "kg"), "k": (25.0, 0.5, "N/m"), "c": (2.5, 0.5, "N s/m")},
    )
    found = refit_with_instruments(log, arm, ["r1", "r2"]).estimates
    for name, value in {"m1": 2.0, "m2": 1.5, "k": 30.0, "c": 3.0}.items():
        assert abs(found[name].value - value) < 3.0 * found[name].error, name
    assert found["m1"].bias > 2.0


def test_beyond_its_tolerance_is_told():
    assert refit_with_instruments(closed_loop(0, 0.0, 6.0), axis(0.02), "wanted").beyond == ("m", "c", "f")


# --- what cannot be done --------------------------------------------------------------------------------------
def test_a_missing_reference_is_told():
    with pytest.raises(MissingColumnError, match=r"lacks the reference 'target'.*was to follow"):
        refit_with_instruments(closed_loop(0, 0.0, 2.0), axis(), "target")


@pytest.mark.parametrize("name", ["F", "q"])
def test_a_signal_of_the_simulator_is_no_reference(name: str):
    with pytest.raises(ParameterError, match=r"is a signal of the simulator"):
        refit_with_instruments(closed_loop(0, 0.0, 2.0), axis(), name)


def test_an_open_loop_is_told():
    log = closed_loop(0, 0.0, 12.0, opened=True)
    with pytest.raises(IncompatibleError, match=r"No state follows the reference.*recorded under feedback"):
        refit_with_instruments(log, axis(), "wanted")


def test_a_log_without_states_is_told():
    log = closed_loop(0, 0.0, 2.0).rename(columns={"q": "y"})
    shown = [*PORTS, Port("y", "output", "m")]
    model = EquationSimulator(
        {"dq/dt": "v", "dv/dt": "(F - c*v)/m", "y": "q"}, shown, {"m": (2.0, 0.5), "c": (3.0, 0.5)}
    )
    with pytest.raises(IncompatibleError, match=r"lacks q, v"):
        refit_with_instruments(log, model, "wanted")


def test_a_simulator_without_states_is_told():
    static = FunctionSimulator(lambda u, p: u.q * p.k, [Port("q", "input"), Port("F", "output")], {"k": (1.0, 0.5)})
    with pytest.raises(IncompatibleError, match="does not give them"):
        refit_with_instruments(closed_loop(0, 0.0, 2.0), static, "wanted")


def test_what_the_log_does_not_determine_is_told():
    with pytest.raises(IncompatibleError, match=r"does not determine .*gain"):
        refit_with_instruments(closed_loop(0, 0.0, 6.0), axis(gain=1.0), "wanted")


def test_nothing_to_estimate_is_told():
    with pytest.raises(ParameterError, match=r"No parameter of the simulator has a tolerance"):
        refit_with_instruments(closed_loop(0, 0.0, 2.0), axis(0.0), "wanted")


# --- the command ----------------------------------------------------------------------------------------------
PAGE = """
kind = "equations"
[equations]
"dq/dt" = "v"
"dv/dt" = "(F - c*v - f*tanh(v/0.02))/m"
[ports]
F = { kind = "input", unit = "N" }
q = { kind = "state", unit = "m" }
v = { kind = "state", unit = "m/s" }
[parameters]
m = { value = 2.2, tolerance = 0.5, unit = "kg" }
c = { value = 2.7, tolerance = 0.5, unit = "N s/m" }
f = { value = 1.6, tolerance = 0.5, unit = "N" }
"""


def test_the_command_says_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    log, page = str(tmp_path / "log.csv"), tmp_path / "sim.toml"
    closed_loop(0, 0.15, 6.0).to_csv(log, index=False)
    page.write_text(PAGE)
    asked = ["evaluate", log, "--sim", str(page), "--refit", "--instruments", "wanted"]
    assert main(asked) == 0
    said = capsys.readouterr().out
    assert "with instruments: m " in said
    assert "standard errors higher)" in said
    assert main([*asked, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["instruments"]
    assert found["reference"] == ["wanted"]
    mass = found["estimates"]["m"]
    assert mass["bias"] == pytest.approx((mass["least_squares"] - mass["value"]) / mass["error"])
    assert f"with instruments: m {mass['value']:.5g} ± {mass['error']:.2g} kg" in said


def test_instruments_need_a_refit(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["evaluate", "log.csv", "--sim", "sim.toml", "--instruments", "wanted"]) == 2
    assert "--refit" in capsys.readouterr().err


def test_a_number_in_words():
    assert (
        Instrumented(95.1, 0.5, 96.1, "kg").sentence("M").endswith("(least squares: 96.1, 2.0 standard errors higher)")
    )
    assert Instrumented(1.0, 0.1, 1.0).sentence("k").startswith("with instruments: k 1 ± 0.1 (")
