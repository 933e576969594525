"""The simulated bench of muscle B and its usual runs; the fixture `log` is what its sensors write of them."""

from __future__ import annotations

from pamid.bench import BenchParameters, sine, step, triangle

NOMINAL = BenchParameters.for_muscle("B")
RUNS = [sine(4, 20, 2000), sine(10, 10, 2000), step(0, 15, 2000), triangle(2, 15, 2000)]
