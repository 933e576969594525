"""Streaming on the bench: time to name a leak or friction that appears, false alarms, samples per second, memory."""

from __future__ import annotations

import argparse
import dataclasses
import resource
import time
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pandas as pd
from pamid.estimators import OnlineAdapter, StaticPIHM, ThermodynamicPIHM
from scipy.stats import chi2
from sklearn.base import clone
from sklearn.frozen import FrozenEstimator

from pamid.bench import BenchParameters, simulate, unfold
from pamid.bench.references import multisine
from pamid.checkpoint import Checkpoint
from pamid.effects.base import FlowTerm, Signals
from pamid.effects.dry_friction import CoulombFriction
from pamid.effects.leakage import Leakage
from pamid.effects.values import Parameter
from pamid.laws.quasi_static import QuasiStaticForce
from pamid.laws.thermodynamic import ThermodynamicFlow
from pamid.online import GapMonitor
from pamid.online.stream import HALF_WIDTH, slope_weights
from pamid.volume import volume_class

HEALTHY = 30.0  # s of signal from which a monitor learns
WATCHED = 30.0  # s that follow
AT = 8.0  # s into them at which something appears
SIGNALS = ["eps", "deps", "P", "dP"]
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
        """Advance the time."""
        return x + dt

    def flow(self, s: Signals, x: Any, plant: Any) -> FlowTerm:
        """Return the leak once it is there."""
        share = super().flow(s, x, plant)
        return FlowTerm(np.where(x[0] > self.onset, share.a, 0.0), share.b)


class LateFriction(CoulombFriction):
    """Dry friction that appears during a run."""

    name = "late_coulomb_friction"
    n_states = 2
    path_dependent = False
    parameters = (*CoulombFriction.parameters, _ONSET)
    onset: float

    def start(self, s: Signals, plant: Any, dt: float) -> Any:
        """Return bristles at zero deflection and no time passed."""
        return np.zeros((2, *np.shape(s.position)))

    def step(self, x: Any, s0: Signals, s1: Signals, dt: float, plant: Any) -> Any:
        """Bend the bristles; let time pass."""
        return np.concatenate([super().step(x[:1], s0, s1, dt, plant), x[1:] + dt])

    def force(self, s: Signals, x: Any, plant: Any) -> Any:
        """Return the friction once it is there."""
        return np.where(x[1] > self.onset, -self.amplitude * x[0], 0.0)


def tables(
    bench: BenchParameters, n: int, seed: int, effects: list[Any], seconds: float
) -> Iterator[tuple[str, pd.DataFrame]]:
    """Simulate runs of a joint at work, sums of sines of their own pace, and yield one stream a run and muscle."""
    rng = np.random.default_rng(seed)
    runs = []
    for k in range(n):
        run = multisine(
            float(rng.uniform(4, 10)), float(rng.uniform(10, 18)), int(seconds * 1000), seed=1000 * seed + k
        )
        runs.append(dataclasses.replace(run, name=f"run-{k}"))
    log = unfold(simulate(bench, runs, effects=effects, seed=seed), bench)
    weights, inner = slope_weights(1e-3), slice(HALF_WIDTH, -HALF_WIDTH)
    for name, part in log.groupby("trajectory", sort=False):
        rates = {r: np.convolve(part[c], weights, "valid") for r, c in (("deps", "eps"), ("dP", "P"))}
        yield str(name), part[["time", "eps", "P", "F", "mdot"]][inner].reset_index(drop=True).assign(**rates)


class Monitor:
    """`GapMonitor`, as ``pamid watch`` sets it up."""

    name = "GapMonitor"

    def __init__(self, bench: BenchParameters, rate: float) -> None:
        m, g = bench.muscle, bench.gas
        volume = volume_class("chou_hannaford").from_geometry(m.rest_length, m.rest_diameter, m.braid_angle)
        laws = [
            QuasiStaticForce(m.rest_length, g.atmospheric_pressure),
            ThermodynamicFlow(g.heat_capacity_ratio, g.gas_constant, g.temperature),
        ]
        self.make = lambda: GapMonitor(volume, laws, bench.plant(), false_alarms_per_hour=rate, play=play_of(bench))

    def start(self, healthy: pd.DataFrame) -> None:
        """Learn from a healthy stretch."""
        self.monitor = self.make().calibrate(healthy)
        self.begin = float(healthy["time"].iloc[-1])

    def follow(self, table: pd.DataFrame) -> list[tuple[str, float]]:
        """Return what was found and how many seconds after the healthy stretch."""
        return [(f.effect, f.time - self.begin) for f in self.monitor.update(table)]


