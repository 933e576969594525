"""Tracking of a loaded muscle: the inverse model before a PID pressure loop, against PID alone and inverted models."""

from __future__ import annotations

import argparse
import copy
import sys
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from pamid.estimators import GeometricForce, InverseModel, InvertedForce, StaticPIHM

from pamid.bench.references import PERIOD
from pamid.bench.single import LOADS, SENSORS, LiftBench, festo_like, simulate_lift
from pamid.constants import GRAVITY

LOW, HIGH = 0.02, 0.12
"""Contractions between which the references move."""
TRAINED, UNTRAINED = (30.0, 60.0), (22.0, 52.0)
PID_ALONE, INVERSE, LEARNING = "PID alone", "inverse model", "inverse model, learning online"
SECOND, ROW = 1000, 10
"""Control periods between two updates of a model that learns on, and between two of its rows."""


@dataclass(frozen=True)
class Task:
    """A wanted contraction over time (rows of 1 ms), and the factor of the load."""

    name: str
    eps: np.ndarray
    load: np.ndarray
    announced: bool = True


def tasks(long: float) -> list[Task]:
    """Sines, steps, and a load that drops with and without a word."""

    def sine(frequency: float, seconds: float) -> np.ndarray:
        t = np.arange(round(seconds / PERIOD)) * PERIOD
        return LOW + 0.5 * (HIGH - LOW) * (1.0 - np.cos(2.0 * np.pi * frequency * t))

    t = np.arange(round(6.0 / PERIOD)) * PERIOD
    stairs = np.select([t < 1.0, t < 2.5, t < 4.0], [LOW, 0.08, 0.12], 0.05)
    drop = np.where(np.arange(round(6.0 / PERIOD)) * PERIOD < 3.0, 1.0, 0.8)
    half = sine(0.5, 6.0)
    one = np.ones
    return [
        Task("sine 0.05 Hz", sine(0.05, long), one(round(long / PERIOD))),
        Task("sine 0.5 Hz", half, one(len(half))),
        Task("steps", stairs, one(len(stairs))),
        Task("load drops, told", half, drop),
        Task("load drops, not told", half, drop, announced=False),
    ]


def wanted_force(task: Task, load: float, rest_length: float) -> np.ndarray:
    """Return what the muscle must pull: weight and inertia of the load that the controller believes in."""
    believed = load * (task.load if task.announced else task.load[0])
    jerky = np.abs(np.diff(task.eps, prepend=task.eps[0])).max() > 1e-3
    acceleration = 0.0 if jerky else np.gradient(np.gradient(task.eps, PERIOD), PERIOD)
    return np.asarray(believed * (GRAVITY + rest_length * acceleration))


def train(seed: int) -> tuple[dict[str, Any], float]:
    """Fit the inverse models on the study's slow sinusoid under six loads; return them and the pressure loop's lag."""
    log = simulate_lift(loads=LOADS, every=20, seed=seed)
    muscle = festo_like().muscle
    size = {"rest_length": muscle.rest_length, "rest_diameter": muscle.rest_diameter}
    clip = {"on_unreachable": "clip"}
    models = {
        INVERSE: InverseModel(direction=True, random_state=seed, **clip),
        LEARNING: InverseModel(direction=True, forget_rows=50, random_state=seed, **clip),
        "inverted geometry": InvertedForce(GeometricForce("tondu_lopez", **size), **clip),
        "inverted PIHM": InvertedForce(StaticPIHM(**size, random_state=seed), **clip),
    }
    log = log.assign(deps=log.groupby("trajectory", sort=False)["eps"].transform(lambda e: np.gradient(e, 0.02)))
    for name, model in models.items():
        columns = ["trajectory", *model.reads] if isinstance(model, InverseModel) else list(model.reads)
        groups = {"groups": log["trajectory"]} if "PIHM" in name else {}
        model.fit(log[columns], log["P"], **groups)
    return models, lag(log)


def set_values(model: Any, task: Task, load: float, rest_length: float, lead: float) -> np.ndarray:
    """Return the pressures that a model answers to the wanted pairs at 100 Hz, asked for `lead` seconds early."""
    t = np.arange(len(task.eps)) * PERIOD
    rows = np.arange(0, len(t), 10)
    pairs = pd.DataFrame(
        {
            "trajectory": "wanted",
            "F": wanted_force(task, load, rest_length)[rows],
            "eps": task.eps[rows],
            "deps": np.gradient(task.eps, PERIOD)[rows],
        }
    )
    columns = ["trajectory", *model.reads] if isinstance(model, InverseModel) else list(model.reads)
    return np.interp(t + lead, t[rows], model.predict(pairs[columns]))


