"""One cause in a user's own system, by code of its own: is it named, is something else, is it seen at all?"""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline

from benchmarks._answers import Record, short

from .ask import ask, names_of
from .logs import Recording, log_of, simulated
from .right import DRAWS, Drawn, drawn
from .systems import SYSTEMS, System, simulator_of

RATES = {"cart": "v", "pendulum": "dq", "motor": "w", "quadrotor": "vz", "arm": "w2", "hydraulic": "vel"}
"""The speed that friction acts against."""
JOINTS = {
    "cart": ("x", "v", "force"), "pendulum": ("q", "dq", "torque"), "motor": ("w",), "quadrotor": ("z", "vz"),
    "arm": ("q2", "w2", "tau2"), "hydraulic": ("pos", "vel"),
}  # fmt: skip
"""Ports that are that joint."""
FRICTION = ("coulomb_friction", "quadratic_drag")
INPUT = ("actuator_gain", "actuator_bias", "actuator_dead_zone", "actuator_saturation", "actuator_delay")
OUTPUT = ("sensor_gain", "sensor_bias", "sensor_delay", "sensor_saturation")
SEEN = 1.5
"""Times the noise by which a cause must change a reading where tolerances were not fitted, to be asked for."""


@dataclass(frozen=True)
class Cause:
    """What the system has and its simulator lacks: an effect, where, and its size as a share of what it acts on."""

    effect: str
    port: str
    share: float
    way: float


def drawn_cause(system: System, rng: np.random.Generator) -> Cause:
    """Return a cause for a system."""
    places = [(e, "joint") for e in FRICTION if system.name in RATES]
    places += [(e, n) for e in INPUT for n in system.inputs]
    places += [(e, next(iter(system.readings))) for e in OUTPUT]
    effect, port = places[rng.integers(len(places))]
    return Cause(effect, port, float(np.exp(rng.uniform(np.log(0.08), np.log(0.4)))), float(rng.choice([-1.0, 1.0])))


def with_friction(system: System, cause: Cause, speed: float, scale: float) -> System:
    """Return a system with friction against one of its speeds, as a share of what usually accelerates it."""
    name, row = RATES[system.name], list(system.states).index(RATES[system.name])
    a = cause.share * scale

    def resisting(v: Any) -> Any:
        return a * (np.tanh(v / (0.01 * speed)) if cause.effect == "coulomb_friction" else v * np.abs(v) / speed**2)

    def rates(t: Any, x: Any, u: Any, p: Any) -> list[Any]:
        if system.name == "arm":  # what acts at one joint moves both
            return system.rates(t, x, SimpleNamespace(**{**vars(u), "tau2": u.tau2 - resisting(x.w2)}), p)
        found = list(system.rates(t, x, u, p))
        found[row] = found[row] - resisting(getattr(x, name))
        return found

    return replace(system, rates=rates)


def command_of(system: System, cause: Cause, deviation: np.ndarray, middle: np.ndarray) -> Any:
    """Return what becomes of the inputs on their way."""
    row, kept = list(system.inputs).index(cause.port), list[np.ndarray]()
    size, late = cause.share * deviation[row], max(1, round(10 * cause.share))

    def command(u: np.ndarray, _: float) -> np.ndarray:
        c, out = u[row], u.copy()
        if cause.effect == "actuator_delay":
            kept.append(c)
            out[row] = kept[max(0, len(kept) - 1 - late)]
        elif cause.effect == "actuator_gain":
            out[row] = c * (1.0 + cause.way * cause.share)
        elif cause.effect == "actuator_bias":
            out[row] = c + cause.way * size
        elif cause.effect == "actuator_dead_zone":
            out[row] = np.sign(c) * np.maximum(np.abs(c) - size, 0.0)
        else:
            out[row] = np.minimum(c, middle[row] + (1.6 - 3.0 * cause.share) * deviation[row])
            if middle[row] < 0.5 * deviation[row]:
                out[row] = np.clip(c, -(limit := (1.6 - 3.0 * cause.share) * deviation[row]), limit)
        return out

    return command


def reading_of(cause: Cause, dt: float) -> Callable[[str, np.ndarray], np.ndarray]:
    """Return what a sensor makes of its signal."""

    def read(name: str, y: np.ndarray) -> np.ndarray:
        if name != cause.port:
            return y
        spread = float(np.std(y))
        if cause.effect == "sensor_gain":
            return y * (1.0 + cause.way * cause.share)
        if cause.effect == "sensor_bias":
            return y + cause.way * cause.share * spread
        if cause.effect == "sensor_delay":
            t = np.arange(len(y)) * dt  # straight lines between samples would be a lag as well
            return np.asarray(CubicSpline(t, y)(np.maximum(t - 10 * cause.share * dt, 0.0)))
        return y

    return read


