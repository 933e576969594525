"""What happens within a sample, and noise that turns friction early, are no causes."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.gap.residuals.between_rows import STEPS, steps_taken
from pamid.gap.residuals.direct import DirectEvidence
from pamid.gap.simulated import _by_itself, evidence_of
from pamid.simulators import FunctionSimulator, MujocoSimulator, Port

DT, STIFFNESS, MASS, DAMPING, FRICTION = 5e-3, 200.0, 1.0, 2.0, 3.0


def rates(t, x, u, p):
    """Return the rates of a mass on a spring."""
    return [x.v, (u.force - p.k * x.x - p.d * x.v) / p.m]


def oscillator(damping: float = DAMPING, tolerance: float = 0.05) -> FunctionSimulator:
    """Return the simulator of the mass, with its damping."""
    return FunctionSimulator(
        rates,
        [
            Port("force", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s"),
            Port("slide", "joint", "N", position="x", velocity="v"),
        ],
        {"m": (MASS, 0.0, "kg"), "k": (STIFFNESS, 0.02, "N/m"), "d": (damping, tolerance, "N s/m")},
    )  # fmt: skip


def acceleration(force: float, x: float, v: float, friction: float) -> float:
    """Return what the mass does."""
    return float((force - STIFFNESS * x - DAMPING * v - friction * np.tanh(v / 1e-3)) / MASS)


def oscillator_log(
    columns: str, euler: int = 0, friction: float = 0.0, noise: tuple[float, float] = (1e-5, 1e-3), seed: int = 5
) -> pd.DataFrame:
    """Return logs of the mass under held forces, by Euler's steps, so many a sample, or by the midpoint rule."""
    rng, frames = np.random.default_rng(seed), []
    for k in range(2):
        t = np.arange(0.0, 5.0, DT)
        force = 8.0 * np.sin(2 * np.pi * (0.6 + 0.5 * k) * t) + 6.0 * np.sin(2 * np.pi * (2.3 - 0.4 * k) * t + k)
        x, v, rows, steps = 0.0, 0.0, [], euler or 40
        for now in force:
            rows.append((x, v))
            h = DT / steps
            for _ in range(steps):
                there = 0.0 if euler else 0.5 * h
                mid = x + there * v, v + there * acceleration(now, x, v, friction)
                x, v = x + h * mid[1], v + h * acceleration(now, *mid, friction)
        x, v = np.array(rows).T + rng.standard_normal((2, len(t))) * np.array(noise)[:, None]
        frames.append(pd.DataFrame({"trajectory": f"run {k}", "time": t, "force": force, "x": x, "v": v}))
    return pd.concat(frames, ignore_index=True)[["trajectory", "time", "force", *columns]]


@pytest.mark.parametrize("columns", ["xv", "x"])
def test_euler_steps_of_a_log_are_no_gap(columns: str) -> None:
    found = diagnose_simulator(oscillator_log(columns, euler=10), oscillator())
    assert found.verdict == "none"
    # In samples; a noisy speed tells it less well.
    share = found.deviations[STEPS]
    assert share == pytest.approx(0.1, abs=0.05 if columns == "x" else 0.2)
    assert [n for n in found.notes if "Euler" in n] == steps_taken({STEPS: share}, DT)


def test_steps_that_a_fit_took_up_are_told() -> None:
    (told,) = steps_taken({"m": 0.5, STEPS: 0.1}, DT)
    assert "in steps of 0.5 ms (0.1 of a sample)" in told
    assert "The log (monday) looks" in steps_taken({f"{STEPS} (monday)": 1.0}, DT)[0]
    assert steps_taken({"m": 0.5, STEPS: 0.0}, DT) == []


def test_damping_that_a_simulator_lacks_is_named_not_hidden_in_the_integrator() -> None:
    """Euler's steps take damping away; what adds damping remains a cause."""
    found = diagnose_simulator(oscillator_log("xv"), oscillator(damping=0.5 * DAMPING))
    assert [set(c.effects) for c in found.causes] == [{"viscous_friction", "parameter_deviation"}]
    assert STEPS not in found.deviations
    assert found.causes[0].parameters["coefficient"].value == pytest.approx(0.5 * DAMPING, rel=0.15)


