"""The simulator file of the antagonistic bench, commented for somebody who fills it in for the first time."""

from collections.abc import Collection

from ..bench.parameters import TABLES, BenchParameters
from ..bench.simulator_file import simulator_text
from .base import Input

BENCH_INPUTS = (
    Input("q", "rad", "joint angle"),
    Input("P1", "Pa, absolute", "pressure in muscle 1, which shortens with growing angle"),
    Input("P2", "Pa, absolute", "pressure in muscle 2"),
    Input("F1", "N", "tension of muscle 1", needed=False),
    Input("F2", "N", "tension of muscle 2", needed=False),
    Input("mdot1", "kg/s", "mass flow into muscle 1", needed=False),
    Input("mdot2", "kg/s", "mass flow into muscle 2", needed=False),
    Input("u1", "-", "command of valve 1, -1 to 1", needed=False),
    Input("u2", "-", "command of valve 2, -1 to 1", needed=False),
    Input("q_ref", "rad", "reference joint angle", needed=False),
)
"""Signals of a log of the bench."""

OWN = (
    "rest_length", "rest_diameter", "braid_angle", "initial_contraction", "supply_pressure", "sonic_conductance",
    "pulley_radius", "inertia", "viscous_damping",
)  # fmt: skip
"""Numbers that no two benches share: without a value those of the study's muscle B are used, and marked."""

_HEAD = (
    "# Simulator of an antagonistic bench: two equal muscles on one pulley. SI units, absolute pressures.",
    "# What each number is and what is accepted: docs/simulator.md",
)
MEANING = {
    "name": "what the muscle is called",
    "rest_length": "length between the fittings at rest",
    "rest_diameter": "diameter at rest",
    "braid_angle": "between thread and axis at rest",
    "initial_contraction": "of both muscles at joint angle 0",
    "supply_pressure": "before the valves",
    "sonic_conductance": "of a valve, at full opening (data sheet, ISO 6358)",
    "pulley_radius": "of the pulley on the joint",
    "inertia": "of everything that turns",
    "viscous_damping": "of the joint's bearings",
}


def bench_text(params: BenchParameters, assumed: Collection[str] = ()) -> str:
    """Return the commented simulator file of a bench."""
    tables = {name: getattr(params, name) for name in TABLES}
    return simulator_text(tables, params.tolerance, params.effects, _HEAD, MEANING, assumed)
