"""Damping that MuJoCo takes implicitly adds inertia of a step's length, which is no cause of a gap."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap.residuals.between_rows import SEMI_IMPLICIT
from pamid.gap.simulated import evidence_of
from pamid.simulators.mujoco_model import MujocoSimulator

mujoco = pytest.importorskip("mujoco")

CART = """<mujoco><option timestep="0.004" integrator="implicitfast"/><worldbody><body>
<joint name="slider" type="slide" axis="1 0 0" damping="1"/><geom type="box" size="0.1 0.05 0.05" mass="1"/>
<body><joint name="pole" type="hinge" axis="0 1 0" damping="0.003"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.01" mass="0.2"/></body></body></worldbody>
<actuator><motor name="force" joint="slider"/></actuator></mujoco>"""
DT = 0.012


def recorded(step: float, speeds: bool, rng: np.random.Generator) -> pd.DataFrame:
    model = mujoco.MjModel.from_xml_string(CART)
    model.opt.timestep, data, rows = step, mujoco.MjData(model), []
    data.qpos[:] = [0.0, 0.3]
    for k in range(900):
        data.ctrl[:] = 3.0 * np.sin(2.1 * k * DT) + 2.0 * np.sin(5.3 * k * DT + 1.0)
        rows.append([k * DT, *data.ctrl, *data.qpos, *data.qvel])
        for _ in range(round(DT / step)):
            mujoco.mj_step(model, data)
    log = pd.DataFrame(rows, columns=["time", "force", "slider_q", "pole_q", "slider_dq", "pole_dq"])
    log[["slider_q", "pole_q"]] += rng.normal(0.0, 3e-5, (900, 2))
    log[["slider_dq", "pole_dq"]] += rng.normal(0.0, 1e-4, (900, 2))
    return (
        log.assign(trajectory="run") if speeds else log.drop(columns=["slider_dq", "pole_dq"]).assign(trajectory="run")
    )


@pytest.mark.parametrize("speeds", [False, True])
@pytest.mark.parametrize("share", [1.0, 0.25])
def test_a_log_made_by_the_models_own_steps_has_no_gap(tmp_path, share, speeds) -> None:
    (tmp_path / "cart.xml").write_text(CART)
    log = recorded(0.004 * share, speeds, np.random.default_rng(4))
    evidence = evidence_of(log, MujocoSimulator(tmp_path / "cart.xml"))
    x = np.linalg.lstsq(evidence.J, -evidence.z0, rcond=None)[0]
    left = evidence.z0 + evidence.J @ x
    assert all(np.sqrt(np.mean(np.square(left[part]))) < 1.2 for part in evidence.parts)
    if share == 1.0 and not speeds:  # a quarter of it changes less than the noise
        found = dict(zip(evidence.free, x, strict=True))
        assert found[SEMI_IMPLICIT] == pytest.approx(share * 0.004 / DT, abs=0.05)
