"""Algorithm 1 of the study in full, from scratch on a simulated muscle, against pamid's training from scratch.

Both take all the muscle's samples (31,464 of B) and the same seed. Algorithm 1 runs its 10,000 epochs in single
precision, the quicker one for it, with pamid's own gradient, and is judged on the way. Times are CPU seconds of one
thread, those of Algorithm 1 without its judging; a seed takes about 20 minutes.
"""

from __future__ import annotations

import argparse
import json
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import torch
from adaptation import COLUMNS, EPOCHS, TrueVolume, errors, log, loss, medians, show, sizes, source, timed
from pamid.estimators import ThermodynamicPIHM

from pamid.training import Adam

MARKS = (100, 300, 1000, 2000, 3000, 5000, 7000)
"""Epochs at which Algorithm 1 is judged on the way."""


def algorithm_1(muscle: str, seed: int, epochs: int, report: Callable[[dict[str, Any]], None]) -> None:
    """Train as published; report the parameters at some epochs, as the algorithm leaves them, judged and timed."""
    data = log(f"D_{muscle}", muscle, seed)
    X, y = data[COLUMNS[1:]], data["mdot"]
    options = {**sizes(muscle), "volume_model": "neural", "dtype": "float32", "validation_fraction": 0.0}
    judge = ThermodynamicPIHM(**options, trainer="adam", max_iter=1).fit(X, y)

    class Watched(Adam):
        """Judge the parameters of some epochs; count the CPU time of the steps alone."""

        def steps(self, *given: Any, **more: Any) -> Iterator[tuple[Any, float]]:
            spent, iterations = 0.0, super().steps(*given, **more)
            for epoch in range(1, self.max_iter + 1):
                found, seconds = timed(lambda: next(iterations))
                spent += seconds
                if epoch in MARKS or epoch == self.max_iter:
                    judge.weights_ = [p.numpy().astype(float) for p in found[0]]
                    report(judged(judge, muscle, seed, f"Algorithm 1, {epoch} epochs", spent))
                yield found

    ThermodynamicPIHM(**options, trainer=Watched(), max_iter=epochs, random_state=seed).fit(X, y)


def judged(model: Any, muscle: str, seed: int, method: str, seconds: float) -> dict[str, Any]:
    """Return a row of the table."""
    data = log(f"D_{muscle}", muscle, seed)
    row = {"muscle": muscle, "seed": seed, "method": method, "parameters": model.n_parameters_, "samples": len(data)}
    return row | {"loss": loss(model, data), "seconds": seconds} | errors(model, muscle, seed)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--muscles", nargs="+", choices="ABC", default=["B"], help="muscles (default: B)")
    parser.add_argument("--seeds", type=int, default=1, help="seeds of noise and weights (default 1)")
    parser.add_argument("--epochs", type=int, default=EPOCHS, help="epochs of Algorithm 1 (default 10000)")
    parser.add_argument("--steps", type=int, default=60, help="steps of pamid's trainer (default 60)")
    parser.add_argument("--out", metavar="FILE.json", help="where to keep all figures, as they come")
    args = parser.parse_args()
    torch.set_num_threads(1)
    warnings.simplefilter("ignore")
    found: list[dict[str, Any]] = []

    def report(row: dict[str, Any]) -> None:
        found.append(row)
        show(row)
        if args.out:
            Path(args.out).write_text(json.dumps({"scratch": found}), encoding="utf-8")

    for seed in range(args.seeds):
        for muscle in args.muscles:
            log(f"D_{muscle}", muscle, seed)  # simulated once, and outside of all times
            for kind in ("anchored", "neural"):
                model, seconds = timed(lambda k=kind, m=muscle, s=seed: source(k, m, s, args.steps))
                report(judged(model, muscle, seed, f"second order, {kind}", seconds))
            report(judged(TrueVolume(muscle), muscle, seed, "true volume", 0.0))
            algorithm_1(muscle, seed, args.epochs, report)
    medians(found)


if __name__ == "__main__":
    main()
