"""Streaming on the twin: time to name a leak or friction that appears, false alarms, samples a second, flat memory."""

from __future__ import annotations

import argparse
import dataclasses
import resource
import time
import warnings
from typing import Any

import numpy as np
import pandas as pd
from pamid.estimators import OnlineAdapter, RateTransformer, StaticPIHM
from sklearn.frozen import FrozenEstimator

from pamid.bench import BenchParameters, simulate, unfold
from pamid.bench.references import Trajectory, multisine
from pamid.checkpoint import Checkpoint
from pamid.effects.base import Parameter, Signals, Step
from pamid.effects.coulomb_friction import CoulombFriction
from pamid.effects.leakage import Leakage
from pamid.laws.quasi_static import QuasiStaticForce
from pamid.laws.thermodynamic import ThermodynamicFlow
from pamid.online import GapMonitor
from pamid.volume import volume_class

HEALTHY = 30.0  # s of signal from which a monitor learns
WATCHED = 30.0  # s that follow
AT = 8.0  # s into them at which something appears
_ONSET = Parameter("onset", "s", 0.0, 1e6, 10.0, "when it appears")


class LateLeak(Leakage):
    """A leak that appears during a run."""

    name = "late_leakage"
    n_states = 1
    parameters = (*Leakage.parameters, _ONSET)
    onset: float

    def start(self, s: Signals, plant: Any, dt: float) -> Any:
        """Return no time passed."""
        return np.zeros((1, *np.shape(s.pressure)))

    def step(self, x: Any, s0: Signals, s1: Signals, dt: float, plant: Any) -> Any:
        """Let time pass."""
        return x + dt

    def flow(self, s: Signals, x: Any, plant: Any) -> Step:
        """Return the leak once it is there."""
        share = super().flow(s, x, plant)
        return Step(np.where(x[0] > self.onset, share.a, 0.0), share.b)


class LateFriction(CoulombFriction):
    """Dry friction that appears during a run."""

    name = "late_coulomb_friction"
    n_states = 2
    path_dependent = False
    parameters = (*CoulombFriction.parameters, _ONSET)
    onset: float

    def start(self, s: Signals, plant: Any, dt: float) -> Any:
        """Return unbent bristles and no time passed."""
        return np.zeros((2, *np.shape(s.position)))

    def step(self, x: Any, s0: Signals, s1: Signals, dt: float, plant: Any) -> Any:
        """Bend the bristles; let time pass."""
        return np.concatenate([super().step(x[:1], s0, s1, dt, plant), x[1:] + dt])

    def force(self, s: Signals, x: Any, plant: Any) -> Any:
        """Return the friction once it is there."""
        return np.where(x[1] > self.onset, -self.amplitude * x[0], 0.0)


def trajectories(n: int, seed: int) -> list[Trajectory]:
    """Return runs of a joint at work: sums of sines, each with its own pace and amplitude."""
    rng = np.random.default_rng(seed)
    samples = int((HEALTHY + WATCHED) * 1000)
    runs = []
    for k in range(n):
        run = multisine(float(rng.uniform(4, 10)), float(rng.uniform(10, 18)), samples, seed=1000 * seed + k)
        runs.append(dataclasses.replace(run, name=f"run-{k}"))
    return runs


def tables(bench: BenchParameters, n: int, seed: int, effects: list[Any]) -> dict[str, pd.DataFrame]:
    """Simulate runs and return one table a run and muscle."""
    out = {}
    for first in range(0, n, 4):  # a few runs at a time, so that memory stays small
        runs = trajectories(n, seed)[first : first + 4]
        log = unfold(simulate(bench, runs, effects=effects, seed=seed + first), bench)
        table = RateTransformer().fit_transform(log[["trajectory", "time", "eps", "P"]])
        table["time"], table["F"], table["mdot"] = (log[c].to_numpy() for c in ("time", "F", "mdot"))
        out |= {str(k): part.reset_index(drop=True) for k, part in table.groupby("trajectory", sort=False)}
    return out


