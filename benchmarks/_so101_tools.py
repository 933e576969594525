"""Fits of the SO-101 arm by the tools themselves, where they are installed: CMA-ES as PACE runs it, MuJoCo's sysid.

Both begin where the least-squares fits of `_so101_fits` do.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._so101 import model_text
from benchmarks._so101_fits import BOUNDS, JOINTS, SOFT, Fit, Motions, Numbers, public

GENERATIONS, SPREAD = 25, 0.5
"""Of the evolution strategy; its first standard deviation, of logarithms and as a share of other bounds."""
ITERATIONS = 8
"""Gauss-Newton iterations of MuJoCo's sysid."""


def evolved(model: Any, motions: Motions, free: Sequence[str]) -> Numbers | None:
    """Return the numbers that CMA-ES finds, None without the package ``cma``.

    Each servo has a strategy of its own: a run tries a candidate at every servo.
    """
    try:
        import cma  # type: ignore[import-not-found]
    except ImportError:
        return None
    fit, many = Fit(model, motions, free), len(JOINTS)
    low, high = (np.reshape(x, (len(free), many)).T for x in (fit.low, fit.high))
    own = np.array([[fit._in(w, SOFT.get(w, fit.own[w][k])) for w in free] for k in range(many)])
    size = np.array([1.0 if w not in ("offset", "delay") else 0.2 * (high - low)[0, i] for i, w in enumerate(free)])
    begin = np.clip(own, low + 1e-6, high - 1e-6)
    runs = [
        cma.CMAEvolutionStrategy(x / size, SPREAD, {"bounds": [list(a / size), list(b / size)], "seed": 1 + k,
                                                    "verbose": -9})
        for k, (x, a, b) in enumerate(zip(begin, low, high, strict=True))
    ]  # fmt: skip
    for _ in range(GENERATIONS):
        asked = [es.ask() for es in runs]
        errors = []
        for some in zip(*asked, strict=True):
            z = (np.array(some) * size).T.ravel()
            errors.append(np.sum(np.square(fit.residuals(z)), axis=0))
        for k, es in enumerate(runs):
            es.tell(asked[k], [float(e[k]) for e in errors])
    return fit.numbers((np.array([es.result.xbest for es in runs]) * size).T.ravel())


def identified(folder: Path, step: float, motions: Motions, free: Sequence[str]) -> Numbers | None:
    """Return the numbers that MuJoCo's own sysid finds, None where it is not installed."""
    import mujoco

    try:
        from mujoco import sysid
        from mujoco.sysid import Parameter, ParameterDict
    except ImportError:
        return None
    spec = mujoco.MjSpec.from_string(model_text(folder, vendor=False))
    spec.option.timestep, spec.option.integrator = step, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model = spec.compile()
    own, params = public(model), ParameterDict()
    for word in free:
        for k, joint in enumerate(JOINTS):

            def put(s: Any, p: Any, word: str = word, joint: str = joint) -> None:
                value = float(p.value[0])
                actuator = next(a for a in s.actuators if a.target == joint)
                if word == "kp":
                    actuator.gainprm[0], actuator.biasprm[1] = value, -value
                elif word == "kv":
                    actuator.biasprm[2] = -value
                elif word == "damping":
                    s.joint(joint).damping = [value, 0.0, 0.0]
                else:
                    setattr(s.joint(joint), word, value)

            begin = SOFT.get(word, float(own[word][k]))
            found = Parameter(f"{word}_{joint}", nominal=begin, min_value=BOUNDS[word][0], max_value=BOUNDS[word][1],
                              modifier=put)  # fmt: skip
            params.add(found)
    states, controls, readings, names = [], [], [], []
    data = mujoco.MjData(model)
    for name, log in motions.items():
        t = log["time"].to_numpy()
        once = np.concatenate([[True], np.diff(t) > 0.0])
        q = log[JOINTS].to_numpy(dtype=float)[once]
        data.qpos[:] = q[0]
        states.append(sysid.create_initial_state(model, data.qpos, 0.0 * data.qvel, data.act))
        command = log[[f"{j}_ctrl" for j in JOINTS]].to_numpy(dtype=float)[once]
        controls.append(sysid.TimeSeries(t[once], command))
        readings.append(sysid.TimeSeries.from_names(t[once], q, model, [f"{j}_qpos" for j in JOINTS]))
        names.append(name)
    sequences = sysid.ModelSequences("so101", spec, names, states, controls, readings, allow_missing_sensors=True)
    residual = sysid.build_residual_fn(models_sequences=[sequences], n_threads=2)
    found, _ = sysid.optimize(initial_params=params, residual_fn=residual, optimizer="mujoco", verbose=False,
                              max_iters=ITERATIONS)  # fmt: skip
    return own | {w: np.array([float(found[f"{w}_{j}"].value[0]) for j in JOINTS]) for w in free}
