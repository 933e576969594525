"""Time of a control cycle, four evaluations with derivatives, in exported C, and of one row through ``predict``."""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
from pamid.estimators import StaticPIHM

from pamid import load, save
from pamid.export import export

TIMER = r"""
#define _POSIX_C_SOURCE 199309L
#include "force.h"
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
static int by_size(const void *a, const void *b)
{
    const float d = *(const float *)a - *(const float *)b;
    return d > 0 ? 1 : d < 0 ? -1 : 0;
}
int main(int argc, char **argv)
{
    const long n = argc > 1 ? atol(argv[1]) : 1000000;
    const struct timespec pause = {0, argc > 2 ? 1000 * atol(argv[2]) : 0};
    const int at_once = argc > 3 && atoi(argv[3]);
    float *t = malloc((size_t)n * sizeof *t);
    double sum = 0;
    long i, over = 0;
    int k;
    for (i = 0; i < n; i++) {
        struct timespec a, b;
        force_state s[4];
        force_real y[4][FORCE_OUTPUTS];
        force_jet jet[4];
        if (pause.tv_nsec)
            nanosleep(&pause, NULL);
        clock_gettime(CLOCK_MONOTONIC, &a);
        for (k = 0; k < 4; k++) {
            const force_state now = {(force_real)(0.05 + 0.0001 * (double)(i % 2000)), (force_real)(0.1 * k),
                                     (force_real)(2e5 + 100.0 * (double)(i % 3000)), (force_real)(1e5 * k)};
            s[k] = now;
        }
        if (at_once)
            force_predict_rows(4, s, y, jet);
        else
            for (k = 0; k < 4; k++)
                force_predict(s + k, y[k], jet + k);
        for (k = 0; k < 4; k++)
            sum += (double)y[k][0] + (double)jet[k].V_P;
        clock_gettime(CLOCK_MONOTONIC, &b);
        t[i] = (float)((double)(b.tv_sec - a.tv_sec) * 1e6 + (double)(b.tv_nsec - a.tv_nsec) * 1e-3);
        over += t[i] > 20;
    }
    qsort(t, (size_t)n, sizeof *t, by_size);
    printf("%.2f %.2f %.2f %.2f %.1f %ld %g\n", t[n / 2], t[n - n / 100], t[n - n / 10000], t[n - 1], t[0], over, sum);
    free(t);
    return 0;
}
"""


def model() -> StaticPIHM:
    """Fit a force model of default size on a made-up muscle; how well does not matter for time."""
    t = np.linspace(0, 20, 2000)
    X = pd.DataFrame(
        {
            "eps": 0.12 + 0.07 * np.sin(t),
            "deps": 0.07 * np.cos(t),
            "P": 3.5e5 + 1.5e5 * np.cos(3 * t),
            "dP": -4.5e5 * np.sin(3 * t),
        }
    )
    F = (X["P"] - 101_325) * 5e-4 * (1 - 3 * X["eps"]) + 3 * np.tanh(X["deps"] / 0.02)
    return StaticPIHM(max_iter=10, random_state=0).fit(X, F)


def python_times(fitted: StaticPIHM, calls: int) -> None:
    """Print the time of predict on one row: as an array to a model of arrays, and as a DataFrame."""
    row = pd.DataFrame([[0.12, 0.02, 3.4e5, 1e4]], columns=["eps", "deps", "P", "dP"])
    plain = load(save(fitted, Path(tempfile.mkdtemp()) / "m.pamid"))
    del plain.feature_names_in_
    for name, estimator, X in (("array", plain, row.to_numpy()), ("DataFrame", fitted, row)):
        for _ in range(200):
            estimator.predict(X)
        taken = np.empty(calls)
        for i in range(calls):
            start = time.perf_counter()
            estimator.predict(X)
            taken[i] = time.perf_counter() - start
        q = np.quantile(taken, [0.5, 0.99, 0.9999]) * 1e6
        print(
            f"predict, one row, {name:9}  median {q[0]:6.1f} µs  99 % {q[1]:6.1f}  99.99 % {q[2]:8.1f}  "
            f"worst of {calls:,} {taken.max() * 1e6:9.1f} µs  (target: 200 µs)"
        )


def at_once() -> None:
    """Schedule the process before all others, which a scheduler would otherwise give turns within its worst calls."""
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--calls", type=int, default=1_000_000, help="control cycles in C (default: 1000000)")
    parser.add_argument("--python-calls", type=int, default=20_000, help="calls of predict (default: 20000)")
    parser.add_argument(
        "--real-time",
        action="store_true",
        help="run the C code as a controller would: before all else (needs rights), with pauses of 100 µs",
    )
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    fitted = model()
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        print("C: skipped, there is no compiler on this machine")
    for dtype in ("float64", "float32") if compiler else ():
        for flags in (["-O3", "-DFORCE_ONE_VERSION"], ["-O3"], ["-O3", "-march=x86-64-v3"], ["-O3", "-march=native"]):
            with tempfile.TemporaryDirectory() as folder:
                export(fitted, folder, "c", name="force", dtype=dtype)
                (Path(folder) / "timer.c").write_text(TIMER)
                command = [str(compiler), "-std=c99", *flags, "force.c", "timer.c", "-lm", "-o", "timer"]
                if subprocess.run(command, cwd=folder, check=False, capture_output=True).returncode:
                    print(f"four evaluations in C, {dtype}, {' '.join(flags)}: skipped, this compiler does not know it")
                    continue
                for calls, rows in (("one call", "1"), ("four calls", "0")):
                    timer = [f"{folder}/timer", str(args.calls), "100" if args.real_time else "0", rows]
                    first = at_once if args.real_time else None
                    done = subprocess.run(timer, capture_output=True, text=True, check=True, preexec_fn=first)
                    out = done.stdout.split()
                    print(
                        f"four evaluations in C, {calls:10}, {dtype}, {' '.join(flags):24}  median {out[0]:>6} µs  "
                        f"99 % {out[1]:>6}  99.99 % {out[2]:>8}  worst of {args.calls:,} {out[3]:>9} µs, "
                        f"{out[5]} above 20 µs"
                    )
    if args.python_calls:
        python_times(fitted, args.python_calls)


if __name__ == "__main__":
    main()
