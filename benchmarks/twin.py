"""Accuracy and speed of the simulated bench: step halving, balances, agreement with the laws.

Run with ``python benchmarks/twin.py``; takes about a minute on one core.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # the figures are for one core
if __package__ in (None, ""):
    sys.path[0] = str(Path(__file__).resolve().parents[1])

import numpy as np

from benchmarks._balance import balances
from pamid.bench import (
    DATASETS,
    SENSORS,
    BenchParameters,
    dataset,
    simulate,
    sine,
    step,
    step_trajectories,
    training_trajectories,
    triangle,
    triangle_trajectories,
    unfold,
)
from pamid.bench.references import PERIOD
from pamid.bench.simulation import run_batch
from pamid.effects import make_effect
from pamid.laws.gas import mass_flow
from pamid.laws.valve import valve_flow

STEPS = (1, 2, 4)
EFFECTS = ("hysteresis", "creep", "coulomb_friction", "stribeck_friction", "heat_transfer", "valve_lag")


def mixed(samples: int) -> list:
    return [
        sine(10, 25, samples),
        triangle(4, 20, samples),
        step(0, 15, samples, at=0.2),
        step(0, -25, samples, at=0.3),
    ]


def step_halving(samples: int) -> None:
    print(f"Step halving: largest error over {samples} ms of a sine, a triangle and two steps, against h/16.")
    print("bench              h = 1 ms: q/rad    P/Pa   h/2: q/rad    P/Pa   h/4: q/rad    P/Pa  order (median)")
    cases = [(muscle, ()) for muscle in "ABC"] + [("B", (make_effect(name),)) for name in EFFECTS]
    for muscle, effects in cases:
        params, runs = BenchParameters.for_muscle(muscle), mixed(samples)
        reference = run_batch(params, runs, effects, substeps=16, truth=True).y
        errors = np.array(
            [np.abs(run_batch(params, runs, effects, substeps=s, truth=True).y - reference).max(0) for s in STEPS]
        )
        order = np.median(np.log2(errors[:-1] / errors[1:])[:, (0, 2, 3)])
        label = muscle if not effects else f"{muscle} + {effects[0].name}"
        cells = "".join(f"{e[0].max():12.1e} {e[2:].max():8.1e}" for e in errors)
        print(f"{label:22s} {cells}  {order:6.2f}")
    print(
        f"Sensors for comparison: noise of q {SENSORS['q'].noise:.1e} rad, of P {SENSORS['P'].noise:g} Pa. With memory "
        "the order falls to 2,\nat a reversal inside a step to 1: the memory takes signals as straight within a step.\n"
    )


def conservation(samples: int) -> None:
    print("Balances: what they leave at the end of the run, relative to what was exchanged on the way.")
    print("                                  gas      energy of the gas   energy of the joint")
    for gamma in (1.4, 1.0):
        params = BenchParameters.for_muscle("B").replace(heat_capacity_ratio=gamma)
        for s in STEPS:
            left = balances(params, mixed(samples), s)
            energy = f"{left['gas_energy']:.1e}" if "gas_energy" in left else "       "
            print(
                f"gamma {gamma:3.1f}, h = 1/{s} ms        {left['gas']:8.1e}        {energy}             "
                f"{left['joint_energy']:8.1e}"
            )
    print(
        "Gas: change of P^(1/gamma) V against the integral of P^(1/gamma - 1) R T mdot, exact for the flow equation\n"
        "as it stands; at gamma = 1 that is the mass balance itself, change of PV/(RT) against the integral of mdot.\n"
        "At gamma = 1.4 the equation keeps T fixed, so PV/(RT) is not a conserved mass.\n"
    )


def agreement() -> None:
    print("Nominal log D_B against the nominal equations: standard deviation of the residual, and that of the noise.")
    params = BenchParameters.for_muscle("B")
    plant = params.plant()
    log, true = dataset("D_B", seed=0, truth=True)
    rows = unfold(log, params)
    eps, P, u, mdot, F = (rows[c].to_numpy() for c in ("eps", "P", "u", "mdot", "F"))
    slope = plant.volume_slope(eps) / plant.rest_length
    sd = {channel: s.standard_deviation for channel, s in SENSORS.items()}
    force = F - (P - plant.atmospheric_pressure) * slope
    print(f"force  {np.std(force):.4f} N, noise {np.hypot(sd['F'], sd['P'] * slope.mean()):.4f} N")
    through = valve_flow(
        u,
        P,
        plant.supply_pressure,
        plant.atmospheric_pressure,
        sonic_conductance=plant.sonic_conductance,
        critical_pressure_ratio=plant.critical_pressure_ratio,
        reference_density=plant.reference_density,
    )
    print(f"valve  {np.std(mdot - through):.3e} kg/s, noise {sd['mdot']:.3e} kg/s")
    left = []
    for m in "12":
        dV = plant.volume_slope(true[f"eps{m}"]) * true[f"deps{m}"]
        left.append(log[f"mdot{m}"].to_numpy(float) - mass_flow(true[f"P{m}"], true[f"dP{m}"], true[f"V{m}"], dV))
    print(f"flow   {np.std(left):.3e} kg/s (true rates), noise {sd['mdot']:.3e} kg/s\n")


def speed(repeats: int) -> None:
    print(f"Speed on one core of {os.cpu_count()}: best of {repeats}, h = 1 ms, noise and log included.")
    print("set                             runs  recorded s  simulated s     wall s  recorded/wall  recorded/cpu")

    def row(label: str, runs: list, params: BenchParameters, effects: tuple = ()) -> None:
        wall, cpu = np.inf, np.inf
        for _ in range(repeats):
            w, c = time.perf_counter(), time.process_time()
            log = simulate(params, runs, effects=effects)
            wall, cpu = min(wall, time.perf_counter() - w), min(cpu, time.process_time() - c)
        recorded, total = len(log) * PERIOD, sum(len(r.q_ref) for r in runs) * PERIOD
        print(
            f"{label:30s} {len(runs):5d} {recorded:11.1f} {total:12.1f} {wall:10.3f} {recorded / wall:13.0f}x "
            f"{recorded / cpu:12.0f}x"
        )

    everything = [*training_trajectories(), *triangle_trajectories(), *step_trajectories()]
    B = BenchParameters.for_muscle("B")
    for name, muscle, runs in (
        ("D_A", "A", training_trajectories(31_464)),
        ("D_B", "B", training_trajectories(31_464)),
        ("D_C", "C", training_trajectories(30_952)),
        ("D_tri", "B", triangle_trajectories()),
        ("D_step", "B", step_trajectories()),
        ("D_B, D_tri, D_step at once", "B", everything),
    ):
        row(name, runs, BenchParameters.for_muscle(muscle))
    row("the same with hysteresis", everything, B, ("hysteresis",))
    row("  and thread extensibility", everything, B, ("hysteresis", "thread_extensibility"))
    row("one run", [sine(4, 15, 5000)], B)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=800, help="length of the runs for accuracy, ms (default 800)")
    parser.add_argument("--repeats", type=int, default=5, help="repeats of each timing (default 5)")
    options = parser.parse_args()
    counts = {name: len(dataset(name)) for name in DATASETS}
    print("Rows:", ", ".join(f"{name} {rows:,}" for name, rows in counts.items()), "\n")
    step_halving(options.samples)
    conservation(options.samples)
    agreement()
    speed(options.repeats)


if __name__ == "__main__":
    main()
