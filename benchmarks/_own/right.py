"""Right simulators of others: the log is made by the same equations, so that any cause named is a false alarm."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks._answers import Record, answer_of, short

from .logs import INTEGRATORS, Recording, log_of, simulated
from .systems import SYSTEMS, System, simulator_of

DRAWS = 20
SMALL = 1.05
"""Times the noise: an error below that is no gap worth a word."""


def drawn(system: System, rng: np.random.Generator) -> tuple[dict[str, float], dict[str, float], Recording, str]:
    """Return nominal and true numbers, how the log is made, and how the simulator is given."""
    nominal = {k: v * float(np.exp(rng.uniform(-0.3, 0.3))) for k, (v, _, _) in system.numbers.items()}
    if system.loop is not None:  # a loop is tuned for its system
        nominal = {k: v for k, (v, _, _) in system.numbers.items()}
    true = {k: v * (1.0 + 0.7 * float(rng.uniform(-1, 1)) * system.numbers[k][1]) for k, v in nominal.items()}
    integrator = INTEGRATORS[rng.choice(3, p=(0.4, 0.35, 0.25))]
    integrator = "runge-kutta" if integrator == "euler" and system.euler is None else integrator
    how = Recording(
        dt=system.dt * float(rng.choice([0.5, 1.0, 1.0, 2.0 * min(system.finest, 1.0)])),
        samples=int(system.samples * rng.uniform(0.6, 1.2)), runs=int(rng.integers(1, 5)), integrator=integrator,
        linear=bool(rng.random() < 0.5), noise=float(np.exp(rng.uniform(np.log(0.1), np.log(3.0)))),
        step=float(rng.choice([0.0, 0.0, 1e-4, 1e-3])),
    )  # fmt: skip
    ways = ["equations"] * bool(system.equations) + ["function"] + ["mujoco"] * (system.model is not None)
    return nominal, true, how, str(rng.choice(ways))


Drawn = Callable[[System, np.random.Generator], tuple[dict[str, float], dict[str, float], Recording, str]]


def solve(number: int, seed: int, systems: Sequence[System] = SYSTEMS, draw: Drawn = drawn) -> Record:
    """Return what is said of a case."""
    from pamid.gap import diagnose_simulator

    system = systems[number % len(systems)]
    rng = np.random.default_rng([seed, number])
    nominal, true, how, way = draw(system, rng)
    for _ in range(DRAWS):
        with np.errstate(all="ignore"):
            x, u = simulated(system, true, how, rng)
        if np.isfinite(x).all():
            break
    else:
        raise RuntimeError(f"{system.name} left its room in each of {DRAWS} draws")
    # The second of two sensors is there or not.
    readings = [n for k, n in enumerate(system.readings) if k == 0 or rng.random() < 0.7]
    log = log_of(system, x, u, how, rng, readings)
    with tempfile.TemporaryDirectory() as folder:
        found = diagnose_simulator(log, simulator_of(system, nominal, way, Path(folder)), seed=0)
    answer = answer_of(found)
    recorded = f"{way}, {how.integrator}, {'linear' if how.linear and system.loop is None else 'held'}"
    by = f" in {how.steps} steps" if how.steps else ""
    made = f"{how.runs} x {how.samples} rows, dt {how.dt:g} s{by}, {how.noisy}, step {how.step:g}"
    return answer | {
        "right": found.verdict in ("none", "untested"), "said": short(answer), "kind": system.name,
        "integrator": how.integrator, "made": f"{recorded}, {made}, reads {', '.join(readings)}",
    }  # fmt: skip


def jobs(cases: int, seed: int) -> list[tuple[str, Callable[[], Record]]]:
    """Return the cases."""
    return [(f"right {k:03d} {SYSTEMS[k % len(SYSTEMS)].name}", partial(solve, k, seed)) for k in range(cases)]


def line(record: Record) -> str:
    """Return a case in one line."""
    word = "right" if record["right"] else f"ALARM at {times_noise(record):.2f} times the noise,"
    return f"{word} {record['said']} | {record['made']}"


def times_noise(record: Record) -> float:
    """Return the largest error of an equation before any cause, in its noise."""
    return max((before / floor for _, before, _, floor, _ in record["closure"] if floor > 0.0), default=1.0)


def summary(records: list[Record]) -> list[str]:
    """Return what they come to."""
    from benchmarks.any_simulator.report import wilson

    done = [r for r in records if "right" in r]
    wrong, named = [r for r in done if not r["right"]], [r for r in done if r["causes"]]
    low, high = wilson(len(wrong), len(done))
    small = sum(times_noise(r) < SMALL for r in wrong)
    alarms, every = Counter(r["kind"] for r in wrong), Counter(r["kind"] for r in done)
    by_kind = ", ".join(f"{k} {alarms[k]} of {n}" for k, n in sorted(every.items()))
    alarms, every = Counter(r["integrator"] for r in wrong), Counter(r["integrator"] for r in done)
    by_way = ", ".join(f"{k} {alarms[k]} of {n}" for k, n in sorted(every.items()))
    return [
        f"false alarms: {len(wrong)} of {len(done)} ({100 * low:.1f} to {100 * high:.1f} %), {len(named)} with names, "
        f"{small} at errors below {SMALL:g} times the noise",
        f"by kind: {by_kind}", f"by integrator: {by_way}",
    ]  # fmt: skip
