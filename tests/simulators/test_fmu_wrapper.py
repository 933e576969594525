"""A corrected FMU comes back as an FMU: the original inside, its inputs and outputs with what was found."""

import gc
import zipfile

import numpy as np
import pandas as pd
import pytest

pytest.importorskip("fmpy")

from pamid.cli import main
from pamid.cli.commands.diagnose import write
from pamid.errors import ExportError, SimulatorRunError, UntrustedCodeError
from pamid.export.fmu import compiled, packed
from pamid.export.ode_fmu import ode_fmu
from pamid.gap import diagnose_simulator
from pamid.report.sections import Source
from pamid.simulators import FmuSimulator, ModelParameter, Port
from pamid.simulators.fmu_model import _distinct
from pamid.simulators.fmu_wrapper import wrapped

DT, SAMPLES = 0.02, 200
T = DT * np.arange(SAMPLES)
U = 4 * np.sin(T) + 3 * np.sin(2.3 * T)


@pytest.fixture(scope="module")
def motor(tmp_path_factory):
    """A motor of FMI 2.0 whose load nothing drives."""

    def rates(t, x, u, p):
        return [x.speed, (p.k * u.voltage + u.load) / p.J]

    shown = {"angle": "rad", "omega": "rad/s"}
    fmu = ode_fmu(
        "motor", rates, {"position": 0.0, "speed": 0.0}, {"voltage": 0.0, "load": 0.0}, {"k": 0.05, "J": 2e-3},
        lambda t, x, u, p: {"angle": x.position, "omega": x.speed},
        units={"voltage": "V", "load": "N m", "k": "N m/V", "J": "kg m^2", **shown},
    )  # fmt: skip
    path = tmp_path_factory.mktemp("fmu") / "motor.fmu"
    path.write_bytes(fmu)
    return path


def simulator(path, effects=()):
    shaft = Port("shaft", "joint", "N m", position="angle", velocity="omega", through="load")
    return FmuSimulator(path, [shaft], {"J": 1.8e-3}, effects, trust=True)


def run(fmu, inertia=None):
    """Return the readings of a run; parameters as they are in the FMU unless said."""
    plain = FmuSimulator(fmu, (), {} if inertia is None else {"J": inertia}, trust=True)
    u = np.stack([U, np.zeros(SAMPLES)])
    return plain.run(T, u, plain.numbers, np.zeros(0))


def truth(friction, gain, dead):
    """The same motor with friction and a faulty amplifier, in a code of its own, without steps of an FMU."""
    speed = angle = 0.0
    rows, h = [], DT / 200
    for voltage in U:
        rows.append((angle, speed))
        voltage = gain * np.sign(voltage) * max(abs(voltage) - dead, 0.0)
        for _ in range(200):
            angle += h * speed
            speed += h * (0.05 * voltage - friction * speed * abs(speed)) / 1.8e-3
    return np.array(rows).T


def test_the_wrapper_is_what_the_report_said(motor, tmp_path):
    dead = {"width": 0.4, "stretch": 0.0, "skew": 0.0, "rounding": 0.0}
    effects = [
        ("actuator_dead_zone", "voltage", dead), ("actuator_gain", "voltage", {"deviation": 0.2}),
        ("quadratic_drag", "shaft", {"coefficient": 3e-4}), ("sensor_bias", "omega", {"offset": 1.5}),
    ]  # fmt: skip
    path = tmp_path / "corrected.fmu"
    path.write_bytes(wrapped(simulator(motor, effects)))
    angle, omega = truth(3e-4, 1.2, 0.4)
    expected = np.stack([angle, omega + 1.5])
    found, plain = run(path), run(motor, 1.8e-3)
    off = [np.sqrt(np.mean(np.square(y - expected), axis=1)) for y in (plain, found)]
    assert np.all(off[1] < 0.02 * off[0])


