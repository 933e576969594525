"""Effects that commute on a log: nobody can tell them, so their scores must not differ, whatever the library."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from benchmarks._answers import Record, short

from .ask import ask, names_of
from .logs import Recording, log_of, simulated
from .systems import SYSTEMS, System

LIMIT = 2.0
"""Nats by which the scores may differ."""
POLE = System(
    "pole", 0.01, 700, {"u": "V"}, {"y": "rad/s"}, {"y": 2e-3},
    {"K": (2.5, 0.0, "rad/s/V"), "T": (0.3, 0.0, "s")},
    lambda t, x, u, p: [(p.K * u.u - x.y) / p.T], {"dy/dt": "(K*u - y)/T"}, {"u": (0.0, 5.0, 0.02)},
)  # fmt: skip
PLANTS: dict[str, tuple[System, str, str]] = {
    "pole": (POLE, "u", "y"),
    **{s.name: (s, i, y) for s in SYSTEMS for n, i, y in (
        ("cart", "force", "x"), ("motor", "volt", "w"), ("quartercar", "road", "z_s"), ("rlc", "e", "vc"),
        ("tanks", "pump", "h2"), ("quadrotor", "thrust", "z"),
    ) if n == s.name},
}  # fmt: skip
"""Systems, their input, and the one reading; all but the last two are linear."""
LINEAR = ("pole", "cart", "motor", "rlc", "quartercar")
PAIRS = [
    *(("lag", p, f"actuator_lag@{PLANTS[p][1]}", f"sensor_lag@{PLANTS[p][2]}") for p in LINEAR),
    *(("delay", p, f"actuator_delay@{PLANTS[p][1]}", f"sensor_delay@{PLANTS[p][2]}") for p in LINEAR),
    *(("gain", p, f"actuator_gain@{PLANTS[p][1]}", f"sensor_gain@{PLANTS[p][2]}") for p in LINEAR),
    *(("bias", p, f"actuator_bias@{PLANTS[p][1]}", f"sensor_bias@{PLANTS[p][2]}") for p in ("pole", "cart", "rlc")),
    ("gain", "pole", "actuator_gain@u", "parameter_deviation@K"),
    ("gain", "tanks", "actuator_gain@pump", "parameter_deviation@k"),
    ("gain", "quadrotor", "actuator_gain@thrust", "parameter_deviation@kf"),
    ("damping", "cart", "viscous_friction@x", "parameter_deviation@b"),
]  # fmt: skip
"""Kind, system, and the two effects."""


def lagged(system: System, port: str, tau: float) -> System:
    """Return a system whose input reaches it through a lag of time constant tau, s."""
    n = len(system.states)

    def rates(t: Any, x: Any, u: Any, p: Any) -> list[Any]:
        late = SimpleNamespace(**{**vars(u), port: x.late})
        return [*system.rates(t, x, late, p), (getattr(u, port) - x.late) / tau]

    def start(rng: np.random.Generator, runs: int, p: dict[str, float]) -> np.ndarray:
        x = system.start(rng, runs, p) if system.start else np.zeros((n, runs))
        return np.vstack([x, np.zeros((1, runs))])

    return replace(system, states={**system.states, "late": "-"}, rates=rates, start=start)


def made(kind: str, plant: str, rng: np.random.Generator) -> Any:
    """Return a log with one of the two effects, which is as well the other."""
    system, port, reading = PLANTS[plant]
    p = {k: v for k, (v, _, _) in system.numbers.items()}
    how = Recording(system.dt, 700, 3, "adaptive" if plant == "pole" else "runge-kutta", False, 0.5, 0.0)
    size = float(np.exp(rng.uniform(np.log(0.06), np.log(0.2)))) * float(rng.choice([-1.0, 1.0]))
    late, kept, acting = int(rng.integers(2, 6)), [], system
    command = None
    if kind == "lag":
        acting = lagged(system, port, late * system.dt)
    elif kind == "delay":

        def command(u: np.ndarray, dt: float) -> np.ndarray:
            kept.append(u)
            return kept[-1 - late] if len(kept) > late else np.zeros_like(u)

    elif kind == "gain":

        def command(u: np.ndarray, dt: float) -> np.ndarray:
            return u * (1.0 + size * np.array([n == port for n in system.inputs])[:, None])

    numbers = p | ({"b": p["b"] * (1.0 + 2.0 * abs(size))} if kind == "damping" else {})
    x, u = simulated(acting, numbers, how, rng, command)
    order = list(system.states)
    shift = size * float(np.std(x[:, order.index(reading)])) if kind == "bias" else 0.0
    return log_of(acting, x, u, how, rng, [reading], lambda _, y: y + shift)


def solve(number: int, seed: int) -> Record:
    """Return the differences in score of a pair with the whole library, half of it, and the two alone.

    Scores stand twice in an answer: of sets of effects that were refitted, and of candidates.
    """
    from pamid.simulators import EquationSimulator, Port

    kind, plant, one, other = PAIRS[number % len(PAIRS)]
    rng = np.random.default_rng([seed, number])
    log = made(kind, plant, rng)
    system, _, _ = PLANTS[plant]
    ports = [Port(n, "input", unit) for n, unit in system.inputs.items()]
    p = {k: v for k, (v, _, _) in system.numbers.items()}
    start = system.start(rng, 1, p)[:, 0] if system.start else np.zeros(len(system.states))
    ports += [Port(n, "state", unit, start=float(x)) for (n, unit), x in zip(system.states.items(), start, strict=True)]
    simulator = EquationSimulator(system.equations, ports, {k: (v, 0.0, system.numbers[k][2]) for k, v in p.items()})
    whole = ask(log, simulator)
    others = sorted(k for k in whole["scores"] if k.split("@")[1] and k not in (one, other))
    half = [one, other, *(others[k] for k in rng.permutation(len(others))[: len(others) // 2])]
    answers = {"whole": whole, "half": ask(log, simulator, half), "pair": ask(log, simulator, [one, other])}
    differences = {w: difference(a["refitted"], one, other) for w, a in answers.items()}
    shown = {w: difference(a["scores"], one, other) for w, a in answers.items()}
    together = {w: any({one, other} <= names for names in names_of(a)) for w, a in answers.items()}
    right = all(abs(d[w]) <= LIMIT for d in (differences, shown) for w in answers)
    told = ", ".join(f"{w} {differences[w]:+.1f} (shown {shown[w]:+.1f}; {short(a)})" for w, a in answers.items())
    return {
        "right": right, "differences": differences, "shown": shown, "together": together, "kind": kind, "plant": plant,
        "said": f"{one} less {other}, nats: {told}",
    }  # fmt: skip


def difference(scores: dict[str, float], one: str, other: str) -> float:
    """Return by how much one of two has more; not a number where one of them was not looked at."""
    return scores.get(one, float("nan")) - scores.get(other, float("nan"))


def jobs(cases: int, seed: int) -> list[tuple[str, Callable[[], Record]]]:
    """Return the cases; few of them are spread over the pairs."""
    numbers = np.linspace(0, max(len(PAIRS), cases) - 1, cases).round().astype(int)
    some = [(int(k), *PAIRS[k % len(PAIRS)]) for k in numbers]
    return [(f"commute {k:03d} {kind} {p} {a.split('@')[0]} {b.split('@')[0]}", partial(solve, k, seed))
            for k, kind, p, a, b in some]  # fmt: skip


def line(record: Record) -> str:
    """Return a case in one line."""
    return f"{'right' if record['right'] else 'WRONG'} {record['said']}"


def summary(records: list[Record]) -> list[str]:
    """Return what they come to."""
    done = [r for r in records if "right" in r]
    good = sum(r["right"] for r in done)
    lines = [f"within {LIMIT:g} nats with each library, refitted and as shown: {good} of {len(done)}"]
    for what, word in (("differences", "both refitted"), ("shown", "as the candidates show them")):
        for way in ("whole", "half", "pair"):
            d = np.abs([r[what][way] for r in done])
            d = d[np.isfinite(d)]
            if len(d):
                lines.append(
                    f"{way} library, {word}: median {np.median(d):.1f}, largest {d.max():.0f} nats; "
                    f"within {LIMIT:g}: {int(np.sum(d <= LIMIT))} of {len(d)}"
                )
    together = ", ".join(f"{way} {sum(r['together'][way] for r in done)}" for way in ("whole", "half", "pair"))
    return [*lines, f"both in one class, of {len(done)}: {together}"]
