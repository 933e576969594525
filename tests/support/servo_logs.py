"""Logs of one joint with a servo, made by MuJoCo."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd


def servo_log(model: Any, amplitude: float, rows: int) -> pd.DataFrame:
    """Return three runs of a MuJoCo model with a joint ``arm`` and a ``servo``, read with noise each 10 ms."""
    import mujoco

    rng, found, steps = np.random.default_rng(2), [], round(0.01 / model.opt.timestep)
    for run in "abc":
        data, rate, phase = mujoco.MjData(model), 2 * np.pi * rng.uniform(0.1, 0.8, 3), rng.uniform(0, 6, 3)
        for k in range(rows):
            u = amplitude * float(np.sum(np.sin(rate * 0.01 * k + phase) - np.sin(phase)))
            q, dq = data.qpos[0] + 1e-4 * rng.standard_normal(), data.qvel[0] + 2e-3 * rng.standard_normal()
            found.append((run, 0.01 * k, u, q, dq))
            data.ctrl[:] = u
            mujoco.mj_step(model, data, nstep=steps)
    return pd.DataFrame(found, columns=["trajectory", "time", "servo", "arm_q", "arm_dq"])