def test_noise_of_a_force_that_turns_with_noisy_readings_is_told_by_copies() -> None:
    """The mean square of what noise changes is that of copies of the log, and grows with the square of the force."""
    log = oscillator_log("x", friction=FRICTION, noise=(1e-4, 0.0))
    evidence = evidence_of(log, oscillator(), refit=True)
    assert isinstance(evidence, DirectEvidence)
    name = "coulomb_friction@slide"
    place = evidence.placements[name]
    spec = {name: place.inward({"amplitude": FRICTION / MASS, "presliding": 1e-5, "exponent": 1.0})}
    spec[name] = {p.name: spec[name].get(p.name, p.nominal) for p in place.effect.parameters}
    wide = evidence.widening(spec)
    assert wide is not None and wide.min() >= 1.0
    active, numbers = evidence.active(spec), evidence.simulator.numbers
    plain, changes = evidence._residual(active, numbers), []
    rng = np.random.default_rng(1)
    for _ in range(8):
        noisy = {
            n: c + evidence.channel_noise(n) * rng.standard_normal(len(c)) for n, c in evidence.log.channels.items()
        }
        noisy["force"] = evidence.log.channels["force"]
        changes.append((evidence._residual(active, numbers, noisy) - plain) / evidence.noise)
    assert np.sqrt(np.mean(np.square(changes))) == pytest.approx(np.sqrt(np.mean(np.square(wide))), rel=0.15)
    half = {name: {**spec[name], "amplitude": 0.5 * spec[name]["amplitude"]}}
    np.testing.assert_allclose(
        np.square(evidence.widening(half)) - 1.0, (np.square(wide) - 1.0) / 4.0, rtol=1e-6, atol=1e-9
    )


ARM = """<mujoco><compiler angle="radian"/><worldbody>
<body><joint name="pan" axis="0 1 0" armature="0.05"/><geom type="capsule" fromto="0 0 0 0 0 -.2" size=".02" mass=".4"
contype="0"/><body pos="0 0 -.2"><joint name="elbow" axis="0 1 0" armature="0.03"{}/>
<geom type="capsule" fromto="0 0 0 0 0 -.2" size=".02" mass=".2" contype="0"/></body></body></worldbody><actuator>
<position name="pan" joint="pan" kp="20" kv="1"/><position name="elbow" joint="elbow" kp="10" kv=".5"/>
</actuator></mujoco>"""
DAMPED = ARM.format(' damping="0.6"')


def of_an_arm(seed: int) -> pd.DataFrame:
    """Two runs of the damped arm in MuJoCo's own steps: commands and angles in a LeRobot's resolution, no speeds."""
    mujoco = pytest.importorskip("mujoco")
    model, t, found = mujoco.MjModel.from_xml_string(DAMPED), np.arange(0, 6, 0.01), []
    for run in range(2):
        data, rng = mujoco.MjData(model), np.random.default_rng([seed, run])
        rates, phases = 2 * np.pi * rng.uniform(0.1, 0.8, (2, 3, 1)), rng.uniform(0, 6, (2, 3, 1))
        wanted = 0.32 * np.sum(np.sin(rates * t + phases) - np.sin(phases), axis=1)
        angles = np.empty_like(wanted)
        for k in range(len(t)):
            angles[:, k], data.ctrl[:] = data.qpos, wanted[:, k]
            mujoco.mj_step(model, data, 5)
        angles += 3.5e-4 * rng.standard_normal(angles.shape)
        columns = {"pan_ctrl": wanted[0], "elbow_ctrl": wanted[1], "pan_q": angles[0], "elbow_q": angles[1]}
        found.append(pd.DataFrame({"trajectory": f"{run}", "time": t, **columns}))
    return pd.concat(found, ignore_index=True)


@pytest.mark.parametrize(
    "xml, causes", [(DAMPED, []), (ARM.format(""), [("viscous_friction",)])], ids=["right", "lacks"]
)
def test_half_a_step_of_mujoco_beside_speeds_that_are_derived_is_no_cause(xml: str, causes: list, tmp_path) -> None:
    """At a servo's damping of 1 N m s/rad, the 2 ms of the model are worth an armature of 0.001 kg m²."""
    (tmp_path / "arm.xml").write_text(xml)
    library = ["viscous_friction", "coulomb_friction", "parameter_deviation", "actuator_lag", "creep", "hysteresis"]
    found = diagnose_simulator(of_an_arm(2), MujocoSimulator(tmp_path / "arm.xml"), library)
    assert [c.effects for c in found.causes] == causes and found.verdict == ("cause" if causes else "none")


