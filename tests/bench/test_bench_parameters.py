"""The simulator file: round trip, presets, and one clear error for each kind of broken file."""

from __future__ import annotations

import math
import pickle
import tomllib

import pytest

from pamid.bench import BenchParameters, JointParameters
from pamid.errors import (
    ImplausibleParameterError,
    MissingParameterError,
    OutputError,
    OversizedSimulatorError,
    PamidError,
    SimulatorFileError,
    SimulatorNotFoundError,
    SimulatorSyntaxError,
    SimulatorTypeError,
    UnknownOptionError,
    UnknownParameterError,
)
from pamid.toml_files import MAX_BYTES

B = BenchParameters.for_muscle("B")


@pytest.fixture
def text(tmp_path):
    path = tmp_path / "good.toml"
    B.to_toml(path)
    return path.read_text()


def test_presets_are_the_muscles_of_the_study():
    sizes = {m: BenchParameters.for_muscle(m).muscle for m in "ABC"}
    assert [(m.rest_length, m.rest_diameter) for m in sizes.values()] == [(0.2, 0.01), (0.2, 0.02), (0.45, 0.02)]
    volume = {k: math.pi / 4 * m.rest_diameter**2 * m.rest_length for k, m in sizes.items()}
    assert volume["B"] / volume["A"] == pytest.approx(4) and volume["C"] / volume["A"] == pytest.approx(9)


def test_derived_geometry():
    m = B.muscle
    assert m.thread_length == pytest.approx(0.2 / math.cos(math.radians(25)))
    assert m.turns == pytest.approx(m.thread_length * math.sin(math.radians(25)) / (math.pi * 0.02))
    # at rest the cylinder has its drawn diameter
    assert B.plant().volume(0.0) == pytest.approx(math.pi / 4 * 0.02**2 * 0.2)
    assert B.plant().volume_slope(m.max_contraction) == pytest.approx(0, abs=1e-12)


def test_round_trip_with_effects_and_odd_names(tmp_path):
    effects = (("hysteresis", {"amplitude": 5.0, "displacement": 0.02, "shape": 0.7}), ("leakage", {}))
    params = B.replace(effects=effects, name='B "quoted" \\ ü', inertia=0.0213, tolerance={"inertia": 0.05})
    path = tmp_path / "sim.toml"
    params.to_toml(path)
    assert BenchParameters.from_toml(path) == params
    raw = tomllib.loads(path.read_text())
    assert raw["effects"][1] == {"name": "leakage", "conductance": 1e-10}
    assert "# kg m^2" in path.read_text()
    assert not list(tmp_path.glob("*.tmp")) and not list(tmp_path.glob(".*"))
    assert pickle.loads(pickle.dumps(params)) == params


def test_tolerance_and_effects_may_be_left_out(tmp_path, text):
    path = tmp_path / "bare.toml"
    path.write_text(text[: text.index("[tolerance]")])
    assert BenchParameters.from_toml(path).tolerance == {} and BenchParameters.from_toml(path).effects == ()


def test_replace_get_values():
    assert B.replace(inertia=0.03).get("inertia") == 0.03
    assert B.replace(joint=JointParameters(0.05, 0.1, 0.0), inertia=0.2).joint == JointParameters(0.05, 0.2, 0.0)
    assert set(B.tolerance) <= set(B.values())
    for call in (lambda: B.replace(mass=1.0), lambda: B.get("mass")):
        with pytest.raises(UnknownParameterError, match="inertia"):
            call()
    with pytest.raises(UnknownOptionError):
        BenchParameters.for_muscle("D")


def test_adjusting_effects_change_parameters_and_the_others_stay():
    params = B.replace(effects=[("diameter", {"deviation": 0.1}), ("leakage", {}), ("inertia", {"deviation": 0.5})])
    done = params.adjusted()
    assert done.muscle.rest_diameter == pytest.approx(0.022) and done.joint.inertia == pytest.approx(0.03)
    assert [name for name, _ in done.effects] == ["leakage"]


