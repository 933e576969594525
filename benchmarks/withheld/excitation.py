"""Wanted joint angles of a withheld log: sines, triangles, steps, multisines, ramps with holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

DT = 1e-3
"""Sampling interval, s."""


@dataclass(frozen=True)
class Reference:
    """A wanted joint angle.

    Parameters
    ----------
    name : str
        Name of the trajectory.
    q : array, shape (n,)
        rad, every millisecond.
    lead : int
        Samples at its start that are not logged.
    offset : array, shape (n,), optional
        Added to the mean pressure of both muscles, Pa.
    share : tuple of float
        What each muscle takes of the pressure that turns the joint.
    shut : array of bool, shape (n,), optional
        Where both valves are shut.
    """

    name: str
    q: np.ndarray
    lead: int
    offset: np.ndarray | None = None
    share: tuple[float, float] = (1.0, 1.0)
    shut: np.ndarray | None = None


def sine(t: np.ndarray, omega: float, amplitude: float) -> np.ndarray:
    return amplitude * np.sin(omega * t)


def triangle(t: np.ndarray, omega: float, amplitude: float) -> np.ndarray:
    phase = np.mod(omega * t / (2 * np.pi) + 0.25, 1.0)
    return amplitude * (1.0 - 4.0 * np.abs(phase - 0.5))


def steps(t: np.ndarray, rng: np.random.Generator, amplitude: float, single: bool) -> np.ndarray:
    if single:
        return np.where(t >= 0.15 + 0.2 * rng.random(), amplitude, 0.0)
    dwell = rng.uniform(0.35, 0.8)
    level = np.concatenate([[0.0], amplitude * rng.uniform(-1.0, 1.0, 60)])
    return level[np.minimum((t / dwell).astype(int), 60)]


def multisine(t: np.ndarray, rng: np.random.Generator, omega: float, amplitude: float) -> np.ndarray:
    tones = omega * np.array([1.0, 1.9, 3.1, 4.3])
    weights = 1.0 / np.sqrt(tones / omega)
    phase = rng.uniform(0, 2 * np.pi, 4)
    x = (weights[:, None] * np.sin(tones[:, None] * t + phase[:, None])).sum(0)
    x = x - (weights * np.sin(phase)).sum() * np.exp(-t / 0.1)
    return amplitude * x / np.max(np.abs(x))


def ramps(t: np.ndarray, rng: np.random.Generator, amplitude: float) -> np.ndarray:
    knots = np.arange(0.0, t[-1] + 1.0, rng.uniform(0.4, 0.9))
    level = np.concatenate([[0.0], np.repeat(amplitude * rng.uniform(-1, 1, len(knots)), 2)])[: len(knots)]
    return np.interp(t, knots, level)


def reference(kind: str, samples: int, rng: np.random.Generator) -> Reference:
    """Draw one trajectory of a kind, ``samples`` long with its lead.

    Parameters
    ----------
    kind : str
        ``sine``, ``slow``, ``triangle``, ``step``, ``stairs``, ``multisine`` or ``ramp``.
    samples : int
        Length.
    rng : Generator
        Source of randomness.
    """
    degrees = float(rng.choice([5, 8, 10, 12, 15, 18, 20, 22, 25])) * (1 if rng.random() < 0.5 else -1)
    moving = rng.random() < 0.3 and kind not in (
        "step",
        "stairs",
    )  # logged from its middle: what the bench remembers from before is not in the log
    lead = min(int(rng.integers(250, 500)) if moving else 150, samples // 3)
    t = (np.arange(samples) - (0 if moving else lead)) * DT
    t = np.maximum(t, 0.0)
    amplitude = np.radians(degrees)
    omega = float(rng.choice([2, 3, 4, 5, 6, 8, 10]))
    if kind == "sine":
        q, label = sine(t, omega, amplitude), f"sine-{omega:g}-{degrees:g}"
    elif kind == "slow":
        omega = float(rng.choice([0.7, 1.0, 1.5]))
        q, label = sine(t, omega, amplitude), f"sine-{omega:g}-{degrees:g}"
    elif kind == "triangle":
        q, label = triangle(t, omega, amplitude), f"triangle-{omega:g}-{degrees:g}"
    elif kind == "step":
        q, label = steps(t, rng, amplitude, True), f"step-0-{degrees:g}"
    elif kind == "stairs":
        q, label = steps(t, rng, amplitude, False), f"stairs-{abs(degrees):g}"
    elif kind == "multisine":
        omega = float(rng.choice([2, 3, 4]))
        q, label = multisine(t, rng, omega, amplitude), f"multisine-{omega:g}-{abs(degrees):g}"
    elif kind == "ramp":
        q, label = ramps(t, rng, amplitude), f"ramp-{abs(degrees):g}"
    else:
        raise ValueError(f"There is no kind of trajectory {kind!r}.")
    return Reference(label, q, lead)


def draw_plan(rng: np.random.Generator, runs: int, samples: int, poor: bool = False) -> list[Reference]:
    """Draw the trajectories of one log; with ``poor``, slow sines and triangles alone.

    A log has a sine and steps, and whatever else chance adds: what it can tell differs from case to case.
    """
    if poor:
        kinds = ["slow", "triangle"]
    else:
        kinds = ["sine", "sine", "triangle", "step", "stairs", "multisine", "ramp", "slow"]
    chosen = list(rng.choice(kinds, runs))
    if not poor:
        chosen[:2] = ["sine", str(rng.choice(["step", "stairs"]))][:runs]
    plan, names = [], set()
    for kind in chosen:
        run = reference(kind, samples, rng)
        name, k = run.name, 2
        while name in names:
            name, k = f"{run.name}_{k}", k + 1
        names.add(name)
        plan.append(Reference(name, run.q, run.lead))
    return plan