COIL = FunctionSimulator(
    lambda t, x, u, p: [(u.V - p.R * x.i) / p.L],
    [Port("V", "input", "V"), Port("i", "state", "A")],
    {"R": (1.2, 0.1, "ohm"), "L": (4e-3, 0.1, "H")},
)
WOUND = FunctionSimulator(COIL.function, list(COIL.ports), {"R": (1.2, 0.1, "ohm"), "L": 4e-3})
"""The same with a known inductance: nothing compensates for when the voltage acts."""


def coil_log(noise: float) -> pd.DataFrame:
    """Return the current of a coil under a voltage that changes slowly beside its 3 ms: it stays near V/R."""
    rng, dt, frames = np.random.default_rng(4), 2e-3, []
    for k in range(2):
        t = np.arange(1000) * dt
        volt = 8.0 * np.sin(2 * np.pi * (2.0 + k) * t) + 4.0 * np.sin(2 * np.pi * (7.0 - 2.0 * k) * t + k)
        kept, i, rows = np.exp(-1.2 * dt / 4e-3), 0.0, []
        for now in volt:
            rows.append(i)
            i = kept * i + (1.0 - kept) * now / 1.2
        current = np.array(rows) + noise * rng.standard_normal(len(t))
        frames.append(pd.DataFrame({"trajectory": f"run {k}", "time": t, "V": volt, "i": current}))
    return pd.concat(frames, ignore_index=True)


def test_where_noise_would_bias_a_parameter_stretches_are_simulated() -> None:
    """Noise in V - R i makes its slope over di/dt, 1/L, look small: least squares takes it for exact.

    With little noise that matters for the inductance and the time at which the voltage acts together.
    """
    assert isinstance(evidence_of(coil_log(0.01), WOUND, refit=True), DirectEvidence)
    for noise in (0.01, 0.3):
        assert not isinstance(evidence_of(coil_log(noise), COIL, refit=True), DirectEvidence)
    found = diagnose_simulator(coil_log(0.3), COIL, ["parameter_deviation"])
    assert found.verdict == "none", str(found)


@pytest.mark.parametrize("late", [False, True])
def test_what_the_corrected_simulator_lacks_of_the_fit_is_told(late: bool) -> None:
    """Forces that were read a sample late are allowed for, but a simulator file cannot hold that."""
    log = oscillator_log("xv", friction=FRICTION)
    if late:
        log["force"] = log.groupby("trajectory")["force"].shift().fillna(log["force"])
    found = diagnose_simulator(log, oscillator(), ["coulomb_friction"])
    closure = next(c for c in found.closure if c.equation == found.causes[0].equation)
    assert closure.closed_share > 0.9 and closure.allowed == ("timing of force" if late else "")
    assert ("by itself closes" in str(found)) == late == (closure.alone < closure.ci90[0])


def test_curves_within_a_step_are_no_residual(monkeypatch: pytest.MonkeyPatch) -> None:
    """Held voltages let the current curve: lines between readings miss the mean rate by more than the noise."""

    def left() -> float:
        evidence = evidence_of(coil_log(1e-4), WOUND)
        assert isinstance(evidence, DirectEvidence)
        return float(np.sqrt(np.mean(np.square(evidence.raw(evidence.z0)))))

    assert left() < 1.2
    monkeypatch.setattr(DirectEvidence, "_bent", lambda self, rates, ends: 0.0 * rates)
    assert left() > 3.0


def test_steps_that_the_evidence_has_set_aside_are_nothing_to_allow_for() -> None:
    """A fit to a part of a log may have needed them."""
    evidence = SimpleNamespace(free=("d",), about=np.zeros(1), given=SimpleNamespace(parameters={"d": None}))
    found = SimpleNamespace(added=[], deviations={"d": 0.1, STEPS: 0.2}, closure=["as it was"])
    assert _by_itself(evidence, found, {}) == ["as it was"]
