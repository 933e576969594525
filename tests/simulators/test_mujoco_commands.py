"""Effects on a command that MJCF has attributes for: the model that is written runs in MuJoCo as it does in pamid."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco")

from pamid.simulators.catalogue import port_effects  # noqa: E402
from pamid.simulators.mujoco_callback import MujocoCallbacks, corrected  # noqa: E402
from pamid.simulators.mujoco_commands import taken_delays  # noqa: E402
from pamid.simulators.mujoco_model import MujocoSimulator  # noqa: E402
from pamid.simulators.page import page_text  # noqa: E402
from pamid.simulators.placement import Placement, Scales  # noqa: E402
from pamid.simulators.play_runs import played  # noqa: E402

ARM = """
<mujoco><compiler angle="radian"/><option timestep="0.002" integrator="{}"/>
<worldbody><body name="arm"><joint name="hinge" axis="0 1 0" damping="0.05"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="0.5"/></body></worldbody>
<actuator><motor name="motor" joint="hinge"{}/></actuator></mujoco>
"""
DT, STEPS = 0.01, 5
T = DT * np.arange(300)
U = 0.5 * np.sin(2.0 * T) + 0.4 * np.sin(3.1 * T)
DELAY, LIMIT = ("actuator_delay", "motor", {"delay": 0.03}), ("actuator_saturation", "motor", {"limit": 0.4})
GAIN = ("actuator_gain", "motor", {"deviation": 0.25})
DEAD = ("actuator_dead_zone", "motor", {"width": 0.1, "stretch": 0.0, "skew": 0.0, "rounding": 0.0})
DELAYS = pytest.mark.skipif(not hasattr(mujoco.MjModel, "actuator_delay"), reason="MuJoCo has no delays before 3.5")


def arm(folder: Path, integrator: str = "RK4", more: str = "", option: str = "") -> MujocoSimulator:
    (folder / "arm.xml").write_text(ARM.format(integrator, more).replace("<worldbody>", f"{option}<worldbody>"))
    return MujocoSimulator(folder / "arm.xml")


def swung(model: mujoco.MjModel, commands: np.ndarray = U) -> np.ndarray:
    """Return angles and speeds at the samples, a command or a command per step given at each."""
    data, rows, steps = mujoco.MjData(model), [], np.reshape(np.broadcast_to(commands, (STEPS, len(T))).T, (-1,))
    for k, command in enumerate(steps if commands.ndim == 1 else commands.T.ravel()):
        if k % STEPS == 0:
            rows.append((data.qpos[0], data.qvel[0]))
        data.ctrl[0] = command
        mujoco.mj_step(model, data)
    return np.array(rows)


def by_pamid(simulator: MujocoSimulator) -> np.ndarray:
    """Return angles and speeds as pamid simulates them with the effects."""
    active = []
    for name, where, values in simulator.effects:
        place = Placement(f"{name}@{where}", name, where, port_effects()[name][1], "input", where, {}, Scales())
        active.append((place, place.made(values)))
    u = np.stack([U, np.zeros_like(U)])[None]
    (found,) = played(simulator, T, u, np.zeros(2), simulator.numbers, active, substeps=2)
    return np.column_stack([found["hinge_q"], found["hinge_dq"]])


@pytest.mark.parametrize(
    "effects",
    [
        pytest.param([DELAY], marks=DELAYS), [LIMIT], [GAIN, LIMIT], [LIMIT, GAIN],
        pytest.param([GAIN, LIMIT, DELAY], marks=DELAYS),
    ],
)  # fmt: skip
def test_a_model_with_late_and_limited_commands_runs_as_pamid_runs_it(effects, tmp_path: Path) -> None:
    plain = arm(tmp_path)
    simulator = plain.with_(effects=effects)
    text, rest = simulator.corrected_xml()
    assert rest == []
    found, before = swung(mujoco.MjModel.from_xml_string(text)), swung(plain.compiled())
    size = np.abs(found - before).max(axis=0)
    assert np.all(np.abs(found - by_pamid(simulator)).max(axis=0) < 1e-3 * size)


@DELAYS
@pytest.mark.parametrize(
    ("delay", "integrator"), [(0.03, "Euler"), (0.0331, "implicitfast"), (0.0, "RK4"), (0.03, "RK4")]
)
def test_a_delay_acts_in_steps_as_its_attribute_and_as_a_callback(delay, integrator, tmp_path: Path) -> None:
    plain = arm(tmp_path, integrator)
    held, (whole, part) = np.repeat(U, STEPS), divmod(round(delay / 0.002, 9), 1.0)
    older, newer = (np.concatenate([np.full(int(whole) + k, U[0]), held])[: len(held)] for k in (1, 0))
    late = swung(plain.compiled(), np.reshape(newer + part * (older - newer), (-1, STEPS)).T)
    effects = [("actuator_delay", "motor", {"delay": delay})]
    with MujocoCallbacks(plain.compiled(), effects):
        np.testing.assert_allclose(swung(plain.compiled()), late, atol=1e-9)
    text, rest = plain.with_(effects=effects).corrected_xml()
    assert rest == (effects if delay == 0.0 else [])  # shorter than a step
    if rest == []:
        atol = 1e-9 if integrator != "RK4" else 5e-4  # which reads commands within a step, too
        np.testing.assert_allclose(swung(mujoco.MjModel.from_xml_string(text)), late, atol=atol)


@DELAYS
def test_a_delay_of_a_model_is_what_it_amounts_to() -> None:
    def taken(integrator: str, more: str) -> float:
        m = mujoco.MjModel.from_xml_string(ARM.format(integrator, more))
        (found,) = taken_delays(m).values()
        assert m.actuator_delay[0] == 0.0
        return found

    assert taken("Euler", ' nsample="4" delay="0.0071"') == 0.008  # held: whole steps
    assert taken("Euler", ' nsample="4" delay="0.0071" interp="linear"') == 0.0071
    assert taken("Euler", ' nsample="4" delay="0.0001" interp="linear"') == 0.002  # the command of the step before
    assert taken("RK4", ' nsample="5" delay="0.009" interp="linear"') == 0.008


def test_what_a_range_does_not_mean_exactly_stays_a_callback(tmp_path: Path) -> None:
    def told(effects: list, **model: str) -> tuple[list[str], list[float]]:
        text, rest = arm(tmp_path, **model).with_(effects=effects).corrected_xml()
        m = mujoco.MjModel.from_xml_string(text)
        return [name for name, *_ in rest], m.actuator_ctrlrange[0].tolist() if m.actuator_ctrllimited[0] else []

    own = ' ctrllimited="true" ctrlrange="-0.3 1"'
    assert told([LIMIT], more=own) == ([], [-0.3, 0.4])
    assert told([LIMIT, GAIN], more=own) == (["actuator_saturation"], [-0.3, 1.0])
    assert told([DEAD, LIMIT]) == (["actuator_dead_zone"], [-0.4, 0.4])
    assert told([LIMIT, DEAD]) == (["actuator_saturation", "actuator_dead_zone"], [])
    assert told([GAIN, DEAD]) == (["actuator_gain", "actuator_dead_zone"], [])


@DELAYS
def test_what_is_written_is_read_again_as_it_was(tmp_path: Path) -> None:
    unlimited = arm(tmp_path, option='<option><flag clampctrl="disable"/></option>').with_(effects=[LIMIT])
    assert unlimited.corrected_xml()[1] == [LIMIT]
    text, rest = arm(tmp_path).with_(effects=[DEAD, GAIN, LIMIT, DELAY]).corrected_xml()
    assert rest == [DEAD]
    (tmp_path / "corrected.xml").write_text(text)
    again = MujocoSimulator(tmp_path / "corrected.xml", effects=rest)
    assert again.effects == (DEAD, DELAY)
    (tmp_path / "corrected.toml").write_text(page_text(again, tmp_path))
    model, acting = corrected(tmp_path / "corrected.toml")
    with acting:
        found = swung(model)
    late = np.concatenate([np.full(3, U[0]), U[:-3]])
    acted = np.clip(1.25 * np.sign(late) * np.maximum(np.abs(late) - 0.1, 0.0), -0.4, 0.4)
    np.testing.assert_allclose(found, swung(arm(tmp_path).compiled(), acted), atol=1e-5)
    np.testing.assert_allclose(by_pamid(again), found, atol=1e-3)
