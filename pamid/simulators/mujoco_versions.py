"""Differences between MuJoCo 3.2 and 4.0: names of inertias, actuator moments and model specifications."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import SimulatorRunError


@cache
def _version() -> tuple[int, ...]:
    """Return the first two numbers of MuJoCo's version, and the third where there is one."""
    import mujoco

    return tuple(int(part) for part in mujoco.__version__.split(".")[:3] if part.isdigit())


def write_full_inertia(m: Any, d: Any, out: np.ndarray) -> np.ndarray:
    """Write the inertia matrix of the joints, and return it."""
    import mujoco

    if _version() >= (3, 10):
        mujoco.mj_fullM(m, d, out)
    else:
        mujoco.mj_fullM(m, out, d.qM)
    return out


def write_moments(m: Any, d: Any, out: np.ndarray) -> None:
    """Write the moment of each actuator at each joint."""
    import mujoco

    if _version() < (3, 2, 5):  # not sparse yet
        out[:] = d.actuator_moment
    else:
        columns, values = np.ravel(d.moment_colind), np.ravel(d.actuator_moment)
        mujoco.mju_sparse2dense(out, values, d.moment_rownnz, d.moment_rowadr, columns)


def limits_tendons(m: Any) -> bool:
    """Return whether the forces of actuators are limited at a tendon."""
    return _version() >= (3, 3, 1) and bool(np.any(m.tendon_actfrclimited))


def keeps_commands() -> bool:
    """Return whether actuators have histories of commands, and delays."""
    return _version() >= (3, 5)


def rolls_out() -> bool:
    """Return whether `mujoco.rollout` takes several sets of data, a thread each."""
    return _version() >= (3, 2, 7)


def spec_of(path: Path) -> Any:
    """Return a model as it is written, for changes."""
    import mujoco

    if _version() >= (3, 2, 4):
        return mujoco.MjSpec.from_file(str(path))
    spec = mujoco.MjSpec()
    spec.from_file(str(path))
    return spec


def writes_free_bodies() -> bool:
    """Return whether joints of a model as it is written can be replaced."""
    return _version() >= (3, 3)


def spec_text(spec: Any) -> str:
    """Return the MJCF of a model that was changed."""
    if _version() < (3, 3, 1):  # what has not been compiled cannot be written there
        spec.compile()
    return str(spec.to_xml())


def spec_item(spec: Any, m: Any, what: str, name: str) -> Any:
    """Return a joint, a body or an actuator of a model as it is written, by its name; ``m`` is the model compiled."""
    if _version() >= (3, 3):
        item = getattr(spec, what)(name)
        return _unnamed(spec, m, what, name) if item is None else item
    if what == "actuator":
        return next(a for a in spec.actuators if a.name == name)
    import mujoco

    kind = mujoco.mjtObj.mjOBJ_BODY if what == "body" else mujoco.mjtObj.mjOBJ_JOINT
    k = mujoco.mj_name2id(m, kind, name)
    at = k if what == "body" or k < 0 else int(m.jnt_bodyid[k])
    item = _old_body(spec, m, at) if at >= 0 else None
    if what == "joint" and item is not None:
        item = _nth(item, "joint", k - int(m.body_jntadr[at]))
    if item is None or item.name != name:  # static bodies are fused, say
        raise SimulatorRunError(
            f"MuJoCo {mujoco.__version__} does not find the {what} {name!r} in the model file.",
            "a name for each body and joint, and no bodies fused when the model is compiled",
            "Install MuJoCo 3.3 or newer.",
        )
    return item


def _unnamed(spec: Any, m: Any, what: str, name: str) -> Any:
    """Return the unnamed elements, which pamid names by their numbers."""
    items = list({"body": spec.bodies, "joint": spec.joints, "actuator": spec.actuators}[what])
    count, k = {"body": m.nbody, "joint": m.njnt, "actuator": m.nu}[what], name.removeprefix(what)
    if len(items) != count or not k.isdigit() or items[int(k)].name:  # static bodies are fused, say
        raise SimulatorRunError(
            f"The {what} that pamid calls {name!r} has no name in the model file, so it is not found there.",
            f"a name for each {what}",
            "Name it in the model file.",
        )
    return items[int(k)]


def geoms_of(body: Any, m: Any) -> list[Any]:
    """Return the geoms of a body of a model as it is written; ``m`` is the model compiled."""
    if _version() >= (3, 3):
        return list(body.geoms)
    import mujoco

    count = m.body_geomnum[mujoco.mj_name2id(m, mujoco.mjtObj.mjOBJ_BODY, body.name)]
    return [_nth(body, "geom", k) for k in range(int(count))]


def _old_body(spec: Any, m: Any, k: int) -> Any:
    """Return a body by its number, down from the world."""
    if k == 0:
        return spec.worldbody
    parent = int(m.body_parentid[k])
    siblings = [b for b in range(1, m.nbody) if m.body_parentid[b] == parent]
    return _nth(_old_body(spec, m, parent), "body", siblings.index(k))


def _nth(body: Any, what: str, n: int) -> Any:
    """Return a part of a body. MuJoCo 3.2.0 crashes if it is asked for the first of none, so only what is there is."""
    part = getattr(body, f"first_{what}")()
    for _ in range(n):
        part = getattr(body, f"next_{what}")(part)
    return part
