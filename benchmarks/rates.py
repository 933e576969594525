"""Error of rates on noisy signals of known derivative: ``python benchmarks/rates.py``.

Signals are those of the bench at 1 kHz: sines, triangles, steps (second-order response) and a multisine, once as
joint angle of an encoder, once as pressure of a sensor. The error is RMSE over the standard deviation of the true
rate, median over seeds. "best" is the same method at the cut-off that knows the truth: how much automatic tuning gives
away. With --pynumdiff, and pynumdiff 0.3 installed, its RTS smoother joins the table; it is told the signal's band.
"""

from __future__ import annotations

import argparse
import time
import warnings

import numpy as np

from pamid.signals import differentiate, tune_cutoff
from pamid.signals.rates import METHODS

PERIOD = 1e-3
DURATION = 8.0
Signal = tuple[np.ndarray, np.ndarray]


def sine(t: np.ndarray, omega: float) -> Signal:
    return np.sin(omega * t), omega * np.cos(omega * t)


def triangle(t: np.ndarray, omega: float) -> Signal:
    phase = (omega * t / (2 * np.pi)) % 1.0
    value = np.where(phase < 0.25, 4 * phase, np.where(phase < 0.75, 2 - 4 * phase, 4 * phase - 4))
    return value, np.where((phase < 0.25) | (phase >= 0.75), 1.0, -1.0) * 4 * omega / (2 * np.pi)


def steps(t: np.ndarray, omega: float) -> Signal:
    """Steps every two seconds through a critically damped second order of bandwidth omega."""
    value, rate = np.zeros_like(t), np.zeros_like(t)
    for start, jump in zip(np.arange(0.5, t[-1], 2.0), [1.0, -2.0, 2.0, -1.0] * 4, strict=False):
        s = np.clip(t - start, 0, None) * omega
        value += jump * (1 - (1 + s) * np.exp(-s))
        rate += jump * omega * s * np.exp(-s)
    return value, rate


def multisine(t: np.ndarray, omega: float) -> Signal:
    lines = [(1.0, 0.3), (0.6, 1.7), (0.4, 2.9)]
    value = sum(a * np.sin(k * omega * t + p) for (a, p), k in zip(lines, (1.0, 2.3, 4.1), strict=True))
    rate = sum(a * k * omega * np.cos(k * omega * t + p) for (a, p), k in zip(lines, (1.0, 2.3, 4.1), strict=True))
    return np.asarray(value), np.asarray(rate)


SHAPES = {
    "sine 1 rad/s": (sine, 1.0),
    "sine 10 rad/s": (sine, 10.0),
    "triangle 1 rad/s": (triangle, 1.0),
    "triangle 10 rad/s": (triangle, 10.0),
    "step 20 rad/s": (steps, 20.0),
    "multisine 3 rad/s": (multisine, 3.0),
}
SENSORS = {
    # amplitude, noise, quantisation step
    "encoder 14 bit": (0.35, 0.0, 2 * np.pi / 2**14),
    "angle 0.2 mrad": (0.35, 2e-4, 0.0),
    "pressure 12 bit": (5e4, 150.0, 1e6 / 2**12),
    "pressure 1 kPa": (5e4, 1000.0, 0.0),
}


def measure(y: np.ndarray, noise: float, step: float, rng: np.random.Generator) -> np.ndarray:
    z = y + noise * rng.standard_normal(y.shape)
    return np.round(z / step) * step if step else z


def pynumdiff_rate(z: np.ndarray, omega: float) -> np.ndarray:
    """Rate by pynumdiff's constant-acceleration RTS smoother, tuned by pynumdiff, which is told the signal's band."""
    from pynumdiff.kalman_smooth import rtsdiff
    from pynumdiff.optimize import optimize

    fixed = {"order": 2, "forwardbackward": False}
    parameters, _ = optimize(
        rtsdiff, z, PERIOD, bandlimit=3 * omega / (2 * np.pi), search_space_updates=fixed, parallel=False
    )
    return rtsdiff(z, PERIOD, **parameters)[1]


def nrmse(rate: np.ndarray, truth: np.ndarray) -> float:
    return float(np.sqrt(np.mean((rate - truth) ** 2)) / truth.std())


def table(seeds: int, oracle: bool, rival: bool) -> None:
    t = np.arange(0.0, DURATION, PERIOD)
    names = ["gradient", "savgol", "spline", "kalman", *(["pynumdiff"] if rival else [])]
    head = [*names, *(["savgol best", "spline best", "kalman best"] if oracle else [])]
    print(f"{'sensor':16} {'signal':18} " + " ".join(f"{h:>11}" for h in head))
    lost = []
    for sensor, (amplitude, noise, step) in SENSORS.items():
        for shape, (function, omega) in SHAPES.items():
            value, rate = (amplitude * v for v in function(t, omega))
            rows = []
            for seed in range(seeds):
                z = measure(value, noise, step, np.random.default_rng(seed))
                row = [nrmse(np.gradient(z, PERIOD), rate)]
                row += [nrmse(differentiate(z, sampling_period=PERIOD, method=m)[1], rate) for m in METHODS]
                if rival:
                    row.append(nrmse(pynumdiff_rate(z, omega), rate))
                if oracle:
                    for method in METHODS:
                        cutoffs = np.geomspace(0.3, 300.0, 31)
                        errors = [
                            nrmse(differentiate(z, sampling_period=PERIOD, method=method, tuning=float(c))[1], rate)
                            for c in cutoffs
                        ]
                        row.append(min(errors))
                rows.append(row)
            median = np.median(rows, axis=0)
            if oracle:
                lost.append(median[1:4] / median[-3:])
            print(f"{sensor:16} {shape:18} " + " ".join(f"{v:11.4f}" for v in median))
    if oracle:
        ratio = np.exp(np.mean(np.log(lost), axis=0))
        print("automatic tuning against the best cut-off, geometric mean of the error's ratio: ", end="")
        print(", ".join(f"{m} {r:.2f}" for m, r in zip(METHODS, ratio, strict=True)))


def speed(rows: int) -> None:
    t = np.arange(rows) * PERIOD
    z = np.sin(t) + 1e-3 * np.random.default_rng(0).standard_normal(rows)
    for method in METHODS:
        start = time.perf_counter()
        cutoff = tune_cutoff(z, t, method=method)
        middle = time.perf_counter()
        differentiate(z, t, method=method, tuning=cutoff)
        end = time.perf_counter()
        print(f"{method}: {rows:.0e} rows tuned in {middle - start:.2f} s, smoothed in {end - middle:.2f} s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3, help="repetitions of the noise (default 3)")
    parser.add_argument("--no-oracle", action="store_true", help="leave out the best cut-off of each method")
    parser.add_argument("--pynumdiff", action="store_true", help="compare with pynumdiff, if installed (minutes)")
    parser.add_argument("--rows", type=int, default=1_000_000, help="rows of the timing (default 1e6)")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    table(arguments.seeds, not arguments.no_oracle, arguments.pynumdiff)
    speed(arguments.rows)


if __name__ == "__main__":
    main()