def test_what_feeds_through_is_read_under_the_input_of_its_row(tmp_path):
    cell = tmp_path / "cell.fmu"
    cell.write_bytes(
        ode_fmu(
            "cell", lambda t, x, u, p: [u.current - x.v], {"v": 0.0}, {"current": 0.0}, {"R": 2.0},
            lambda t, x, u, p: {"volt": x.v + p.R * u.current},
        )
    )  # fmt: skip
    plain = FmuSimulator(cell, trust=True)
    v, raised = [0.0], FmuSimulator(cell, (), {}, [("actuator_gain", "current", {"deviation": 0.5})], trust=True)
    for u in U[:-1]:
        v.append(u + (v[-1] - u) * np.exp(-DT))
    read = plain.run(T, U[None], plain.numbers, np.zeros(0))
    np.testing.assert_allclose(read[0], v + 2.0 * U, atol=1e-9)
    (tmp_path / "raised.fmu").write_bytes(wrapped(raised))
    other = FmuSimulator(tmp_path / "raised.fmu", trust=True)
    np.testing.assert_allclose(other.run(T, U[None], other.numbers, np.zeros(0))[:, 1:], 1.5 * read[:, 1:], atol=1e-9)


def test_without_effects_the_wrapper_is_the_original_with_its_parameters(motor, tmp_path):
    path = tmp_path / "corrected.fmu"
    path.write_bytes(wrapped(simulator(motor)))
    assert np.allclose(run(path), run(motor, 1.8e-3), rtol=1e-6, atol=1e-9)


def test_what_remembers_stays_in_the_page(motor):
    lagging = simulator(motor, [("actuator_lag", "voltage", {"time_constant": 0.1})])
    with pytest.raises(ExportError, match="has memory"):
        wrapped(lagging)


def test_a_dead_zone_in_volts_knows_no_bounds_of_a_valve(motor, tmp_path):
    dead = 3.5
    path = tmp_path / "corrected.fmu"
    path.write_bytes(wrapped(simulator(motor, [("actuator_dead_zone", "voltage", {"width": dead})])))
    found, expected, plain = run(path), truth(0.0, 1.0, dead), run(motor, 1.8e-3)
    off = [np.sqrt(np.mean(np.square(y - expected), axis=1)) for y in (plain, found)]
    assert np.all(off[1] < 0.02 * off[0])


@pytest.mark.slow
def test_a_diagnosis_of_a_dead_zone_hands_over_an_fmu_and_outlives_one_that_fails(motor, tmp_path, monkeypatch):
    angle, omega = truth(0.0, 1.0, 0.8)
    rng, shown = np.random.default_rng(0), (angle, omega)
    noisy = {n: y + 1e-3 * rng.standard_normal(SAMPLES) for n, y in zip(("angle", "omega"), shown, strict=True)}
    log = pd.DataFrame({"trajectory": "run", "time": T, "voltage": U, "load": 0.0, **noisy})
    found = diagnose_simulator(log, simulator(motor), ["actuator_dead_zone"])
    assert [c.effects for c in found.causes] == [("actuator_dead_zone",)]
    low, high = found.causes[0].parameters["width"].ci90
    assert 0.4 < low < 0.8 < high < 1.6
    write(found, tmp_path / "found", Source())
    assert not any("left out" in text for text in found.notes)
    plain, corrected = run(motor, 1.8e-3), run(tmp_path / "found" / "corrected.fmu")
    off = [np.sqrt(np.mean(np.square(y - np.stack(shown)), axis=1)) for y in (plain, corrected)]
    assert np.all(off[1] < 0.1 * off[0])

    def fails(_):
        raise ExportError("No C compiler is found.", "one", "Install gcc.")

    monkeypatch.setattr("pamid.simulators.fmu_wrapper.wrapped", fails)
    write(found, tmp_path / "without", Source())
    assert any("corrected.fmu left out" in text and "No C compiler" in text for text in found.notes)
    written = {file.name for file in (tmp_path / "without").iterdir()}
    assert {"diagnosis.json", "report.html", "corrected.toml"} <= written and "corrected.fmu" not in written