BROKEN = {
    "no TOML": (lambda t: t + "\n[muscle", SimulatorSyntaxError, "TOML"),
    "a table twice": (lambda t: t + "\n[muscle]\n", SimulatorSyntaxError, "TOML"),
    "empty": (lambda t: "", MissingParameterError, "muscle, gas, valve, joint"),
    "no table": (lambda t: t.replace("[valve]", ""), (UnknownParameterError, MissingParameterError), ""),
    "another table": (lambda t: t + "\n[motor]\nx = 1\n", UnknownParameterError, "motor"),
    "no parameter": (lambda t: t.replace("rest_length", "# rest_length"), MissingParameterError, "rest_length"),
    "misspelt": (lambda t: t.replace("inertia = 0.02 ", "inertai = 0.02 "), UnknownParameterError, "inertai"),
    "text for a number": (lambda t: t.replace("= 0.2 ", '= "0.2" '), SimulatorTypeError, "rest_length"),
    "truth for a number": (lambda t: t.replace("= 0.2 ", "= true "), SimulatorTypeError, "rest_length"),
    "a number for text": (lambda t: t.replace('"B"', "7"), SimulatorTypeError, "name"),
    "an empty name": (lambda t: t.replace('"B"', '""'), ImplausibleParameterError, "name"),
    "a number for a table": (lambda t: "gas = 3\n" + t.replace("[gas]", "[gaz]"), SimulatorFileError, ""),
    "angle in degrees": (lambda t: t.replace("= 0.436", "= 25.436"), ImplausibleParameterError, "rad"),
    "length in mm": (lambda t: t.replace("rest_length = 0.2", "rest_length = 200.0"), ImplausibleParameterError, "mm"),
    "diameter in mm": (lambda t: t.replace("diameter = 0.02", "diameter = 20.0"), ImplausibleParameterError, "mm"),
    "pressure in bar": (lambda t: t.replace("700000.0", "7.0"), ImplausibleParameterError, "Pa"),
    "ambient in kPa": (lambda t: t.replace("101325.0", "101.325"), ImplausibleParameterError, "Pa"),
    "supply below ambient": (lambda t: t.replace("700000.0", "90000.0"), ImplausibleParameterError, "above ambient"),
    "temperature in °C": (lambda t: t.replace("293.0", "20.0"), ImplausibleParameterError, "K"),
    "gas constant in kJ": (lambda t: t.replace("287.0", "0.287"), ImplausibleParameterError, "287"),
    "contraction in %": (lambda t: t.replace("0.12", "12.0"), ImplausibleParameterError, "0.12"),
    "conductance in dm³": (lambda t: t.replace("6e-09", "0.6"), ImplausibleParameterError, "dm³"),
    "critical ratio 1": (lambda t: t.replace("0.35", "1.0"), ImplausibleParameterError, "critical"),
    "negative inertia": (lambda t: t.replace("inertia = 0.02 ", "inertia = -1.0 "), ImplausibleParameterError, "-1"),
    "NaN": (lambda t: t.replace("inertia = 0.02 ", "inertia = nan "), ImplausibleParameterError, "nan"),
    "infinite": (lambda t: t.replace("inertia = 0.02 ", "inertia = inf "), ImplausibleParameterError, "inf"),
    "wider than long": (lambda t: t.replace("length = 0.2", "length = 0.015"), ImplausibleParameterError, "longer"),
    "beyond its contraction": (lambda t: t.replace("0.12", "0.38"), ImplausibleParameterError, "no longer pulls"),
    "tolerance in %": (lambda t: t.replace("= 0.005", "= 5.0"), ImplausibleParameterError, "relative"),
    "unknown tolerance": (lambda t: t + "\nfriction = 0.1\n", UnknownParameterError, "friction"),
    "unknown effect": (lambda t: t + '\n[[effects]]\nname = "coulomb"\n', UnknownParameterError, "coulomb_friction"),
    "nameless effect": (lambda t: t + "\n[[effects]]\namplitude = 1.0\n", MissingParameterError, "name"),
    "effect parameter unknown": (
        lambda t: t + '\n[[effects]]\nname = "leakage"\nrate = 1.0\n', UnknownParameterError, "conductance"),
    "effect parameter out of range": (
        lambda t: t + '\n[[effects]]\nname = "leakage"\nconductance = -1e-10\n', ImplausibleParameterError, "leakage"),
    "effect parameter text": (
        lambda t: t + '\n[[effects]]\nname = "leakage"\nconductance = "much"\n', SimulatorTypeError, "conductance"),
    "effects as a number": (lambda t: "effects = 3\n" + t, SimulatorTypeError, "effects"),
    "deeply nested": (lambda t: "x = " + "[" * 50_000, SimulatorSyntaxError, "TOML"),
    "too large": (lambda t: t + "#" * MAX_BYTES, OversizedSimulatorError, "bytes"),
}  # fmt: skip


@pytest.mark.parametrize("kind", BROKEN)
def test_broken_files(kind, tmp_path, text):
    change, error, says = BROKEN[kind]
    broken = change(text)
    assert broken != text
    path = tmp_path / "sim.toml"
    path.write_text(broken)
    with pytest.raises(error) as caught:
        BenchParameters.from_toml(path)
    assert says in str(caught.value) and "sim.toml" in str(caught.value)
    assert caught.value.found and caught.value.expected and caught.value.remedy


def test_files_that_are_none(tmp_path):
    with pytest.raises(SimulatorNotFoundError):
        BenchParameters.from_toml(tmp_path / "none.toml")
    with pytest.raises(SimulatorFileError):
        BenchParameters.from_toml(tmp_path)
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe\x00binary")
    with pytest.raises(SimulatorSyntaxError, match="UTF-8"):
        BenchParameters.from_toml(tmp_path / "bytes.toml")


def test_a_failed_write_leaves_what_was_there(tmp_path, monkeypatch):
    path = tmp_path / "sim.toml"
    B.to_toml(path)
    before = path.read_text()

    def fail(*args):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", fail)
    with pytest.raises(OutputError, match="No space"):
        B.replace(inertia=0.5).to_toml(path)
    assert path.read_text() == before and [p.name for p in tmp_path.iterdir()] == ["sim.toml"]
    with pytest.raises(OutputError):
        B.to_toml(tmp_path / "no" / "folder" / "sim.toml")


def test_every_simulator_error_is_a_value_error_of_pamid():
    assert issubclass(SimulatorFileError, PamidError) and issubclass(SimulatorFileError, ValueError)