def solve(number: int, seed: int, draw: Drawn = drawn) -> Record:
    """Return what is said of a case."""
    system = SYSTEMS[number % len(SYSTEMS)]
    rng = np.random.default_rng([seed, number, 3])
    nominal, true, how, way = draw(system, rng)
    how, cause = replace(how, noise=min(how.noise, 1.0), runs=max(how.runs, 2)), drawn_cause(system, rng)
    readings = [n for k, n in enumerate(system.readings) if k == 0 or rng.random() < 0.7]
    for again in range(DRAWS):
        with np.errstate(all="ignore"):
            plain = simulated(system, true, how, np.random.default_rng([seed, number, again]))
            x, u = caused(system, true, how, cause, plain, np.random.default_rng([seed, number, again]))
        if np.isfinite(x).all() and np.isfinite(plain[0]).all():
            break
    else:
        raise RuntimeError(f"{system.name} left its room in each of {DRAWS} draws")
    log = log_of(system, x, u, how, rng, readings, reading_of(cause, how.dt))
    if cause.effect == "sensor_saturation":  # a range ends for the noise, too
        log[cause.port] = np.minimum(log[cause.port], log[cause.port].quantile(1.0 - 0.5 * cause.share))
    seen = changed(system, how, readings, log, plain[0]) if system.loop is None else np.inf
    with tempfile.TemporaryDirectory() as folder:
        answer = ask(log, simulator_of(system, nominal, way, Path(folder)))
    return judged(answer, system, cause, seen) | {
        "kind": system.name, "integrator": how.integrator,
        "made": f"{way}, {how.integrator}, {how.runs} x {how.samples} rows, dt {how.dt:g} s, {how.noisy}, "
                f"reads {', '.join(readings)}, changes by {seen:.1f} times the noise",
    }  # fmt: skip


def caused(
    system: System, p: dict[str, float], how: Recording, cause: Cause, plain: tuple[np.ndarray, np.ndarray],
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return states and logged inputs of the system with its cause."""
    x, u = plain
    if cause.port == "joint":
        row = list(system.states).index(RATES[system.name])
        scale = float(np.std(u[:, 1])) if system.name == "arm" else float(np.std(np.diff(x[:, row], axis=0))) / how.dt
        return simulated(with_friction(system, cause, float(np.std(x[:, row])), scale), p, how, rng)
    if cause.port in system.inputs:
        deviation, middle = np.std(u, axis=(0, 2)), np.mean(u, axis=(0, 2))
        return simulated(system, p, how, rng, command_of(system, cause, deviation, middle))
    return plain


def changed(system: System, how: Recording, readings: list[str], log: pd.DataFrame, plain: np.ndarray) -> float:
    """Return by how many times its noise a cause changes a reading most, as a root mean square."""
    found = []
    for name in readings:
        true = plain[:, list(system.states).index(name)].T.ravel()
        power = float(np.mean(np.square(log[name] - true)))
        found.append(power / (how.noise * system.readings.get(name, 3e-3) * float(np.ptp(true))) ** 2)
    return float(np.sqrt(max(max(found) - 1.0, 0.0)))


def judged(answer: Record, system: System, cause: Cause, seen: float) -> Record:
    """Return whether the cause is named, alone, missed, or another one is named in its place."""
    # MuJoCo reads the position of a joint without a sensor as NAME_q.
    ports = JOINTS[system.name] if cause.port == "joint" else (cause.port, f"{cause.port}_q")
    true, named = {f"{cause.effect}@{p}" for p in ports}, names_of(answer)
    hit = [bool(names & true) for names in named]
    others = [c for c, h in zip(answer["causes"], hit, strict=True) if not h and c["grade"] == "sure"]
    word = "alone" if hit == [True] else "named" if any(hit) else "WRONG" if others else "reserve" if named else ""
    word = word or answer["verdict"]
    return answer | {
        "right": word != "WRONG",
        "word": word,
        "seen": seen,
        "said": f"{cause.effect}@{ports[0]}: {short(answer)}",
    }


def jobs(cases: int, seed: int) -> list[tuple[str, Callable[[], Record]]]:
    """Return the cases."""
    return [(f"named {k:03d} {SYSTEMS[k % len(SYSTEMS)].name}", partial(solve, k, seed)) for k in range(cases)]


def line(record: Record) -> str:
    """Return a case in one line."""
    return f"{record['word']}: {record['said']} | {record['made']}"


def summary(records: list[Record]) -> list[str]:
    """Return what they come to."""
    done = [r for r in records if "word" in r]
    asked = [r for r in done if r["seen"] > SEEN]
    every = Counter(r["word"] for r in asked)
    return [
        f"{len(asked)} of {len(done)} causes change a reading by more than {SEEN:g} times its noise: "
        + ", ".join(f"{w} {n}" for w, n in every.most_common()),
        "wrong: " + (", ".join(r["said"] for r in done if r["word"] == "WRONG") or "none"),
    ]
