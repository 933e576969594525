"""Joints of simulators that are run whole: one of position and speed is read, and the other follows from it."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.errors import UnknownOptionError
from pamid.gap import diagnose_simulator
from pamid.gap.residuals.untested import untested
from pamid.gap.simulated import evidence_of, free_run
from pamid.simulators import Between, FunctionSimulator, Port

DT, DAMPING = 0.01, 0.6
FORCE, PUSH = Port("F", "input", "N"), Port("push", "input", "N", start=0.0)
STARTS = [Port("x0", "state", "m", start=0.0), Port("v0", "state", "m/s", start=0.0)]
READ = [Port("x", "output", "m"), Port("v", "output", "m/s")]


def moved(force, x, v, damping=0.0):
    """Return the way and speed of a cart of 2 kg on a spring, in short steps."""
    rows = []
    for f in force:
        rows.append((x, v))
        for _ in range(8):
            v += DT / 8 * (f - 9.0 * x - damping * v) / 2.0
            x += DT / 8 * v
    return np.array(rows).T


def run(u, p, x0):
    return moved(u["F"] + u["push"], float(x0.x0), float(x0.v0))


def simulator(joint, **more):
    return FunctionSimulator(run, [FORCE, PUSH, *READ, *STARTS, joint], {"m": 2.0}, form="run", **more)


def log(*without):
    rng, runs = np.random.default_rng(4), []
    t = np.arange(300) * DT
    for k in range(2):
        F = 4.0 * np.sin((1.5 + 0.7 * k) * t) + 3.0 * np.sin(4.3 * t + k)
        x, v = moved(F, 0.0, 0.0, DAMPING) + [[2e-4], [2e-3]] * rng.standard_normal((2, len(t)))
        runs.append(pd.DataFrame({"trajectory": str(k), "time": t, "F": F, "x": x, "v": v}))
    return pd.concat(runs, ignore_index=True).drop(columns=list(without))


@pytest.mark.parametrize("speed", ["v", ""])
def test_a_speed_that_is_not_read_follows_from_the_position(speed: str) -> None:
    cart = simulator(Port("cart", "joint", "N", position="x", velocity=speed, through="push"))
    found = diagnose_simulator(log("v"), cart, ["viscous_friction", "quadratic_drag", "actuator_gain"])
    [cause] = found.causes
    assert (cause.effects, cause.where) == (("viscous_friction",), ("cart",))
    assert cause.parameters["coefficient"].value == pytest.approx(DAMPING, rel=0.05)
    off = [float(np.std(free_run(log("v"), one)["x"] - log()["x"])) for one in (cart, found.corrected)]
    assert off[1] < 0.02 * off[0]


def test_a_joint_that_nothing_is_read_of_says_why() -> None:
    hidden = simulator(Port("cart", "joint", "N", position="x", velocity="v", through="push"))
    other = [Port("y", "output", "m")]
    both = FunctionSimulator(
        lambda u, p, x0: [*run(u, p, x0), u["F"]], [FORCE, PUSH, *READ, *other, *STARTS, hidden.port("cart")],
        {"m": 2.0}, form="run",
    )  # fmt: skip
    [note] = untested(evidence_of(log("x", "v").assign(y=lambda d: d["F"] + 0.0), both), "all")
    assert note.startswith("The joint 'cart' has no reading: the log lacks its position x and its velocity v.")
    with pytest.raises(UnknownOptionError, match="'cart' has no reading"):
        diagnose_simulator(log("x", "v").assign(y=lambda d: d["F"] + 0.0), both, ["coulomb_friction"])


def test_a_joint_without_an_input_says_so_between_two_ports_too() -> None:
    idle = simulator(Port("cart", "joint", "N", position="x", velocity="v"))
    assert "names no input through which forces act" in untested(evidence_of(log(), idle), "all")[0]
    with pytest.raises(UnknownOptionError, match="The joint 'cart' names no input"):
        evidence_of(log(), idle.with_(between=[Between("cart", "x")]))
