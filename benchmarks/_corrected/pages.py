"""Simulators of every kind as their users' files: the page and the code or model beside it."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.any_simulator import nominal
from benchmarks.any_simulator.plants import Plant
from benchmarks.any_simulator.tanks_fmu import build
from pamid.export.ode_fmu import ode_fmu

from .systems import DRIVE, RAIL

UNITS = {
    "x": "m", "v": "m/s", "force": "N", "m": "kg", "b": "N s/m", "k": "N/m", "volt": "V", "speed": "rad/s",
    "qm": "rad", "ql": "rad", "wm": "rad/s", "wl": "rad/s", "current": "A", "Jm": "kg m^2", "Jl": "kg m^2",
    "K": "N m/rad", "D": "N m s/rad", "kt": "N m/A",
}  # fmt: skip
SLIDE = """<mujoco><option gravity="0 0 0" integrator="RK4"/><worldbody><body name="cart">
<joint name="rail" type="slide" axis="1 0 0" stiffness="15" damping="3"/>
<inertial pos="0 0 0" mass="2" diaginertia="0.01 0.01 0.01"/></body></worldbody>
<actuator><motor name="force" joint="rail"/></actuator></mujoco>
"""


def write(kind: str, plant: Plant, folder: Path) -> Path:
    """Write the page of a system's nominal simulator, and what it names; return the page."""
    page = folder / "sim.toml"
    page.write_text(_WRITERS[kind, plant.name](plant, folder), encoding="utf-8")
    return page


def _tables(plant: Plant, ports: list[str]) -> str:
    numbers = [f'{n} = {{ value = {v!r}, tolerance = {tol!r}, unit = "{UNITS.get(n, "-")}" }}'
               for n, (v, tol) in plant.numbers.items() if n != "play"]  # fmt: skip
    return "\n".join(["[ports]", *ports, "[parameters]" if numbers else "", *numbers, ""])


def _signals(plant: Plant) -> list[str]:
    ports = [f'{n} = {{ kind = "input", unit = "{UNITS[n]}" }}' for n in plant.inputs]
    return ports + [f'{n} = {{ kind = "state", unit = "{UNITS[n]}" }}' for n in plant.states]


def _function(rates: Mapping[str, str], plant: Plant, folder: Path) -> str:
    """Return a page of rates as a Python function, made from their text."""
    names = {n: f"x.{n}" for n in plant.states} | {n: f"u.{n}" for n in plant.inputs}
    names |= {n: f"p.{n}" for n in plant.numbers}

    def said(text: str) -> str:
        return re.sub(r"[A-Za-z_]\w*", lambda w: names.get(w[0], w[0]), text)

    code = f"def rates(t, x, u, p):\n    return [{', '.join(map(said, rates.values()))}]\n"
    (folder / "plant.py").write_text(code, encoding="utf-8")
    return 'kind = "ode"\n[ode]\nfunction = "plant.py:rates"\n' + _tables(plant, _signals(plant))


def _equations(rates: Mapping[str, str], plant: Plant, folder: Path) -> str:
    rows = "\n".join(f'"{name}" = "{text}"' for name, text in rates.items())
    return f'kind = "equations"\n[equations]\n{rows}\n' + _tables(plant, _signals(plant))


def _control(plant: Plant, folder: Path) -> str:
    code = "import control\n\n\ndef system():\n    return control.tf([2.5], [0.3, 1.0])\n"
    (folder / "plant.py").write_text(code, encoding="utf-8")
    ports = ['u0 = { kind = "input", unit = "V", column = "volt" }',
             'y0 = { kind = "output", unit = "rad/s", column = "speed" }']  # fmt: skip
    return 'kind = "control"\n[control]\nsystem = "plant.py:system"\n[ports]\n' + "\n".join(ports)