def test_a_run_without_numbers_is_told_and_is_no_number(tmp_path):
    def rates(t, x, u, p):
        return [x.speed, u.go * (1e200 * x.speed**3 + 1e200)]

    start = {"position": 4.0, "speed": 0.0}
    fmu = ode_fmu("bad", rates, start, {"go": 0.0}, {}, lambda t, x, u, p: {"y": x.position})
    path = tmp_path / "bad.fmu"
    path.write_bytes(fmu)
    sim, go = FmuSimulator(path, trust=True), np.stack([np.zeros((1, SAMPLES)), np.ones((1, SAMPLES))])
    with pytest.raises(SimulatorRunError, match=r"failed in run 2: .* at 0 s") as told:
        sim.runs(T, go, np.zeros((2, 0)), np.zeros((2, 0)))
    assert "status Error" in str(told.value)
    assert np.allclose(sim.run(T, go[0], np.zeros(0), np.zeros(0)), 4.0)  # the same process goes on


@pytest.mark.parametrize(
    "broken", ["return 2;", "return 3;", "m->v[1] = 0.0 / zero;"], ids=["discards", "fails", "not a number"]
)
def test_a_step_that_fails_after_half_a_second_is_no_number(motor, tmp_path, broken, capsys):
    """Of whatever status: half a run is no run, and nothing is evaluated."""
    with zipfile.ZipFile(motor) as given:
        entries = {name: given.read(name) for name in given.namelist()}
    source = entries["sources/motor.c"].decode()
    late = f"volatile double zero = 0.0; (void)zero; if (now > 0.5) {{ {broken} }}"
    changed = source.replace("return FAILED;\n    return OK;", "return OK;\n    " + late + "\n    return OK;")
    assert changed != source
    (binary,) = (name for name in entries if name.startswith("binaries/"))
    path = tmp_path / "motor.fmu"
    path.write_bytes(packed({**entries, binary: compiled({"motor.c": changed})}))
    sim = FmuSimulator(path, trust=True)
    with pytest.raises(SimulatorRunError, match="is nan" if "zero;" in broken else "Discard|Error"):
        sim.run(T, np.stack([U, np.zeros(SAMPLES)]), sim.numbers, np.zeros(0))
    log = {"time": T, "voltage": U, "load": 0.0 * T, "angle": 0.01 * np.cumsum(U), "omega": U}
    pd.DataFrame(log).to_csv(tmp_path / "log.csv", index=False)
    assert main(["evaluate", str(tmp_path / "log.csv"), "--sim", str(path), "--trust"]) != 0
    said = capsys.readouterr()
    assert "rmse" not in said.out and ("motor" in said.err or "The simulator" in said.err)


def test_variables_whose_plain_names_are_the_same_are_all_there():
    assert _distinct(["y.", "y", "a[1]", "a(1)"]) == {"y": "y", "y_2": "y.", "a_1": "a[1]", "a_1_2": "a(1)"}


def test_numbers_that_a_second_opinion_frees_bring_no_trust(motor):
    freed = FmuSimulator(motor, (), {}).freed({"k": ModelParameter(0.06, 0.9)})
    with pytest.raises(UntrustedCodeError):
        freed.run(T, np.stack([U, np.zeros(SAMPLES)]), freed.numbers, np.zeros(0))
    trusted = FmuSimulator(motor, (), {}, trust=True).freed(freed.parameters)
    x = trusted.run(T, np.stack([U, np.zeros(SAMPLES)]), trusted.numbers, np.zeros(0))
    assert np.allclose(x, 1.2 * run(motor))  # neither friction nor load: all is proportional to k


def test_no_unpacked_folder_stays(motor, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    sim = simulator(motor)
    sim.run(T, np.stack([U, np.zeros(SAMPLES)]), sim.numbers, np.zeros(0))
    assert list(tmp_path.glob("pamid_fmu_*/fmu"))
    del sim
    gc.collect()
    assert not list(tmp_path.iterdir())
