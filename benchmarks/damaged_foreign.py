"""What becomes of damaged FMUs and MuJoCo files: an answer or an error of three sentences, within limits, nothing left.

Bytes are cut off, changed, lost, doubled or zeroed; so are the numbers, attributes and elements of XML. Which, is drawn
with a fixed seed. Each file is evaluated as on the command line.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import gc
import io
import os
import re
import sys
import tempfile
import time
import warnings
import zipfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.append(str(Path(__file__).resolve().parents[1]))

import numpy as np
import pandas as pd

from pamid.cli import main as command
from pamid.export.ode_fmu import ode_fmu

MOST = 75.0
"""Most seconds for a file: a MuJoCo file may take 30 s of processor time in a process that gets half a processor."""
GOOD = ("answered", "refused")
NUMBERS = ("nan", "inf", "-1", "0", "1e308", "1e-308", "99999999999999999999", "", "1 2 3", "x", "../../x", "é")
ARM = """<mujoco><compiler angle="radian" autolimits="true"/><worldbody>
<body><joint name="pan" axis="0 1 0" range="-1.9 1.9" armature="0.05"/>
<geom type="capsule" fromto="0 0 0 0 0 -.2" size=".02" mass=".4" contype="0"/>
<body pos="0 0 -.2"><joint name="flex" axis="0 1 0" range="-1.7 1.7" armature="0.03"/>
<geom type="capsule" fromto="0 0 0 0 0 -.2" size=".02" mass=".2" contype="0"/></body></body></worldbody><actuator>
<position name="pan_servo" joint="pan" kp="20" kv="1"/><motor name="flex_motor" joint="flex" gear="10"/></actuator>
</mujoco>"""
WORDS = {
    "mujoco": (
        ('type="capsule"', ('type="mesh"', 'type="hfield"', 'type="plane"', 'type="sdf"')),
        ("<joint ", ('<joint type="ball" ', '<joint type="free" ', '<joint type="slide" ', "<freejoint ")),
        ("<position", ("<general", "<muscle", "<damper", "<adhesion", "<intvelocity", "<cylinder")),
    ),
    "fmu": (
        ('"output"', ('"local"', '"independent"', '"parameter"')),
        ('"continuous"', ('"discrete"', '"fixed"', '"constant"')),
        ("<Real", ("<Integer", "<Boolean", "<String", "<Enumeration")),
    ),
}
"""Words of a healthy file, and those that take their place."""


class Damaged(NamedTuple):
    """A damaged file: what was done to it, and what it holds."""

    damage: str
    content: bytes


def damaged_bytes(whole: bytes, k: int, rng: np.random.Generator, first: int = 8) -> Damaged:
    """Return a file that is cut off, or of which bytes are changed, lost, doubled or zeros, behind its first bytes."""
    data = bytearray(whole)
    at = int(rng.integers(first, len(data)))
    some = int(rng.integers(1, 40))
    match k % 6:
        case 0:
            return Damaged(f"cut off at {at}", bytes(data[:at]))
        case 1 | 2:
            places = rng.integers(first, len(data), rng.integers(1, 4))
            for place in places:
                data[place] ^= int(rng.integers(1, 256))
            return Damaged(f"bytes changed at {places.tolist()}", bytes(data))
        case 3:
            del data[at : at + some]
            return Damaged(f"{some} bytes lost at {at}", bytes(data))
        case 4:
            data[at:at] = data[at : at + some]
            return Damaged(f"{some} bytes doubled at {at}", bytes(data))
    data[at : at + some] = bytes(len(data[at : at + some]))
    return Damaged(f"zeros for {some} bytes at {at}", bytes(data))


def damaged_xml(kind: str, text: str, rng: np.random.Generator) -> Damaged:
    """Return an XML file with one to three other numbers, words, attributes or elements."""
    done = []
    for _ in range(rng.integers(1, 4)):
        what, pattern = (
            ("number", r'(?<=[" ])-?\d*\.?\d+(?=[" ])'), ("attribute lost", r'\w+="[^"]*"'),
            ("element doubled", r"<[A-Za-z]+ [^>]*>"), ("value", r'(?<==")[^"]*'), ("word", ""),
        )[rng.integers(5)]  # fmt: skip
        old, new = WORDS[kind][rng.integers(3)]
        places = list(re.finditer(pattern or re.escape(old), text))
        if not places:
            continue
        at = places[rng.integers(len(places))]
        put = {"attribute lost": "", "element doubled": 2 * at.group(), "word": str(rng.choice(new))}
        more = put.get(what, NUMBERS[rng.integers(len(NUMBERS))])
        text = text[: at.start()] + more + text[at.end() :]
        done.append(f"{what} at {at.start()}: {at.group()[:40]} is {more[:40]}")
    return Damaged("; ".join(done), text.encode())


def damaged(kind: str, number: int, seed: int = 0) -> Iterator[Damaged]:
    """Make damaged files of a kind, ``"mujoco"`` or ``"fmu"``; of an FMU, the archive, its XML or its code."""
    rng = np.random.default_rng(seed)
    for k in range(number):
        if kind == "mujoco":
            yield damaged_bytes(ARM.encode(), k // 3, rng) if k % 3 == 0 else damaged_xml(kind, ARM, rng)
            continue
        with zipfile.ZipFile(io.BytesIO(healthy("fmu"))) as whole:
            parts = {name: whole.read(name) for name in whole.namelist()}
        [library] = (name for name in parts if name.startswith("binaries/"))
        if k % 3 == 0:
            yield damaged_bytes(healthy("fmu"), k // 3, rng)
            continue
        name = "modelDescription.xml" if k % 3 == 1 else library
        found = damaged_xml(kind, parts[name].decode(), rng) if k % 3 == 1 else damaged_bytes(parts[name], k // 3, rng)
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w") as again:
            for entry, data in (parts | {name: found.content}).items():
                again.writestr(entry, data)
        yield Damaged(f"{name}: {found.damage}", packed.getvalue())


@functools.cache
def healthy(kind: str) -> bytes:
    """Return the healthy file of a kind."""
    if kind == "mujoco":
        return ARM.encode()
    return ode_fmu(
        "motor", lambda t, x, u, p: [x.w, (p.k * u.volts - p.d * x.w) / p.J], {"phi": 0.0, "w": 0.0}, {"volts": 0.0},
        {"k": 0.05, "J": 2e-3, "d": 1e-3}, outputs=lambda t, x, u, p: {"angle": x.phi, "speed": x.w},
        units={"volts": "V", "angle": "rad", "speed": "rad/s"},
    )  # fmt: skip


@functools.cache
def log(kind: str) -> pd.DataFrame:
    """Return a log of what the healthy file of a kind stands for."""
    t = 0.02 * np.arange(60)
    if kind == "fmu":
        return pd.DataFrame({"time": t, "volts": np.sin(t), "angle": 0.1 * np.sin(t), "speed": 0.1 * np.cos(t)})
    import mujoco

    m = mujoco.MjModel.from_xml_string(ARM)
    d, rows = mujoco.MjData(m), []
    for now in t:
        d.ctrl[:] = 0.5 * np.sin(now), 0.01 * np.cos(now)
        rows.append([now, *d.ctrl, *d.qpos, *d.qvel])
        mujoco.mj_step(m, d, nstep=10)
    names = ["time", "pan_servo", "flex_motor", "pan_q", "flex_q", "pan_dq", "flex_dq"]
    return pd.DataFrame(rows, columns=names)


def _write(kind: str, content: bytes, folder: Path) -> None:
    log(kind).to_csv(folder / "log.csv", index=False)
    (folder / f"sim.{kind}").write_bytes(content)
    page = f'kind = "{kind}"\n[{kind}]\n{"model" if kind == "mujoco" else "fmu"} = "sim.{kind}"\n'
    (folder / "sim.toml").write_text(page + ("seconds = 5\n" if kind == "fmu" else ""))


def outcome(kind: str, content: bytes, folder: Path) -> str:
    """Return how a file was taken: answered, refused, or what is wrong."""
    rooms = [folder / name for name in ("files", "here", "temporary")]
    for room in rooms:
        room.mkdir(parents=True)
    _write(kind, content, rooms[0])
    out, err, before, known = io.StringIO(), io.StringIO(), Path.cwd(), tempfile.tempdir
    argv = ["evaluate", str(rooms[0] / "log.csv"), "--sim", str(rooms[0] / "sim.toml"), "--quiet", "--trust"]
    begun = time.monotonic()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        os.chdir(rooms[1])
        tempfile.tempdir = str(rooms[2])
        try:
            code = command(argv)
        except BaseException as error:
            return f"raised {type(error).__name__}: {error}"
        finally:
            os.chdir(before)
            tempfile.tempdir = known
    took, told = time.monotonic() - begun, err.getvalue()
    gc.collect()  # the process of an FMU ends with its simulator
    left = {str(path.relative_to(folder)) for room in rooms for path in room.iterdir()}
    left -= {f"files/{name}" for name in ("log.csv", "sim.toml", f"sim.{kind}")}
    if "inside pamid" in told or "Traceback" in told or code not in (0, 2, 3):
        return f"inside pamid: {code}, {told[-600:]}"
    if code == 2 and not re.search(r"^pamid: error: \S.*\. Expected \S.*\. \S.*\.", told):
        return f"no three sentences: {told}"
    if left:
        return f"left {', '.join(sorted(left))}"
    return f"took {took:.0f} s" if took > MOST else "refused" if code == 2 else "answered"


def outcomes(kind: str, number: int, folder: Path, seed: int = 0) -> dict[str, str]:
    """Return the outcomes of damaged files, by their damage."""
    found = {"nothing": outcome(kind, healthy(kind), folder / "healthy")}
    for k, file in enumerate(damaged(kind, number, seed)):
        found[f"{k}: {file.damage}"] = outcome(kind, file.content, folder / str(k))
    return found


def main(argv: list[str] | None = None) -> None:
    """Print how many files came to which end."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--number", type=int, default=200, help="files of each kind (default: 200)")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args(argv)
    for kind, name in (("mujoco", "MuJoCo files"), ("fmu", "FMUs")):
        with tempfile.TemporaryDirectory() as folder:
            found = outcomes(kind, args.number, Path(folder), args.seed)
        del found["nothing"]
        counts = Counter(said if said in GOOD else "wrong" for said in found.values())
        print(f"{len(found)} damaged {name}: " + ", ".join(f"{counts[k]} {k}" for k in (*GOOD, "wrong")), flush=True)
        for damage, said in found.items():
            if said not in GOOD:
                print(f"  {damage}: {said}")


if __name__ == "__main__":
    main()