def _cylinder(plant: Plant, folder: Path) -> str:
    code = "from typing import Any\n\nimport numpy as np\n\n\n" + inspect.getsource(nominal.cylinder_rates)
    (folder / "plant.py").write_text(code, encoding="utf-8")
    ports = ['valve = { kind = "input" }', 'load = { kind = "input", unit = "N" }',
             *(f'{n} = {{ kind = "input", unit = "kg/s" }}' for n in ("w1", "w2")),
             *(f'{n} = {{ kind = "state", unit = "{u}" }}' for n, u in
               {"s": "m", "v": "m/s", "p1": "Pa", "p2": "Pa"}.items()),
             'rod = { kind = "joint", unit = "N", position = "s", velocity = "v", through = "load" }',
             'chamber1 = { kind = "chamber", level = "p1", through = "w1" }',
             'chamber2 = { kind = "chamber", level = "p2", through = "w2" }']  # fmt: skip
    return 'kind = "ode"\n[ode]\nfunction = "plant.py:cylinder_rates"\n' + _tables(plant, ports)


def _servo(plant: Plant, folder: Path) -> str:
    (folder / "arm.xml").write_text(nominal.ARM, encoding="utf-8")
    mass = '[parameters]\n"body_mass.arm" = { value = 0.5, tolerance = 0.05, unit = "kg" }\n'
    return 'kind = "mujoco"\n[mujoco]\nmodel = "arm.xml"\n' + mass


def _slide(plant: Plant, folder: Path) -> str:
    (folder / "slide.xml").write_text(SLIDE, encoding="utf-8")
    named = {"rail_q": ("m", "x"), "rail_dq": ("m/s", "v")}
    ports = [f'{n} = {{ kind = "state", unit = "{unit}", column = "{c}" }}' for n, (unit, c) in named.items()]
    return "\n".join(['kind = "mujoco"', "[mujoco]", 'model = "slide.xml"', "[ports]", *ports, ""])


def _tanks(plant: Plant, folder: Path) -> str:
    build(folder)
    ports = [f'{n} = {{ kind = "state", start = 3.0 }}' for n in ("h1", "h2")]
    return 'kind = "fmu"\n[fmu]\nfmu = "tanks.fmu"\n' + _tables(plant, ports)


def _rail_fmu(plant: Plant, folder: Path) -> str:
    def rates(t: Any, x: Any, u: Any, p: Any) -> Any:
        return [x.v, (u.force - p.b * x.v - p.k * x.x) / p.m]

    numbers = {n: v for n, (v, _) in plant.numbers.items()}
    made = ode_fmu("rail", rates, {"x": 0.0, "v": 0.0}, {"force": 0.0}, numbers,
                   lambda t, x, u, p: {"pos": x.x, "vel": x.v}, substeps=5)  # fmt: skip
    (folder / "rail.fmu").write_bytes(made)
    ports = ['force = { kind = "input", unit = "N" }', 'pos = { kind = "output", unit = "m", column = "x" }',
             'vel = { kind = "output", unit = "m/s", column = "v" }', 'x = { kind = "state" }',
             'v = { kind = "state" }',
             'cart = { kind = "joint", unit = "N", position = "pos", velocity = "vel",'
             ' through = "force" }']  # fmt: skip
    return 'kind = "fmu"\n[fmu]\nfmu = "rail.fmu"\n' + _tables(plant, ports)


_WRITERS = {
    ("function", "rail"): lambda plant, folder: _function(RAIL, plant, folder),
    ("function", "drive"): lambda plant, folder: _function(DRIVE, plant, folder),
    ("function", "cylinder"): _cylinder,
    ("equations", "rail"): lambda plant, folder: _equations(RAIL, plant, folder),
    ("equations", "drive"): lambda plant, folder: _equations(DRIVE, plant, folder),
    ("control", "pole"): _control,
    ("mujoco", "servo"): _servo,
    ("mujoco", "rail"): _slide,
    ("fmu", "tanks"): _tanks,
    ("fmu", "rail"): _rail_fmu,
}
