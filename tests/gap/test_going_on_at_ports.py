"""Effects that have another form at a port than on the bench: diagnose, design the next run, go on with its log."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.bench import BenchParameters
from pamid.cli import main
from pamid.effects import all_effects
from pamid.gap.several.history import _bare, fingerprint
from pamid.gap.several.per_log import main_parameter
from pamid.simulators.catalogue import OF_PORTS, effect_class

TANKS = """kind = "equations"
[equations]
"dh1/dt" = "(kp*u - a1*h1)/A"
"dh2/dt" = "(a1*h1 - a2*h2)/A"
[ports]
u = { kind = "input", unit = "V" }
h1 = { kind = "state", unit = "m" }
h2 = { kind = "state", unit = "m" }
[parameters]
kp = { value = 0.02, tolerance = 0.02, unit = "m2/s/V" }
a1 = { value = 0.3, tolerance = 0.02, unit = "m/s" }
a2 = { value = 0.2, tolerance = 0.02, unit = "m/s" }
A = { value = 1.0, unit = "m" }
"""
CART = """kind = "equations"
[equations]
"dx/dt" = "v"
"dv/dt" = "(F - 3.0*v - k*x)/2.0"
[ports]
F = { kind = "input", unit = "N" }
x = { kind = "state", unit = "m" }
v = { kind = "state", unit = "m/s" }
[parameters]
k = { value = 15.0, tolerance = 0.05, unit = "N/m" }
"""


def ran(rate, u: np.ndarray, dt: float, noise: tuple[float, float], rng) -> np.ndarray:
    """Run two states under an input that is held over each step, and read them with noise."""
    x, rows = np.zeros(2), []
    for now in u:
        rows.append(x)
        for _ in range(10):
            x = x + 0.1 * dt * np.array(rate(x + 0.05 * dt * np.array(rate(x, now)), now))
    return np.array(rows) + noise * rng.standard_normal((len(u), 2))


def waves(seed: int, t: np.ndarray, rates: tuple[float, float]) -> np.ndarray:
    rng = np.random.default_rng([seed, 7])
    return np.sin(rng.uniform(*rates, 5) * t[:, None] + rng.uniform(0.0, 6.0, 5)).mean(axis=1)


def tanks(seed: int, leak: float = 0.0, over: float = 0.0) -> pd.DataFrame:
    """Two tanks: the first one leaks, or overflows above 0.1 m."""
    rng, t, runs = np.random.default_rng(seed), np.arange(0.0, 120.0, 0.2), []

    def rate(h, u):
        lost = leak * h[0] + over * max(h[0] - 0.1, 0.0)
        return 0.02 * u - 0.3 * h[0] - lost, 0.3 * h[0] - 0.2 * h[1]

    for k in range(2):
        u = 2.0 + 3.0 * waves(10 * seed + k, t, (0.05, 0.6))
        h = ran(rate, u, 0.2, (2e-4, 2e-4), rng)
        runs.append(pd.DataFrame({"trajectory": f"{k}", "time": t, "u": u, "h1": h[:, 0], "h2": h[:, 1]}))
    return pd.concat(runs, ignore_index=True)


def leaking(seed: int) -> pd.DataFrame:
    return tanks(seed, leak=0.1)


def overflowing(seed: int) -> pd.DataFrame:
    return tanks(seed, over=0.5)


def ending(seed: int) -> pd.DataFrame:
    """A cart whose sensor ends on one side."""
    rng, t, runs = np.random.default_rng(seed), np.arange(0.0, 10.0, 0.02), []
    for k in range(2):
        F = 8.0 * waves(10 * seed + k, t, (0.8, 6.0))
        x, v = ran(lambda x, u: (x[1], (u - 3.0 * x[1] - 15.0 * x[0]) / 2.0), F, 0.02, (4e-4, 3e-3), rng).T
        runs.append(pd.DataFrame({"trajectory": f"{k}", "time": t, "F": F, "x": np.minimum(x, 0.12), "v": v}))
    return pd.concat(runs, ignore_index=True)


CASES = {
    "leakage": (TANKS, leaking, "h1", "leakage,actuator_gain,overflow"),
    "overflow": (TANKS, overflowing, "h1", "leakage,actuator_gain,overflow"),
    "sensor_saturation": (CART, ending, "x", "coulomb_friction,sensor_gain,sensor_saturation"),
}


@pytest.mark.parametrize("effect", CASES)
def test_a_cause_of_another_form_at_ports_is_designed_for_and_gone_on_with(effect: str, tmp_path: Path) -> None:
    page, log, where, library = CASES[effect]
    (tmp_path / "sim.toml").write_text(page)
    for seed, name in ((1, "monday"), (2, "friday")):
        log(seed).to_csv(tmp_path / f"{name}.csv", index=False)
    first, second = tmp_path / "first", tmp_path / "second"
    asked = ["--sim", str(tmp_path / "sim.toml"), "--effects", library, "--out", str(first), "--quiet"]
    assert main(["diagnose", str(tmp_path / "monday.csv"), *asked]) == 0
    said = json.loads((first / "diagnosis.json").read_text())
    assert [(c["effects"], c["where"]) for c in said["causes"]] == [([effect], [where])]
    assert main(["next", str(first), "--designs", "8", "--quiet"]) == 0
    assert (first / "next" / "plan.json").is_file()
    on = ["diagnose", str(tmp_path / "friday.csv"), "--since", str(first), "--out", str(second), "--quiet"]
    assert main(on) == 0
    said = json.loads((second / "diagnosis.json").read_text())
    assert [c["effects"] for c in said["causes"]] == [[effect]] and len(said["rounds"]) == 2


def test_words_about_an_effect_do_not_make_it_another(monkeypatch) -> None:
    before = fingerprint("coulomb_friction", at_ports=True)
    effect = effect_class("coulomb_friction", at_ports=True)
    described = tuple(replace(p, description="other words") for p in effect.parameters)
    monkeypatch.setattr(effect, "__doc__", "Other words.")
    monkeypatch.setattr(effect, "parameters", described)
    assert fingerprint("coulomb_friction", at_ports=True) == before
    monkeypatch.setattr(effect, "parameters", (replace(described[0], upper=2.0 * described[0].upper), *described[1:]))
    assert fingerprint("coulomb_friction", at_ports=True) != before


def test_code_is_compared_without_its_comments() -> None:
    code = 'def f(x):\n    """Say."""\n    # why\n    y = "a"\n    return x + y\n'
    assert _bare(code) == _bare(code.replace("Say", "Tell").replace("# why", "# how"))
    assert _bare(code) != _bare(code.replace("x + y", "y + x")) and _bare(code) != _bare(code.replace('"a"', '"b"'))


def test_a_name_is_that_of_the_effect_which_acts_there() -> None:
    library = all_effects()
    for name, (_, effect) in OF_PORTS.items():
        for said in (name, f"{name}@h1", f"{name}@h1@from 2"):
            assert effect_class(said, at_ports=True) is effect
        if name in library:
            assert effect_class(name, at_ports=False) is effect_class(f"{name}@from 2", at_ports=False) is library[name]
            assert fingerprint(name, at_ports=True) != fingerprint(name, at_ports=False)
    assert effect_class("creep", at_ports=False) is library["creep"]
    with pytest.raises(KeyError):
        effect_class("spring", at_ports=False)
    assert BenchParameters.for_muscle("B").library


def test_a_share_is_no_size_of_an_effect() -> None:
    play, leak = (effect_class(name, at_ports=True) for name in ("backlash@a-b", "leakage@h1"))
    assert main_parameter(play, {"half_width": 1e-4, "damped": 1.0}) == "half_width"
    assert main_parameter(leak, {"conductance": 1e-12, "exponent": 1.0}) == "conductance"