class Learner:
    """A model that learns on in its lane: a second of measured rows at a time."""

    def __init__(self, model: Any, task: Task, load: float, rest_length: float, lead: float) -> None:
        self.model, self.question = copy.deepcopy(model), (task, load, rest_length, lead)

    def revised(self, F: np.ndarray, eps: np.ndarray, P: np.ndarray) -> np.ndarray:
        """Learn the last second of what was measured so far, and return the set values of the whole task anew."""
        rows = pd.DataFrame({"trajectory": "run", "F": F, "eps": eps})
        new = np.arange(len(P)) >= len(P) - SECOND // ROW  # the others only tell the direction of the motion
        self.model.partial_fit(rows, P, sample_weight=new.astype(float))
        return set_values(self.model, *self.question)


def run(
    lanes: Sequence[tuple[Task, float, np.ndarray, Sequence[float]]],
    friction: float = 1.0,
    seed: int = 0,
    learners: Mapping[int, Learner] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Run all lanes (task, load, feedforward, gains) side by side; return contractions and valve commands."""
    params = festo_like()
    if friction != 1.0:
        params = params.replace(
            effects=tuple(
                (name, {**values, "amplitude": friction * values["amplitude"]} if name == "hysteresis" else values)
                for name, values in params.effects
            )
        )
    L0, ambient = params.muscle.rest_length, params.gas.atmospheric_pressure
    n, steps = len(lanes), max(len(lane[0].eps) for lane in lanes)

    def filled(values: np.ndarray) -> np.ndarray:
        return np.concatenate([values, np.full(steps - len(values), values[-1])])

    wanted = np.stack([filled(lane[0].eps) for lane in lanes], axis=1)
    loads = np.stack([lane[1] * filled(lane[0].load) for lane in lanes], axis=1)
    ahead = np.stack([filled(lane[2]) for lane in lanes], axis=1)
    kp, ki, kd = (np.array([lane[3][k] for lane in lanes]) for k in range(3))
    bench = LiftBench(params, loads[0])
    rng, reading = np.random.default_rng(seed), np.random.default_rng(seed + 1)
    eps, command, logged = np.empty((steps, n)), np.empty((steps, n)), np.empty((3, -(-steps // ROW), n))
    total, last, rate = np.zeros(n), wanted[0].copy(), np.zeros(n)
    for k in range(steps):
        measured = 1.0 - (bench.length + rng.normal(0.0, 2e-5, n)) / L0
        error = wanted[k] - measured
        rate += 0.03 * (((error - last) / PERIOD if k else 0.0) - rate)  # of a filter of about 5 Hz
        last = error
        raw = ahead[k] + kp * error + ki * total + kd * rate
        P_ref = np.clip(raw, ambient, ambient + 7e5)
        total += PERIOD * error * (raw == P_ref)
        P, L, F, u = bench.step(P_ref, loads[k])
        eps[k], command[k] = 1.0 - L / L0, u
        if k % ROW == 0:
            logged[:, k // ROW] = SENSORS["F"].read(F, reading), measured, SENSORS["P"].read(P, reading)
        if (k + 1) % SECOND == 0:
            for j, learner in (learners or {}).items():
                if k + 1 < len(lanes[j][0].eps):
                    better = filled(learner.revised(*logged[:, : k // ROW + 1, j]))
                    if ki[j]:  # the integral takes the jump up
                        total[j] += (ahead[k + 1, j] - better[k + 1]) / ki[j]
                    ahead[k + 1 :, j] = better[k + 1 :]
    bench.check()
    return eps, command


def rmse(task: Task, eps: np.ndarray) -> float:
    """Return the tracking error of a lane after the first second, % of the stroke."""
    rows = slice(1000, len(task.eps))
    return float(100 * np.sqrt(np.mean((eps[rows] - task.eps[rows]) ** 2)) / (HIGH - LOW))


def tuned(todo: Sequence[Task], aheads: Sequence[np.ndarray]) -> list[float]:
    """Return the gains (Pa, Pa/s, Pa s) that track the tasks best under the trained loads; `aheads` a task and load."""
    grid = [
        [kp, ki, kd]
        for kp in (0.0, 2.5e5, 5e5, 1e6, 2e6, 4e6)
        for ki in (1e6, 4e6, 1e7, 2e7, 4e7, 8e7)
        for kd in (0.0, 1e5, 4e5)
    ]
    cases = [(task, load) for task in todo for load in TRAINED]
    eps, _ = run([(*case, ahead, g) for g in grid for case, ahead in zip(cases, aheads, strict=True)])
    n = len(cases)
    cost = [sum(rmse(task, eps[:, g * n + k]) ** 2 for k, (task, _) in enumerate(cases)) for g in range(len(grid))]
    return grid[int(np.argmin(cost))]


def lag(log: pd.DataFrame) -> float:
    """Return the lag of the pressure loop, s, from the training log: P_ref − P over the rate of P_ref."""
    rate = log.groupby("trajectory", sort=False)["P_ref"].transform(lambda p: np.gradient(p, 0.02)).to_numpy()
    behind = (log["P_ref"] - log["P"]).to_numpy()
    return float(rate @ behind / (rate @ rate))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0, help="seed of sensors and fits (default: 0)")
    parser.add_argument("--long", type=float, default=10.0, metavar="S", help="length of the slow sine (default: 10)")
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    params = festo_like()
    ambient, L0 = params.gas.atmospheric_pressure, params.muscle.rest_length
    todo = tasks(args.long)
    tuning = [todo[1], todo[4]]
    models, lead = train(args.seed)
    print(f"the pressure loop lags by {1e3 * lead:.0f} ms, as its training log says; models are asked so much earlier")
    nothing = [np.full(len(task.eps), ambient) for task in tuning for _ in TRAINED]
    gains = {PID_ALONE: tuned(tuning, nothing)}
    for m, model in models.items():
        if m != LEARNING:
            gains[m] = tuned(tuning, [set_values(model, task, load, L0, lead) for task in tuning for load in TRAINED])
    gains[LEARNING] = gains[INVERSE]
    print("gains, each the best of 108 on the 0.5 Hz sine with and without a load that drops, trained loads:")
    for m, (kp, ki, kd) in gains.items():
        print(f"  {m}: {kp:g} Pa, {ki:g} Pa/s, {kd:g} Pa s", flush=True)
    print()
    cases = (
        ("trained loads, trained friction", TRAINED, 1.0),
        ("untrained loads, trained friction", UNTRAINED, 1.0),
        ("untrained loads, twice the friction", UNTRAINED, 2.0),
    )
    names = [PID_ALONE, *(f"{m}{how}" for m in models for how in (" + PID", ", open loop"))]
    for title, loads, friction in cases:
        lanes, keys = [], []
        learners: dict[int, Learner] = {}
        for task in todo:
            for load in loads:
                still = np.full(len(task.eps), ambient)
                lanes.append((task, load, still, gains[PID_ALONE]))
                keys.append((PID_ALONE, task.name))
                for m, model in models.items():
                    ahead = set_values(model, task, load, L0, lead)
                    if m == LEARNING:
                        learners |= {len(lanes) + k: Learner(model, task, load, L0, lead) for k in range(2)}
                    lanes += [(task, load, ahead, gains[m]), (task, load, ahead, [0.0, 0.0, 0.0])]
                    keys += [(f"{m} + PID", task.name), (f"{m}, open loop", task.name)]
        eps, command = run(lanes, friction, args.seed, learners)
        print(f"{title} ({', '.join(f'{m:g}' for m in loads)} kg): tracking RMSE / % of stroke (mean |valve command|)")
        print(f"{'':42s}" + "".join(f"{task.name:>22s}" for task in todo))
        for name in names:
            cells = []
            for task in todo:
                here = [k for k, key in enumerate(keys) if key == (name, task.name)]
                error = np.sqrt(np.mean([rmse(task, eps[:, k]) ** 2 for k in here]))
                effort = np.mean([np.abs(command[1000 : len(task.eps), k]).mean() for k in here])
                cells.append(f"{error:12.1f} ({effort:.3f})")
            print(f"{name:42s}" + "".join(f"{c:>22s}" for c in cells))
        print(flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
