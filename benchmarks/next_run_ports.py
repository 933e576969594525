"""The next run of simulators with ports: open cases of four systems, a designed run against one drawn at random.

A first log moves each system little, about one point of work, so that two causes or more are left. Then either arm
records one run of the same length within the same limits, in code of its own, and the diagnosis goes on with both logs.
A case is open where the first diagnosis believes none of its explanations by 95 % and the true one by 5 % or more. The
headroom that each plan measures beforehand stands beside what came of it: expected shares of the right one first, of
the best design and of a random one.

Run with ``python benchmarks/next_run_ports.py --cases 10``; a case takes about ten seconds of one core. Each leaves
one file in ``--out``; ``--report`` only prints what is there.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import pandas as pd

from benchmarks.withheld.runner import write_json

SUBSTEPS = 10
DESIGNS = 120
"""Designs that are looked at for each run."""
DRAWS = 40
"""Runs at random that are drawn until one stays within the limits."""
SURE = 0.95
"""Belief from which an explanation counts as settled."""
Numbers = dict[str, float]


@dataclass(frozen=True)
class System:
    """A system of the benchmark.

    Parameters
    ----------
    ports : tuple of (str, str, str)
        Name, kind and unit.
    numbers : dict of str to (float, float)
        Nominal values and tolerances.
    rate : callable
        Rates of the states: (x, u, numbers, cause, memory); a cause is its name and size.
    noise : dict of str to float
        Standard deviation of each reading.
    begin : tuple of float
        Where runs begin.
    dt, samples : float, int
        Sampling interval, s, and samples of a run.
    first : callable
        The input of the first log: (t, rng).
    causes : dict of str to (float, float)
        What can be true, as effect and port, with its range of sizes.
    library : tuple of str
        Effects that may be causes.
    limits, keep : dict of str to (float, float)
        What inputs and readings may do in the next run.
    seconds : float
        How long that lasts, s: short beside the first log.
    """

    ports: tuple[tuple[str, str, str], ...]
    numbers: dict[str, tuple[float, float]]
    rate: Callable[..., list[float]]
    noise: dict[str, float]
    begin: tuple[float, ...]
    dt: float
    samples: int
    first: Callable[[np.ndarray, np.random.Generator], np.ndarray]
    causes: dict[str, tuple[float, float]]
    library: tuple[str, ...]
    limits: dict[str, tuple[float, float]]
    keep: dict[str, tuple[float, float]]
    seconds: float


def _on(cause: tuple[str, float], name: str) -> float:
    return cause[1] if cause[0] == name else 0.0


def _motor(x: list[float], u: float, p: Numbers, cause: tuple[str, float]) -> list[float]:
    w = x[0]
    dry, viscous, gain = (_on(cause, n) for n in ("coulomb_friction@w", "viscous_friction@w", "actuator_gain@u"))
    return [(u * (1.0 + gain) - p["k"] * w - dry * math.tanh(w / 0.02) - viscous * w) / p["J"]]


def _tanks(x: list[float], u: float, p: Numbers, cause: tuple[str, float]) -> list[float]:
    one, two = (max(v, 0.0) for v in x)
    leak, gain, wider = (_on(cause, n) for n in ("leakage@h1", "actuator_gain@q", "parameter_deviation@k1"))
    between = p["k1"] * (1.0 + wider) * math.sqrt(one)
    return [(u * (1.0 + gain) - between - leak * one) / p["A"], (between - p["k2"] * math.sqrt(two)) / p["A"]]


def _spring(x: list[float], u: float, p: Numbers, cause: tuple[str, float]) -> list[float]:
    (q, v), dry, dead = x, _on(cause, "coulomb_friction@x"), _on(cause, "actuator_dead_zone@F")
    softer = _on(cause, "parameter_deviation@s")
    pushed = u - min(max(u, -dead), dead)
    return [v, (pushed - p["c"] * v - p["s"] * (1.0 + softer) * q - dry * math.tanh(v / 1e-3)) / p["m"]]


def _heater(x: list[float], u: float, p: Numbers, cause: tuple[str, float]) -> list[float]:
    above = x[0] - 293.0
    gain, wider = _on(cause, "actuator_gain@P"), _on(cause, "parameter_deviation@h")
    radiated = _on(cause, "heat_loss@T") * (x[0] ** 4 - 293.0**4)
    return [(u * (1.0 + gain) - p["h"] * (1.0 + wider) * above - radiated) / p["C"]]


def _about(level: float, size: float, slow: float, fast: float) -> Callable[..., np.ndarray]:
    """Return an input that moves little about a level."""

    def made(t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        w = np.exp(rng.uniform(math.log(slow), math.log(fast), 3))
        return level + size / 3.0 * np.sum(np.sin(w * t[:, None] + rng.uniform(0.0, 6.28, 3)), axis=1)

    return made


SYSTEMS: dict[str, System] = {
    "motor": System(
        (("u", "input", "V"), ("w", "state", "rad/s")), {"k": (0.04, 0.03), "J": (0.02, 0.05)}, _motor, {"w": 0.2},
        (5.0,), 0.01, 600, _about(0.5, 0.06, 1.0, 8.0),
        {"coulomb_friction@w": (0.05, 0.2), "viscous_friction@w": (0.004, 0.02)},
        ("coulomb_friction", "viscous_friction", "quadratic_drag", "actuator_gain"),
        {"u": (0.0, 1.0)}, {"w": (-2.0, 25.0)}, 1.5,
    ),
    "tanks": System(
        (("q", "input", "l/s"), ("h1", "state", "m"), ("h2", "state", "m")),
        {"k1": (0.5, 0.03), "k2": (0.45, 0.03), "A": (2.0, 0.02)}, _tanks, {"h1": 0.004, "h2": 0.004},
        (1.0, 1.2), 0.2, 500, _about(0.5, 0.08, 0.1, 1.0),
        {"leakage@h1": (0.03, 0.1), "actuator_gain@q": (-0.15, -0.06), "parameter_deviation@k1": (0.08, 0.2)},
        ("leakage", "actuator_gain", "parameter_deviation", "sensor_gain"),
        {"q": (0.2, 0.8)}, {"h1": (0.2, 3.0), "h2": (0.2, 3.0)}, 30.0,
    ),
    "spring": System(
        (("F", "input", "N"), ("x", "state", "m"), ("v", "state", "m/s")),
        {"m": (1.0, 0.03), "c": (2.0, 0.05), "s": (40.0, 0.03)}, _spring, {"x": 5e-4, "v": 2e-2},
        (0.0, 0.0), 0.01, 500, _about(0.0, 3.0, 2.0, 6.0),
        {"coulomb_friction@x": (0.1, 0.3), "actuator_dead_zone@F": (0.1, 0.3), "parameter_deviation@s": (0.05, 0.15)},
        ("coulomb_friction", "quadratic_drag", "parameter_deviation", "actuator_dead_zone", "actuator_gain"),
        {"F": (-4.0, 4.0)}, {"x": (-0.4, 0.4), "v": (-2.5, 2.5)}, 1.5,
    ),
    "heater": System(
        (("P", "input", "W"), ("T", "state", "K")), {"h": (2.0, 0.03), "C": (400.0, 0.03)}, _heater, {"T": 0.15},
        (343.0,), 1.0, 800, _about(100.0, 25.0, 0.005, 0.05),
        {"heat_loss@T": (4e-9, 1e-8), "actuator_gain@P": (-0.2, -0.08), "parameter_deviation@h": (0.08, 0.25)},
        ("heat_loss", "actuator_gain", "parameter_deviation", "sensor_bias", "sensor_gain"),
        {"P": (0.0, 200.0)}, {"T": (290.0, 400.0)}, 250.0,
    ),
}  # fmt: skip


def record(
    system: System, u: np.ndarray, p: Numbers, cause: tuple[str, float], rng: np.random.Generator
) -> pd.DataFrame:
    """Return a run of the system under an input that is held over each sample."""
    x, rows, h = list(system.begin), [], system.dt / SUBSTEPS
    for now in u.tolist():
        rows.append(list(x))
        for _ in range(SUBSTEPS):
            a = system.rate(x, now, p, cause)
            b = system.rate([v + 0.5 * h * d for v, d in zip(x, a, strict=True)], now, p, cause)
            x = [v + h * d for v, d in zip(x, b, strict=True)]
    names = [name for name, kind, _ in system.ports if kind == "state"]
    states = dict(zip(names, np.array(rows).T, strict=True))
    found = {n: row + system.noise[n] * rng.standard_normal(len(u)) for n, row in states.items()}
    return pd.DataFrame({"trajectory": "run", "time": np.arange(len(u)) * system.dt, system.ports[0][0]: u, **found})


def simulator(system: System) -> Any:
    """Return the nominal simulator."""
    from pamid.simulators import FunctionSimulator, Port

    def rate(t: Any, x: Any, u: Any, p: Any) -> list[Any]:
        # The same equations for arrays, without a cause.
        values = {n: p[n] for n in system.numbers}
        state, drive = list(np.asarray(x)), np.asarray(u)[0]
        return NOMINAL[name](state, drive, values)

    name = next(n for n, s in SYSTEMS.items() if s is system)
    ports = [Port(n, kind, unit, start=0.0) for n, kind, unit in system.ports]
    return FunctionSimulator(rate, ports, dict(system.numbers))


NOMINAL: dict[str, Callable[..., list[Any]]] = {
    "motor": lambda x, u, p: [(u - p["k"] * x[0]) / p["J"]],
    "tanks": lambda x, u, p: [
        (u - p["k1"] * np.sqrt(np.maximum(x[0], 0.0))) / p["A"],
        (p["k1"] * np.sqrt(np.maximum(x[0], 0.0)) - p["k2"] * np.sqrt(np.maximum(x[1], 0.0))) / p["A"],
    ],
    "spring": lambda x, u, p: [x[1], (u - p["c"] * x[1] - p["s"] * x[0]) / p["m"]],
    "heater": lambda x, u, p: [(u - p["h"] * (x[0] - 293.0)) / p["C"]],
}


# --- a case -----------------------------------------------------------------------------------------------------
def examine(name: str, index: int, seed: int) -> dict[str, Any]:
    """Return what came of a case, by both arms."""
    import pamid

    system, rng = SYSTEMS[name], np.random.default_rng((seed, list(SYSTEMS).index(name), index))
    true = list(system.causes)[index % len(system.causes)]
    low, high = system.causes[true]
    cause = true, float(math.copysign(math.exp(rng.uniform(*sorted(math.log(abs(v)) for v in (low, high)))), low))
    p = {n: v * (1.0 + tol * float(rng.uniform(-0.7, 0.7))) for n, (v, tol) in system.numbers.items()}
    model = simulator(system)
    first = record(system, system.first(np.arange(system.samples) * system.dt, rng), p, cause, rng)
    found = pamid.diagnose(first, model, list(system.library))
    said: dict[str, Any] = {"system": name, "index": index, "true": true, "size": cause[1], "first": _first(found)}
    said["rivals"] = [["+".join(r.names), r.belief] for r in found.rivals]
    sure = {r.names: r.belief for r in found.rivals}
    said["open"] = max(sure.values(), default=1.0) < SURE and sure.get((true,), 0.0) >= 1.0 - SURE
    if not said["open"]:
        return said
    fast = {n: (high - low) / system.dt for n, (low, high) in system.limits.items()}
    began = time.process_time()
    plan = pamid.next_run(
        found, limits=system.limits, rates=fast, keep=system.keep, seconds=system.seconds, designs=DESIGNS, seed=index
    )
    said |= {
        "seconds": time.process_time() - began, "tells": plan.tells, "right": plan.right,
        "right_usual": plan.right_usual, "alike": [["+".join(n) for n in pair] for pair in plan.alike],
    }  # fmt: skip
    runs = {"designed": [*plan.runs, *plan.closest][0], "random": _random(system, plan.limits, p, cause, rng)}
    for arm, run in runs.items():
        u = run.values()[system.ports[0][0]]
        log = record(system, u, p, cause, np.random.default_rng((seed, index, 7)))
        before = found.history
        own = replace(before, logs=dict(before.logs), held=dict(before.held), rounds=list(before.rounds))
        again = pamid.diagnose({arm: log}, model, since=own)
        heads = [f"{c.effects[0]}@{c.where[0]}" for c in again.causes]
        alone = heads == [true] and len(again.causes[0].effects) == 1
        said[arm] = {
            "first": _first(again), "right": _first(again) == true, "alone": alone, "run": run.words,
            "verdict": again.verdict,
        }  # fmt: skip
    return said


def _first(found: Any) -> str:
    """Return the likeliest explanation."""
    return "+".join(found.rivals[0].names) if found.rivals else ""


def _random(system: System, limits: Any, p: Numbers, cause: tuple[str, float], rng: np.random.Generator) -> Any:
    """Return a run drawn from the family that stays where readings may be."""
    for _ in range(DRAWS):
        run = limits.draw(rng, str(rng.choice(limits.kinds)))
        log = record(system, run.values()[system.ports[0][0]], p, cause, rng)
        if all(log[n].between(*span).all() for n, span in system.keep.items()):
            return run
    raise RuntimeError("no run at random stays within the limits")


# --- the report ---------------------------------------------------------------------------------------------------
def report(found: list[dict[str, Any]], command: str) -> str:
    """Return the table: open cases of each system, right first by arm, and the headroom beforehand."""
    lines = [
        f"`{command}`", "",
        "| system | cases | open | right first before | designed | random | expected: best design | expected: random |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]  # fmt: skip
    for name in [*SYSTEMS, "all"]:
        mine = [f for f in found if name in (f["system"], "all")]
        some = [f for f in mine if f["open"] and "designed" in f]
        if not mine:
            continue
        shares = [np.mean([f["first"] == f["true"] for f in some] or [np.nan])]
        shares += [np.mean([f[arm]["right"] for f in some] or [np.nan]) for arm in ("designed", "random")]
        shares += [np.mean([f[k] for f in some] or [np.nan]) for k in ("right", "right_usual")]
        lines.append(f"| {name} | {len(mine)} | {len(some)} | {' | '.join(f'{100 * s:.0f} %' for s in shares)} |")
    some = [f for f in found if f["open"] and "designed" in f]
    alone = [100 * np.mean([f[arm]["alone"] for f in some] or [np.nan]) for arm in ("designed", "random")]
    spent = np.median([f["seconds"] for f in some] or [np.nan])
    lines += ["", f"Named alone: {alone[0]:.0f} % after the designed run, {alone[1]:.0f} % after one at random. "
              f"A plan of {DESIGNS} designs took {spent:.1f} s of one core (median)."]  # fmt: skip
    return "\n".join(lines)


def main(argv: list[str] | None = None) -> int:
    """Run the benchmark; return 0 when it is complete."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=10, metavar="N", help="cases a system")
    parser.add_argument("--seed", type=int, default=2026, help="seed of the cases")
    parser.add_argument("--system", choices=SYSTEMS, action="append", help="only this system; may be repeated")
    parser.add_argument("--out", type=Path, default=Path("results/next_run_ports"), metavar="DIR", help="for results")
    parser.add_argument("--minutes", type=float, default=math.inf, metavar="M", help="begin no further case after this")
    parser.add_argument("--report", action="store_true", help="print what is there already, run nothing")
    args = parser.parse_args(argv)
    folder, began = args.out / f"seed-{args.seed}", time.time()
    wanted = [(name, k) for k in range(args.cases) for name in args.system or SYSTEMS]
    for name, k in wanted:
        path = folder / f"{name}-{k:03d}.json"
        if not path.is_file() and not args.report and time.time() < began + 60.0 * args.minutes:
            write_json(path, examine(name, k, args.seed))
            print(f"{name} {k}, {(time.time() - began) / 60:.1f} min", file=sys.stderr)
    paths = [folder / f"{name}-{k:03d}.json" for name, k in wanted]
    found = [json.loads(path.read_text(encoding="utf-8")) for path in paths if path.is_file()]
    print(report(found, f"python benchmarks/next_run_ports.py --cases {args.cases} --seed {args.seed}"))
    return 0 if len(found) == len(wanted) else 1


if __name__ == "__main__":
    raise SystemExit(main())