def monitored(bench: BenchParameters, n: int, rate: float, kept: Checkpoint | None) -> None:
    """Print how fast and how rightly what appears is named, and the false alarms of healthy runs."""
    m, g = bench.muscle, bench.gas
    volume = volume_class("chou_hannaford").from_geometry(m.rest_length, m.rest_diameter, m.braid_angle)
    laws = [
        QuasiStaticForce(m.rest_length, g.atmospheric_pressure),
        ThermodynamicFlow(g.heat_capacity_ratio, g.gas_constant, g.temperature),
    ]
    play = 3 * 1.9e-5 * bench.joint.pulley_radius / m.rest_length  # three times the encoder's noise
    onset = HEALTHY + AT + 0.6  # the lead-in counts for the effect
    cases = [
        ("leakage", [LateLeak(conductance=3e-11, onset=onset)]),
        ("leakage", [LateLeak(conductance=1e-10, onset=onset)]),
        ("coulomb_friction", [LateFriction(amplitude=1.0, onset=onset)]),
        ("coulomb_friction", [LateFriction(amplitude=4.0, onset=onset)]),
        ("healthy", []),
    ]
    for k, (what, effects) in enumerate(cases):

        def work(k: int = k, what: str = what, effects: list[Any] = effects) -> list[Any]:
            delays, named, false = [], 0, 0
            count = 0
            for table in tables(bench, n, 10 + k, effects).values():
                monitor = GapMonitor(volume, laws, bench.plant(), false_alarms_per_hour=rate, play=play)
                learnt = int(HEALTHY * 1000)
                monitor.calibrate(table[:learnt])
                count += 1
                before = monitor.update(table[learnt : learnt + int(AT * 1000)]) if effects else []
                found = monitor.update(table[learnt + int(AT * 1000) :] if effects else table[learnt:])
                false += bool(before)
                if not effects:
                    false += bool(found)
                elif found and not before:
                    delay = found[0].time - HEALTHY - AT
                    delays.append(delay)
                    named += found[0].effect == what and delay <= 2.0
            return [delays, named, false, count]

        name = f"{k}: {what}"
        delays, named, false, count = kept.step(name, work) if kept else work()
        if effects:
            size = ", ".join(f"{p}={v:g}" for p, v in effects[0].values.items() if p in ("conductance", "amplitude"))
            q = np.quantile(delays, [0.5, 0.95]) if delays else [np.nan, np.nan]
            print(
                f"{what:17} {size:20} {count} streams: named rightly within 2 s {named / count:6.1%} (target: 95 %), "
                f"delay median {q[0]:.2f} s, 95 % {q[1]:.2f} s; alarms before it: {false}"
            )
        else:
            hours = count * WATCHED / 3600.0
            print(
                f"healthy           {count} streams, {hours:.2f} h of signal: {false} with false alarms, "
                f"{false / hours:.2f} an hour (target: 1)"
            )


def throughput(samples: int) -> None:
    """Print how many samples a second an adapter takes, and how its memory grows."""
    bench = BenchParameters.for_muscle("B")
    t = np.arange(200_000) * 1e-3
    w = 2.0 * np.pi
    X = np.column_stack(
        [
            0.12 + 0.06 * np.sin(w * t),
            0.06 * w * np.cos(w * t),
            3.5e5 + 1e5 * np.cos(3 * t),
            -3e5 * np.sin(3 * t),
        ]
    )
    rng = np.random.default_rng(0)
    F = (X[:, 2] - 101_325) * 5e-4 * (1 - 3 * X[:, 0]) + rng.normal(0, 0.2, len(t))
    model = StaticPIHM(max_iter=10, random_state=0).fit(X[::100], F[::100])
    effects = ("viscous_friction", "coulomb_friction")
    online = OnlineAdapter(FrozenEstimator(model), effects, plant=bench.plant(), play=1e-6).fit(X[:30_000], F[:30_000])
    batch, done, first = 1000, 0, 0
    started, worst = time.perf_counter(), 0.0
    cpu = time.process_time()
    while done < samples:
        i = done % len(F)
        one = time.perf_counter()
        online.partial_fit(X[i : i + batch], F[i : i + batch])
        worst = max(worst, time.perf_counter() - one)
        done += batch
        if done == samples // 10:
            first = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    wall, cpu = time.perf_counter() - started, time.process_time() - cpu
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - first
    print(
        f"OnlineAdapter, network 128 × 128, 3 parameters: {done:,} samples, {done / cpu:,.0f} a second of one core "
        f"({done / wall:,.0f} by the clock; target: 20,000), worst batch of {batch} {worst * 1e3:.0f} ms; peak memory "
        f"grew by {grown / 1024:.1f} MiB after the first tenth; {len(online.alarms_)} alarms"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=20, help="runs of two muscles each a case (default: 20)")
    parser.add_argument("--samples", type=int, default=10_000_000, help="samples of the endurance run")
    parser.add_argument("--rate", type=float, default=1.0, help="false alarms allowed an hour (default: 1)")
    parser.add_argument("--resume", metavar="FILE", help="keep finished cases in a file, and go on from it")
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    if args.samples:
        throughput(args.samples)
    if args.runs:
        settings = {"runs": args.runs, "rate": args.rate}
        kept = Checkpoint(args.resume, settings) if args.resume else None
        monitored(BenchParameters.for_muscle("B"), args.runs, args.rate, kept)


if __name__ == "__main__":
    main()
