"""Why the four published adaptations rank as they do on the simulated bench: one setting is changed at a time.

All adapt one source, trained on muscle A by second order to where Algorithm 1 ends, to every hundredth sample of B as
printed (``--epochs`` of 10,000), and are judged on all sines of B as the study's target task. What is changed is named
in the first column: the sensors, the muscle, the valve, the excitation, the scaling of inputs and of the flow, and the
optimiser. The paper's own ratios to Q stand in the last line.
"""

from __future__ import annotations

import argparse
import json
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from adaptation import COLUMNS, EPOCHS, log, source, truth
from adaptation_published import METHODS, adaptation
from pamid.estimators import RateTransformer, ThermodynamicPIHM
from sklearn.frozen import FrozenEstimator

from pamid.bench import BenchParameters, dataset, unfold
from pamid.bench.sensors import SENSORS
from pamid.laws.valve import Valve
from pamid.training import Adam
from pamid.volume.neural import InputScale

PAPER = {"FFT": 1.86, "PFT": 1.83, "LoRA": 1.40, "Q": 1.14}
"""L2 norms of Table 2 on the target task, A to B."""
BAR = np.array([1.0, 1.0, 1e5, 1e5])
"""Units of inputs that are not standardised: contraction, 1/s, bar, bar/s."""
GRAMS = 1e3


def simulated(seed: int, *, noise: float = 1.0, effects: Any = (), by_map: bool = False) -> pd.DataFrame:
    """Simulate the sines of B with other sensors or another bench, with rates; the flow as the valve's map says."""
    params = BenchParameters.for_muscle("B")
    sensors = {channel: replace(s, noise=noise * s.noise) for channel, s in SENSORS.items()}
    table = unfold(dataset("D_B", seed=seed, muscle="B", effects=effects, sensors=sensors), params)
    table = table[table["muscle"] == 1].reset_index(drop=True)
    if by_map:
        v, gas = params.valve, params.gas
        valve = Valve(v.sonic_conductance, v.critical_pressure_ratio, gas.supply_pressure, gas.atmospheric_pressure)
        table["mdot"] = valve.flow(table["u"].to_numpy(), table["P"].to_numpy())
    return RateTransformer(columns=("eps", "P"), smooth=True).fit_transform(
        table[["trajectory", "time", "eps", "P", "mdot"]]
    )


class RawInputs(InputScale):
    """Inputs as they are, in bar."""

    @classmethod
    def of(cls, x: np.ndarray, weight: np.ndarray | None = None, *, correction: bool = False) -> InputScale:
        """Return a scale of plain units."""
        n = x.shape[1]
        return InputScale(np.zeros(n), BAR, np.full(n, -np.inf), np.full(n, np.inf), np.zeros(n, dtype=bool))


def raw_source(seed: int, steps: int) -> ThermodynamicPIHM:
    """Train a source whose inputs are not standardised."""
    from pamid.estimators import _pihm

    kept, _pihm.InputScale = _pihm.InputScale, RawInputs
    try:
        return source("neural", "A", seed, steps)
    finally:
        _pihm.InputScale = kept


def cases(seed: int, steps: int) -> dict[str, Callable[[], tuple[Any, pd.DataFrame, pd.DataFrame, dict[str, Any]]]]:
    """Return source, samples of the adaptation, samples that judge, and changed options, by what is changed."""
    plain = source("neural", "A", seed, steps)
    whole = log("D_B", "B", seed)
    slow = whole[whole["trajectory"].str.contains("sine-[12]-")]
    spread = float(np.std(GRAMS * whole["mdot"]))

    def adam(**changed: Any) -> dict[str, Any]:
        return {"trainer": Adam(batch_size=128, **changed)}

    # A loss in (g/s)² instead of variances is, to Adam, another weight of the decay and another ε.
    in_grams = adam(weight_decay=1e-5 / spread**2, epsilon=1e-8 / spread**4)
    return {
        "nothing": lambda: (plain, whole, whole, {}),
        "no noise, true rates": lambda: (plain, truth("D_B", "B"), truth("D_B", "B"), {}),
        "noise of all sensors x 5": lambda: (plain, d := simulated(seed, noise=5.0), d, {}),
        "B's braid 10 % steeper": lambda: (plain, d := simulated(seed, effects=[("braid_angle", {})]), d, {}),
        "B with hysteresis of its braid": lambda: (
            plain,
            d := simulated(seed, effects=["thread_extensibility"]),
            d,
            {},
        ),
        "flow by the valve's map, spool lags 10 ms": lambda: (
            plain,
            d := simulated(seed, effects=["valve_lag"], by_map=True),
            d,
            {},
        ),
        "slow sines only (1, 2 rad/s)": lambda: (plain, slow, whole, {}),
        "inputs not standardised (bar)": lambda: (raw_source(seed, steps), whole, whole, {}),
        "flow in g/s": lambda: (plain, whole, whole, in_grams),
        "no decay": lambda: (plain, whole, whole, adam(weight_decay=0.0)),
        "ε beside the root": lambda: (plain, whole, whole, adam(epsilon_inside=False)),
        "learning rate 1e-5": lambda: (plain, whole, whole, adam(learning_rate=1e-5)),
        "learning rate 1e-3": lambda: (plain, whole, whole, adam(learning_rate=1e-3)),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=1, help="seeds of noise, weights and draws (default 1)")
    parser.add_argument("--epochs", type=int, default=EPOCHS, help="epochs of the adaptations (default 10000)")
    parser.add_argument("--steps", type=int, default=60, help="steps of the source (default 60)")
    parser.add_argument("--only", nargs="*", help="only what is changed by a name that holds one of these texts")
    parser.add_argument("--out", metavar="FILE.json", help="where to keep all figures")
    args = parser.parse_args()
    torch.set_num_threads(1)
    warnings.simplefilter("ignore")
    found: list[dict[str, Any]] = []
    print(f"root mean square error on the target task, 1e-6 kg/s; {args.epochs} epochs")
    print(f"{'changed':42s} seed " + " ".join(f"{m:>8s}" for m in METHODS) + "  ranking, ratios to Q")
    for seed in range(args.seeds):
        for name, case in cases(seed, args.steps).items():
            if args.only and not any(text in name for text in args.only):
                continue
            model, samples, judged, changed = case()
            frozen = FrozenEstimator(model.set_params(dtype="float32"))
            few = samples.iloc[:: max(1, len(samples) // 315)]
            row: dict[str, Any] = {"changed": name, "seed": seed}
            for method in METHODS:
                fitted = adaptation(method, frozen, "B", seed, args.epochs, **changed).fit(few[COLUMNS], few["mdot"])
                row[method] = float(np.sqrt(np.mean((fitted.predict(judged[COLUMNS]) - judged["mdot"]) ** 2)))
            found.append(row)
            print(
                f"{name:42s} {seed:4d} " + " ".join(f"{1e6 * row[m]:8.2f}" for m in METHODS) + ranking(row), flush=True
            )
            if args.out:
                Path(args.out).write_text(json.dumps({"ranking": found}), encoding="utf-8")
    print(f"{'the paper':42s} {'':4s} " + " ".join(f"{PAPER[m]:8.2f}" for m in METHODS) + ranking(PAPER))


def ranking(row: dict[str, Any]) -> str:
    """Say which method comes first, and by how much the others are behind Q."""
    order = sorted(METHODS, key=lambda m: row[m])
    return "  " + " < ".join(order) + "  " + ", ".join(f"{m} {row[m] / row['Q']:.2f}" for m in METHODS if m != "Q")


if __name__ == "__main__":
    main()
