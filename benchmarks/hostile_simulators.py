"""What becomes of hostile and broken simulators of every kind: refused in a line, within limits, and nothing ran.

Every case is a folder with a simulator and a log, evaluated as on the command line. Code runs only where the case
trusts it.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import struct
import sys
import tempfile
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")
if __package__ in (None, ""):
    sys.path[0] = str(Path(__file__).resolve().parents[1])

import numpy as np
import pandas as pd

from pamid.cli import main as command

CANARY = "canary"
"""File that code of a simulator would make."""
SECONDS = 40.0
"""Most seconds of processor time for one case: a model that is compiled in a process of its own has 30 s."""


class Hostile(NamedTuple):
    """A simulator.

    Parameters
    ----------
    kind, what : str
        Kind of the simulator; what is wrong with it.
    files : dict of str to str or bytes
        Its files; ``sim.toml``, or the only one, is named on the command line.
    trust : bool
        Whether its code may run.
    """

    kind: str
    what: str
    files: dict[str, str | bytes]
    trust: bool = False

    @property
    def name(self) -> str:
        """What it is called."""
        return f"{self.kind}: {self.what}"


def write_log(folder: Path) -> None:
    """Write a log that has columns for each kind of simulator."""
    t = np.arange(0, 2, 0.01)
    x = 0.1 * np.sin(3 * t)
    rng = np.random.default_rng(0)
    table = {
        "trajectory": "a", "time": t, "u": np.sin(t), "F": np.cos(t), "x": x + 1e-5 * rng.standard_normal(200),
        "v": 0.3 * np.cos(3 * t), "y": x, "hinge_q": x, "hinge_dq": 0.3 * np.cos(3 * t), "q": x,
        "P1": 3e5 + 1e4 * x, "P2": 3e5 - 1e4 * x, "F1": 50 + x, "F2": 50 - x,
    }  # fmt: skip
    pd.DataFrame(table).to_csv(folder / "log.csv", index=False)


# --- the corpus -----------------------------------------------------------------------------------------------------
_ARM = '<body name="arm"><joint name="hinge"/><geom size="0.1" mass="1"/>{inside}</body>'


def _mjcf(above: str = "", inside: str = "", beside: str = "") -> dict[str, str | bytes]:
    return {"arm.xml": f"<mujoco>{above}<worldbody>{_ARM.format(inside=inside)}{beside}</worldbody></mujoco>"}


def mujoco_files() -> Iterator[Hostile]:
    """Models without limit, and invalid ones."""
    entity = '<?xml version="1.0"?><!DOCTYPE m [<!ENTITY a "aaaaaaaaaa">' + "".join(
        f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in zip("abcdefgh", "bcdefghi", strict=True)
    )
    for what, files in {
        "height field of 10^10 points": _mjcf(
            '<asset><hfield name="h" nrow="100000" ncol="100000" size="1 1 1 1"/></asset>',
            '<geom type="hfield" hfield="h"/>'),
        "2e9 keys": _mjcf('<size nkey="2000000000"/>'),
        "2e9 user numbers": _mjcf('<size nuser_body="2000000000"/>'),
        "900 GB": _mjcf('<size memory="900G"/>'),
        "replicas of replicas": _mjcf(
            beside='<replicate count="1000" offset="1 0 0">' * 4 + '<geom size="0.1"/>' + "</replicate>" * 4),
        "sensor of 2e9 numbers": _mjcf('<sensor><user name="s" dim="2000000000"/></sensor>'),
        "includes /dev/zero": _mjcf('<include file="/dev/zero"/>'),
        "includes itself": _mjcf('<include file="arm.xml"/>'),
        "mesh of /dev/zero": _mjcf('<asset><mesh name="m" file="/dev/zero"/></asset>', '<geom type="mesh" mesh="m"/>'),
        "entities of entities": {"arm.xml": entity + "]><mujoco>&i;</mujoco>"},
        "not XML": {"arm.xml": "mujoco"},
        "empty": {"arm.xml": ""},
        "random bytes": {"arm.xml": np.random.default_rng(0).bytes(2000)},
        "NUL": {"arm.xml": "<mujoco>\x00</mujoco>"},
        "other XML": {"arm.xml": "<svg><rect/></svg>"},
        "no joint": {"arm.xml": "<mujoco><worldbody/></mujoco>"},
        "free joint": {"arm.xml": '<mujoco><worldbody><body><freejoint/><geom size="1"/></body></worldbody></mujoco>'},
        "mass NaN": _mjcf(inside='<body><joint name="b"/><inertial pos="0 0 0" mass="nan"/></body>'),
        "mass 0": {"arm.xml": '<mujoco><worldbody><body><joint name="hinge"/></body></worldbody></mujoco>'},
        "two joints of one name": _mjcf(inside='<body><joint name="hinge"/><geom size="0.1"/></body>'),
        "plugin": _mjcf('<extension><plugin plugin="no.such.plugin"/></extension>'),
        "actuator of nothing": _mjcf().copy() | {
            "arm.xml": _mjcf()["arm.xml"].replace("</mujoco>", '<actuator><motor joint="no"/></actuator></mujoco>')},
    }.items():  # fmt: skip
        yield Hostile("mujoco", what, files)


def _page(kind: str, table: str, ports: str, more: str = "") -> str:
    return f'kind = "{kind}"\n[{kind}]\n{table}\n[ports]\n{ports}\n{more}'


_ODE = 'F = { kind = "input", unit = "N" }\nx = { kind = "state", unit = "m" }\nv = { kind = "state", unit = "m/s" }'
_OUT = 'u = { kind = "input" }\ny = { kind = "output" }'


def functions() -> Iterator[Hostile]:
    """Code that may not run, and code that may and fails."""
    page = _page("ode", 'function = "cart.py:rates"', _ODE)
    touch = f"import pathlib; pathlib.Path(__file__).with_name('{CANARY}').touch()\n"
    rates = "def rates(t, x, u, p):\n    {}\n"
    yield Hostile("function", "runs without trust", {"sim.toml": page, "cart.py": touch + rates.format("return x")})
    yield Hostile("function", "os.system without trust", {"sim.toml": page.replace("cart.py:rates", "os:system")})
    for body in (
        "raise ValueError('no')", "raise SystemExit(0)", "raise KeyError(t)", "import os; os.chdir('/nowhere')",
        "return None", "return 'ab'", "return [x.v]", "return [x.v, 1j]", "return [float('nan')] * 2",
        "return [float('inf')] * 2", "return [x.v, u.F, u.F]", "return rates(t, x, u, p)", "return [x.v, p.nosuch]",
        "return [x.v, x.nosuch]", "return [x.v, 1 / 0]", "return {'x': x.v}", "return {'x': x.v, 'w': x.v}",
        "return [object(), object()]", "return [[x.v] * 3] * 2", "import itertools; return itertools.repeat(1.0)",
        "yield x.v", "return lambda: 0", "return [x.v, 10 ** 400]", "assert False",
    ):  # fmt: skip
        yield Hostile("function", body, {"sim.toml": page, "cart.py": rates.format(body)}, True)
    for what, code in {
        "no such function": "def other(): pass\n", "a number": "rates = 3\n", "syntax": "def rates(:\n",
        "exits": "raise SystemExit(0)\n", "two arguments": "def rates(a, b):\n    return 1\n",
        "a class": "class rates:\n    pass\n", "NUL": "\x00", "not UTF-8": b"\xff\xfe\x00rates",
    }.items():  # fmt: skip
        yield Hostile("function", what, {"sim.toml": page, "cart.py": code}, True)
    yield Hostile("function", "no file", {"sim.toml": page}, True)


def equations() -> Iterator[Hostile]:
    """Text that is no equation, or one without an answer."""
    for text in (
        "__import__('os').system('touch canary')", "().__class__", "u.real", "u[0]", "f'{u}'", "lambda: u",
        "[u for u in u]", "open('x')", "9**9**9**9", "9" * 400, "0x" + "f" * 300, "-" * 1800 + "u", "(" * 900 + "u",
        "1j*u", "u +", "u; u", "u = 3", "u if u else 1", "sqrt(-1 - u**2)", "log(-1 - u**2)", "u/(u - u)",
        "exp(exp(100 + u))", "nosuch*u", "sin(u, u, u)", "sin", "u @ u", "'u'", "None", "True and u", "import os",
        "y", "u" + "+u" * 1500,
    ):  # fmt: skip
        rows = f"y = {json.dumps(text)}"
        yield Hostile("equations", text[:40], {"sim.toml": _page("equations", rows, _OUT)})


def control() -> Iterator[Hostile]:
    """Invalid systems of python-control."""
    page = _page("control", 'system = "plant.py:system"', 'u0 = { kind = "input", column = "u" }')
    touch = f"import pathlib; pathlib.Path(__file__).with_name('{CANARY}').touch()\n"
    yield Hostile("control", "runs without trust", {"sim.toml": page, "plant.py": touch})
    for what, code in {
        "raises": "def system():\n    raise ValueError('no')\n",
        "exits": "def system():\n    raise SystemExit(0)\n",
        "an argument": "def system(p):\n    return p\n",
        "a number": "def system():\n    return 3\n",
        "None": "def system():\n    return None\n",
        "improper": "import control\nsystem = control.tf([1, 2, 3], [1])\n",
        "NaN": "import control\nsystem = control.ss([[float('nan')]], [[1]], [[1]], [[0]])\n",
        "a list": "system = [1, 2]\n",
        "nothing": "\n",
        "syntax": "system = (\n",
        "itself": "def system():\n    return system()\n",
        "infinite": "import control\nsystem = control.ss([[float('inf')]], [[1]], [[1]], [[0]])\n",
    }.items():
        yield Hostile("control", what, {"sim.toml": page, "plant.py": code}, True)


def _zip(entries: dict[str, bytes]) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in entries.items():
            archive.writestr(name, content)
    return data.getvalue()


def fmus() -> Iterator[Hostile]:
    """Archives that are no FMU, unfold to too much, or name what lies outside of them."""
    description = (
        '<fmiModelDescription fmiVersion="2.0" modelName="a" guid="1"><CoSimulation modelIdentifier="a"/>'
        '<ModelVariables><ScalarVariable name="y" valueReference="0" causality="output"><Real/></ScalarVariable>'
        "</ModelVariables><ModelStructure/></fmiModelDescription>"
    )
    library, plain = "binaries/linux64/a.so", description.encode()
    bomb = ('<?xml version="1.0"?><!DOCTYPE m [<!ENTITY a "aaaaaaaaaa">' + "".join(
        f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in zip("abcdefgh", "bcdefghi", strict=True)
    ) + "]><m>&i;</m>").encode()  # fmt: skip
    for what, data in {
        "empty": b"", "text": b"fmu", "random bytes": np.random.default_rng(1).bytes(3000),
        "no description": _zip({"x": b"y"}), "description is no XML": _zip({"modelDescription.xml": b"<fmi"}),
        "other XML": _zip({"modelDescription.xml": b"<svg/>"}), "entities": _zip({"modelDescription.xml": bomb}),
        "no binary": _zip({"modelDescription.xml": plain}),
        "binary of zeros": _zip({"modelDescription.xml": plain, library: bytes(4096)}),
        "binary of text": _zip({"modelDescription.xml": plain, library: b"#!/bin/sh\ntouch canary\n"}),
        "version 7": _zip({"modelDescription.xml": plain.replace(b'"2.0"', b'"7.0"'), library: b"x"}),
        "path outside": _zip({"modelDescription.xml": plain, f"../../{CANARY}": b"x", library: b"x"}),
        "absolute path": _zip({"modelDescription.xml": plain, f"/tmp/{CANARY}-fmu": b"x", library: b"x"}),
        "identifier outside": _zip({"modelDescription.xml": plain.replace(b'"a"', b'"../../x"'), library: b"x"}),
        "2 GB of zeros": _zip({"modelDescription.xml": plain, "z": bytes(300_000_000), library: b"x"}),
        "cut": _zip({"modelDescription.xml": plain, library: b"x" * 3000})[:200],
        "a false size": _zip({"modelDescription.xml": plain, library: bytes(900)}).replace(
            struct.pack("<I", 900), struct.pack("<I", 2**31 - 1)),
    }.items():  # fmt: skip
        yield Hostile("fmu", what, {"a.fmu": data}, True)
    yield Hostile("fmu", "without trust", {"a.fmu": _zip({"modelDescription.xml": plain, library: bytes(4096)})})


def benches() -> Iterator[Hostile]:
    """Simulator files of a bench with invalid numbers, tables and effects, and files that are no TOML."""
    from pamid.bench import BenchParameters

    with tempfile.TemporaryDirectory() as folder:
        BenchParameters.for_muscle("B").to_toml(Path(folder) / "sim.toml")
        healthy = (Path(folder) / "sim.toml").read_text(encoding="utf-8")
    import re

    def changed(value: str) -> str:
        return re.sub(r"(?m)^rest_length = \S+", f"rest_length = {value}", healthy, count=1)

    for value in ("nan", "inf", "-0.2", "0.0", '"0.2"', "true", "[0.2]", "{ a = 1 }", "9" * 400, "1e308", "200.0"):
        yield Hostile("bench", f"rest_length = {value[:20]}", {"sim.toml": changed(value)})
    for what, text in {
        "unknown table": healthy + "\n[nosuch]\na = 1\n", "unknown number": healthy + "\n[tolerance]\nnosuch = 0.1\n",
        "unknown effect": healthy + '\n[[effects]]\nname = "rust"\n',
        "effect of a number": healthy + '\n[[effects]]\nname = "leakage"\nconductance = nan\n',
        "effects is text": 'effects = "leakage"\n' + healthy, "not TOML": healthy + "\n= = =\n",
        "twice": healthy + healthy, "empty": "", "half": healthy[: len(healthy) // 2] + '"', "deep": "a=" + "[" * 5000,
        "NUL": healthy + "\x00", "unknown kind": 'kind = "nosuch"\n', "kind is a number": "kind = 3\n",
        "a folder outside": 'kind = "mujoco"\n[mujoco]\nmodel = "/etc/passwd"\n',
        "100 MB": "# " + "x" * 100_000_000,
    }.items():  # fmt: skip
        yield Hostile("bench", what, {"sim.toml": text})
    yield Hostile("bench", "not UTF-8", {"sim.toml": b"\xff\xfe" + healthy.encode("utf-16")})


KINDS: tuple[Callable[[], Iterator[Hostile]], ...] = (mujoco_files, functions, equations, control, fmus, benches)


def corpus() -> list[Hostile]:
    """Return all of them."""
    return [case for kind in KINDS for case in kind()]


# --- the judge ------------------------------------------------------------------------------------------------------
def judged(case: Hostile, folder: Path) -> str:
    """Return how a simulator was taken: refused, told, silent, inside pamid, ran, left files, or over its time."""
    for name, content in case.files.items():
        data = content if isinstance(content, bytes) else content.encode()
        (folder / name).write_bytes(data)
    write_log(folder)
    before = {p.name for p in folder.iterdir()}
    sim = folder / ("sim.toml" if "sim.toml" in case.files else next(iter(case.files)))
    out, err, begun, here = io.StringIO(), io.StringIO(), _processor(), Path.cwd()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        os.chdir(folder)
        try:
            code = command(["evaluate", str(folder / "log.csv"), "--sim", str(sim), "--json", "--quiet",
                            *(["--trust"] if case.trust else [])])  # fmt: skip
        except BaseException as error:
            return f"raised {type(error).__name__}: {error}"
        finally:
            os.chdir(here)
    told = err.getvalue()
    if _processor() - begun > SECONDS:
        return "over its time"
    if "inside pamid" in told or "Traceback" in told or code not in (0, 2, 3):
        return f"inside pamid: {told[:300]}"
    if (folder / CANARY).exists() or Path(f"/tmp/{CANARY}-fmu").exists() or (folder.parent / CANARY).exists():
        return "ran or wrote outside"
    if extra := {p.name for p in folder.iterdir()} - before - {"__pycache__"}:
        return f"left {', '.join(sorted(extra))}"
    if code == 0:
        return "told" if told.strip() else f"silent: {out.getvalue()[:200]}"
    return "refused" if told.strip() and len(told) < 2000 and not out.getvalue() else f"silent: exit {code}"


def _processor() -> float:
    """Return the processor time of this process and of those that it has waited for, s."""
    t = os.times()
    return t.user + t.system + t.children_user + t.children_system


GOOD = ("refused", "told")
"""What may become of a hostile simulator."""


def main() -> int:
    """Print how many simulators came to which end."""
    counts: Counter[tuple[str, str]] = Counter()
    cases = corpus()
    for case in cases:
        with tempfile.TemporaryDirectory() as folder:
            said = judged(case, Path(folder))
        counts[case.kind, said.partition(":")[0]] += 1
        if said not in GOOD:
            print(f"{case.name}: {said}", flush=True)
    ends = Counter(said for (_, said), n in counts.items() for _ in range(n))
    print(f"{len(cases)} hostile or broken simulators: " + ", ".join(f"{n} {said}" for said, n in ends.items()))
    kinds = Counter(case.kind for case in cases)
    print(", ".join(f"{kind} {n}" for kind, n in kinds.items()))
    return int(any(said not in GOOD for said in ends))


if __name__ == "__main__":
    raise SystemExit(main())
