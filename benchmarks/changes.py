"""Changes of a stream: how often `ChangeMonitor` alarms without one, and how soon with one, by what the model lacks."""

from __future__ import annotations

import argparse
import time
import warnings

import numpy as np
import pandas as pd
from pamid.estimators import GeometricForce
from scipy.stats import beta

from pamid.bench import BenchParameters
from pamid.effects import make_effect
from pamid.online import ChangeMonitor, StreamedEffect
from pamid.signals.state import State
from pamid.volume.braided import chou_hannaford

EVERY = 0.04  # s
FITTED, HEALTHY, WATCHED = 60.0, 300.0, 600.0  # s
AT = 120.0  # s into what is watched at which something changes
LACKING = {
    "nothing": {},
    "hysteresis": {"hysteresis": {}},
    "friction": {"coulomb_friction": {"amplitude": 8.0}},
    "both": {"hysteresis": {}, "coulomb_friction": {"amplitude": 8.0}},
}
"""What the muscle has and the model has not."""

CHANGES = {"force less by 10 %": 0.9, "force more by 10 %": 1.1, "force less by 30 %": 0.7}


def motion(seconds: float, rng: np.random.Generator) -> State:
    """Sums of five sines of 0.05 to 1.5 Hz, of a size of their own for each stream: contraction and pressure."""
    t = np.arange(0.0, seconds, EVERY)

    def sines(size: float) -> tuple[np.ndarray, np.ndarray]:
        f, phase = np.exp(rng.uniform(np.log(0.05), np.log(1.5), 5)), rng.uniform(0.0, 2.0 * np.pi, 5)
        angle = 2.0 * np.pi * f[:, None] * t + phase[:, None]
        share = size * rng.dirichlet(np.ones(5))[:, None]
        return (share * np.sin(angle)).sum(axis=0), (share * 2.0 * np.pi * f[:, None] * np.cos(angle)).sum(axis=0)

    (x, dx), (p, dp) = sines(rng.uniform(0.05, 0.1)), sines(rng.uniform(1e5, 2e5))
    return State(0.11 + x, dx, 3.6e5 + p, dp)


def stream(lacking: dict[str, dict[str, float]], rng: np.random.Generator) -> pd.DataFrame:
    """Return one stream: signals and the force, N."""
    bench = BenchParameters.for_muscle("B")
    s, m = motion(FITTED + HEALTHY + WATCHED, rng), bench.muscle
    F = chou_hannaford(s.P, s.eps, rest_diameter=m.rest_diameter, braid_angle=m.braid_angle)
    for name, values in lacking.items():
        followed = StreamedEffect(make_effect(name, **values), "force", bench.plant(), EVERY)
        start = np.array([getattr(followed.effect, parameter) for parameter in followed.names])
        F = F + followed.linearised(s, start)[0]
    return pd.DataFrame(s._asdict()).assign(F=F + rng.normal(0.0, 0.5, len(F)))


def watched(table: pd.DataFrame, factor: float = 1.0) -> tuple[float | None, float]:
    """Return when the monitor alarmed, in s after what is watched began, and the length of its blocks, s."""
    first, second = (round(s / EVERY) for s in (FITTED, FITTED + HEALTHY))
    X, F = table[["eps", "P"]], table["F"].to_numpy().copy()
    F[second + round(AT / EVERY) :] *= factor
    model = GeometricForce().fit(X[:first], F[:first])
    signals = X.assign(deps=table["deps"])

    class OfTwo:
        """The model reads two signals; the third tells the monitor which way the muscle moves."""

        def predict(self, X: pd.DataFrame) -> np.ndarray:
            return model.predict(X[["eps", "P"]])

    monitor = ChangeMonitor(OfTwo(), sampling_interval=EVERY)
    monitor.calibrate(signals[first:second], F[first:second])
    step = round(1.0 / EVERY)
    for k, start in enumerate(range(second, len(F), step)):
        if monitor.update(signals[start : start + step], F[start : start + step]):
            return k + 1.0, monitor.block * EVERY
    return None, monitor.block * EVERY


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--streams", type=int, default=100, help="streams without a change for each kind (default: 100)"
    )
    parser.add_argument("--changed", type=int, default=10, help="streams with each change for each kind (default: 10)")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    alarms = count = 0
    for kind, (what, lacking) in enumerate(LACKING.items()):
        started, found, blocks = time.process_time(), 0, []
        for k in range(args.streams):
            when, block = watched(stream(lacking, np.random.default_rng([args.seed, kind, k])))
            found, blocks = found + (when is not None), [*blocks, block]
        alarms, count = alarms + found, count + args.streams
        seconds = (time.process_time() - started) / max(args.streams, 1)
        print(
            f"model lacks {what:10}  without a change: {found} of {args.streams} streams of {WATCHED:.0f} s alarm; "
            f"blocks {np.median(blocks):.2g} s ({min(blocks):.2g} to {max(blocks):.2g}); {seconds:.1f} CPU s a stream",
            flush=True,
        )
        for j, (change, factor) in enumerate(CHANGES.items()):
            early, delays = 0, []
            for k in range(args.changed):
                when, _ = watched(stream(lacking, np.random.default_rng([args.seed, kind, j, k, 1])), factor)
                early += when is not None and when <= AT
                delays.append(np.inf if when is None or when <= AT else when - AT)
            print(
                f"model lacks {what:10}  {change}: told in {np.isfinite(delays).sum()} of {args.changed}, delay median "
                f"{np.median(delays):.0f} s, largest {np.max(delays):.0f} s; before it {early}",
                flush=True,
            )
    if count:
        high = beta.ppf(0.95, alarms + 1, count - alarms) if alarms < count else 1.0
        print(
            f"without a change, all kinds: {alarms} of {count} alarm, {alarms / count:.2%}, below {high:.2%} with 95 % "
            "(target: 1 %)"
        )


if __name__ == "__main__":
    main()
