"""Loading an untrusted MuJoCo model: loaded in a separate process first, unless it is clearly small."""

from __future__ import annotations

import contextlib
import subprocess
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..errors import SimulatorNotFoundError, SimulatorRunError, SimulatorSyntaxError, needs
from .mujoco_free import with_joints
from .workers import ended, started

MOST_BYTES = 50_000_000
MEMORY, SECONDS = 4 * 2**30, 30
"""Bytes and processor seconds within which a model must load."""
COMPILED: dict[Path, Any] = {}
"""Models that this process has compiled already."""
_STREAMS = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
_PLAIN_BYTES = 200_000
_PLAIN_ITEMS = 500
"""Elements of a model that is loaded in this process at once: at worst all are joints, which takes about 2 s."""
_PLAIN_TAGS = frozenset(
    [
        "mujoco",
        "compiler",
        "option",
        "flag",
        "worldbody",
        "body",
        "joint",
        "freejoint",
        "geom",
        "site",
        "light",
        "inertial",
        "actuator",
        "motor",
        "position",
        "velocity",
        "sensor",
        "jointpos",
        "jointvel",
        "actuatorfrc",
        "jointactuatorfrc",
        "default",
    ]
)
_PLAIN_WORDS = frozenset(
    [
        "name",
        "class",
        "childclass",
        "model",
        "angle",
        "autolimits",
        "eulerseq",
        "timestep",
        "integrator",
        "gravity",
        "density",
        "iterations",
        "solver",
        "cone",
        "pos",
        "quat",
        "euler",
        "axisangle",
        "zaxis",
        "axis",
        "range",
        "ref",
        "springref",
        "damping",
        "stiffness",
        "armature",
        "frictionloss",
        "limited",
        "type",
        "size",
        "mass",
        "fromto",
        "rgba",
        "contype",
        "conaffinity",
        "group",
        "friction",
        "margin",
        "solref",
        "solimp",
        "condim",
        "diaginertia",
        "fullinertia",
        "joint",
        "gear",
        "ctrlrange",
        "ctrllimited",
        "forcerange",
        "forcelimited",
        "kp",
        "kv",
        "noise",
        "cutoff",
        "actuator",
        "contact",
        "dir",
        "directional",
    ]
)
_PLAIN_SHAPES = frozenset(["plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "hinge", "slide", "free"])


def mujoco_module() -> Any:
    """Return the package mujoco, kept from writing its log into the user's folder."""
    with needs("MuJoCo", "mujoco", "mujoco"):
        import mujoco
    if not getattr(mujoco, "_pamid_quiet", False):
        # Without a handler MuJoCo appends each warning to MUJOCO_LOG.TXT; pamid itself reports values that are not
        # finite.
        mujoco.set_mju_user_warning(_silent)
        mujoco._pamid_quiet = True
    return mujoco


def _silent(message: str) -> None:
    """Suppress a warning of MuJoCo."""


def loaded_model(path: Path) -> Any:
    """Return the model of an MJCF file."""
    mj = mujoco_module()
    if path in COMPILED:
        return COMPILED.pop(path)
    if not path.is_file():
        raise SimulatorNotFoundError(f"{path} does not exist.", "an MJCF file", "Check the path.")
    if path.stat().st_size > MOST_BYTES:
        raise SimulatorSyntaxError(f"{path} holds {path.stat().st_size:,} bytes.", "an MJCF file", "Check the path.")
    if not _plainly_small(path):
        return _by_trial(path, mj)
    try:
        model = with_joints(path, mj.MjModel.from_xml_path(str(path)))
        mj.mj_forward(model, mj.MjData(model))
        return model
    except (ValueError, mj.FatalError, mj.UnexpectedError) as error:
        raise _no_mjcf(path, str(error)) from None


def given_state(path: Path, m: Any) -> int:
    """Return the given part of a model's state: positions, speeds, commands and forces at joints."""
    kinds = mujoco_module().mjtState
    spec = kinds.mjSTATE_QPOS | kinds.mjSTATE_QVEL | kinds.mjSTATE_CTRL | kinds.mjSTATE_QFRC_APPLIED
    if mujoco_module().mj_stateSize(m, spec) != 3 * m.nv + m.nu:
        raise SimulatorSyntaxError(
            f"{path} has states other than those of its joints.", "only joints and inputs", "Leave them out."
        )
    return int(spec)


@contextlib.contextmanager
def running(path: Path) -> Iterator[None]:
    """Raise `SimulatorRunError` where MuJoCo stops in the block, as on more contacts than it has memory for."""
    mj = mujoco_module()
    try:
        yield
    except (mj.FatalError, mj.UnexpectedError) as error:
        raise SimulatorRunError(
            f"MuJoCo failed in {path}: {' '.join(str(error).split())}.",
            "a model that runs at the states of the log",
            "Look at its contacts and at the log's units, or give it more memory (<size memory>).",
        ) from None


def _no_mjcf(path: Path, error: str) -> SimulatorSyntaxError:
    said = " ".join(error.split()).rstrip(".")
    return SimulatorSyntaxError(f"{path} is not valid MJCF: {said}.", "a model that MuJoCo loads", "Correct it.")


def _plainly_small(path: Path) -> bool:
    """Return whether a model cannot be larger than its text: it refers to no file and repeats nothing."""
    if path.stat().st_size > _PLAIN_BYTES:
        return False
    text = path.read_bytes()
    if b"<!" in text.replace(b"<!--", b""):  # entities expand
        return False
    try:
        root = ET.fromstring(text)
    except (ET.ParseError, ValueError, LookupError, RecursionError):
        return False
    items = list(root.iter())
    return (
        root.tag == "mujoco"
        and len(items) <= _PLAIN_ITEMS
        and all(
            item.tag in _PLAIN_TAGS
            and item.attrib.keys() <= _PLAIN_WORDS
            and (item.tag not in ("geom", "joint", "site") or item.get("type", "sphere") in _PLAIN_SHAPES)
            for item in items
        )
    )


def _by_trial(path: Path, mj: Any) -> Any:
    """Return the model as another process has compiled it."""
    with tempfile.TemporaryDirectory(prefix="pamid_mujoco_") as folder:
        out = Path(folder) / "model.mjb"
        said = [str(path.resolve()), str(out), str(MEMORY), str(SECONDS)]
        process = started("pamid.simulators.mujoco_trial", *said, **_STREAMS)
        try:
            text = process.communicate(timeout=2.0 * SECONDS)[0].decode("utf-8", errors="replace").strip()
        except subprocess.TimeoutExpired:
            raise _too_large(path) from None
        finally:
            ended(process)
        if process.returncode == 0 and out.is_file():
            return mj.MjModel.from_binary_path(str(out))
        if not text or "MemoryError" in text or "allocate" in text.lower():
            raise _too_large(path)
        raise _no_mjcf(path, text)


def _too_large(path: Path) -> SimulatorSyntaxError:
    return SimulatorSyntaxError(
        f"{path} cannot be loaded within {MEMORY / 2**30:g} GiB and {SECONDS} s of processor time.",
        "a model of ordinary size in plain files",
        "Look at the number of its elements, its height fields, meshes, flexcomp, replicate, size and include; "
        "leave out what pamid does not need.",
    )