class Adapters:
    """Two `OnlineAdapter`, one on the force with friction, one on the flow with a leak."""

    name = "OnlineAdapter"
    effects = (("F", ("viscous_friction", "coulomb_friction")), ("mdot", ("leakage",)))

    def __init__(self, bench: BenchParameters, rate: float) -> None:
        healthy = pd.concat([t for _, t in tables(bench, 4, 5, [], HEALTHY)])[::50]
        m, g = bench.muscle, bench.gas
        settings: dict[str, Any] = {"hidden_layer_sizes": (32, 32), "max_iter": 200, "random_state": 0}
        force = StaticPIHM(rest_length=m.rest_length, atmospheric_pressure=g.atmospheric_pressure, **settings)
        models = [force.fit(healthy[SIGNALS], healthy["F"]), ThermodynamicPIHM(**settings)]
        models[1].fit(healthy[SIGNALS], healthy["mdot"])
        self.make = [
            (
                column,
                OnlineAdapter(
                    FrozenEstimator(model),
                    effects,
                    plant=bench.plant(),
                    play=play_of(bench),
                    # One rate for both: each is allowed half of it.
                    false_alarms_per_hour=rate / 2,
                ),
            )
            for model, (column, effects) in zip(models, self.effects, strict=True)
        ]

    def start(self, healthy: pd.DataFrame) -> None:
        """Learn from a healthy stretch."""
        self.adapters = [(c, clone(a).fit(healthy[SIGNALS], healthy[c])) for c, a in self.make]

    def follow(self, table: pd.DataFrame) -> list[tuple[str, float]]:
        """Return which parameters drifted and how many seconds after the healthy stretch."""
        found = []
        for column, adapter in self.adapters:
            before = len(adapter.alarms_)
            for i in range(0, len(table), 1000):
                part = table[i : i + 1000]
                adapter.partial_fit(part[SIGNALS], part[column])
            found += [(a["parameter"].split(".")[0], a["time"]) for a in adapter.alarms_[before:]]
        return sorted(found, key=lambda f: f[1])


def play_of(bench: BenchParameters) -> float:
    """Return three times the encoder's noise, as a contraction."""
    return 3 * 1.9e-5 * bench.joint.pulley_radius / bench.muscle.rest_length


def named(bench: BenchParameters, n: int, hours: float, rate: float, kept: Checkpoint | None) -> None:
    """Print how fast and how rightly what appears is named, and the false alarms of healthy streams."""
    onset = HEALTHY + AT + 0.6  # the lead-in counts for the effect
    followers = [Monitor(bench, rate), Adapters(bench, rate)]

    def step(name: str, compute: Callable[[], Any]) -> Any:
        return kept.step(name, compute) if kept else compute()

    for k, (what, effect) in enumerate(
        [
            ("leakage", LateLeak(conductance=3e-11, onset=onset)),
            ("leakage", LateLeak(conductance=1e-10, onset=onset)),
            ("coulomb_friction", LateFriction(amplitude=1.0, onset=onset)),
            ("coulomb_friction", LateFriction(amplitude=4.0, onset=onset)),
        ]
    ):

        def stepped(k: int = k, effect: Any = effect) -> dict[str, list[Any]]:
            out: dict[str, list[Any]] = {f.name: [] for f in followers}
            for _, table in tables(bench, n, 10 + k, [effect], HEALTHY + WATCHED):
                learnt, at = (int(s * 1000) - HALF_WIDTH for s in (HEALTHY, HEALTHY + AT))
                for f in followers:
                    f.start(table[:learnt])
                    early, found = f.follow(table[learnt:at]), f.follow(table[at:])
                    out[f.name].append([bool(early), *(found[0] if found else ("nothing", np.inf))])
            return out

        size = ", ".join(f"{p}={v:g}" for p, v in effect.values.items() if p in ("conductance", "amplitude"))
        for follower, found in step(f"{k}: {what}", stepped).items():
            delay = np.array([f[2] if f[2] is not None else np.inf for f in found], dtype=float) - AT
            right = np.array([f[1] == what and not f[0] for f in found]) & (delay <= 2.0)
            wrong = sum(f[1] not in (what, "nothing") for f in found)
            print(
                f"{follower:13}  {what:16} {size:17} {len(found)} streams: named rightly within 2 s "
                f"{right.mean():6.1%} (target: 95 %), delay median {np.median(delay):.2f} s, 95 % "
                f"{np.quantile(delay, 0.95):.2f} s; named wrongly {wrong}, before it {sum(f[0] for f in found)}",
                flush=True,
            )
    seconds = 240.0
    counts = {f.name: 0 for f in followers}
    watched = 0.0
    for k in range(round(hours * 3600.0 / (8 * seconds))):

        def healthy(k: int = k) -> dict[str, int]:
            found = {f.name: 0 for f in followers}
            for _, table in tables(bench, 4, 100 + k, [], HEALTHY + seconds):
                for f in followers:
                    f.start(table[: int(HEALTHY * 1000)])
                    alarms = [t for _, t in f.follow(table[int(HEALTHY * 1000) :])]
                    # An alarm that goes on is one alarm.
                    found[f.name] += bool(alarms) + int(np.sum(np.diff(alarms) > 10.0))
            return found

        for follower, count in step(f"healthy {k}", healthy).items():
            counts[follower] += count
        watched += 8 * seconds / 3600.0
    for follower, count in counts.items():
        if watched:
            high = chi2.ppf(0.95, 2 * count + 2) / 2 / watched
            print(
                f"{follower:13}  healthy, {watched:.2f} h of signal: {count} false alarms, {count / watched:.2f} an "
                f"hour, below {high:.2f} with 95 % (target: {rate:g})"
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
    parser.add_argument("--hours", type=float, default=4.0, help="hours of healthy signal (default: 4)")
    parser.add_argument("--samples", type=int, default=10_000_000, help="samples of the endurance run")
    parser.add_argument("--rate", type=float, default=1.0, help="false alarms allowed an hour (default: 1)")
    parser.add_argument("--resume", metavar="FILE", help="keep finished cases in a file, and go on from it")
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    if args.samples:
        throughput(args.samples)
    if args.runs:
        settings = {"runs": args.runs, "hours": args.hours, "rate": args.rate}
        kept = Checkpoint(args.resume, settings) if args.resume else None
        named(BenchParameters.for_muscle("B"), args.runs, args.hours, args.rate, kept)


if __name__ == "__main__":
    main()
