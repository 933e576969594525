"""Whether the second plateau of training from scratch as run ends: muscle B, paper-like, one thing changed at a time.

Every 80th row in batches of 128 makes 31 steps an epoch, as many as the authors' every tenth row in batches of 1,024,
in an eighth of the time. ``--changed`` names what differs: the unit of the volume (2.15e-10 m³, of the authors'
plotting cell), or the print's decay and ε.
"""

from __future__ import annotations

import argparse
import time
import warnings
from typing import Any

import torch
from adaptation import COLUMNS, sizes
from adaptation_as_run import split, with_rates
from pamid.estimators import ThermodynamicPIHM

from pamid.bench import paper_like, paper_like_bench, simulate, unfold
from pamid.training import AdamAsRun
from pamid.training.units import TrainingUnits

CHANGED = ("nothing", "unit", "printed")
EPOCHS = 3177
SHOWN = (1, 200, 500, 700, 1000, 1500, 2000, 2500, 3177)


class Plotted(AdamAsRun):
    """The unit of volume with which the authors draw it."""

    units = TrainingUnits(inputs=(0.1, 0.1, 1e5, 1e5), targets={"flow": 2.1542e-5}, volume=2.1542e-10)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--changed", choices=CHANGED, default="nothing", help="what differs (default: nothing)")
    parser.add_argument("--seed", type=int, default=68, help="seed of noise, weights and rows (default: 68)")
    args = parser.parse_args()
    torch.set_num_threads(1)
    warnings.simplefilter("ignore")
    bench = paper_like_bench("B")
    log = simulate(bench, paper_like.sines("B"), seed=args.seed, controller=paper_like.SETTINGS["B"].controller)
    paper_like.flow_by_map(log, bench, args.seed)
    train, _ = split(with_rates(unfold(log, bench)), 10, args.seed)
    train = train[::8][:3968]
    printed: dict[str, Any] = {"decay": "twice", "epsilon_inside": True} if args.changed == "printed" else {}
    trainer = (Plotted if args.changed == "unit" else AdamAsRun)(max_iter=EPOCHS, batch_size=128, **printed)
    options = {"volume_model": "neural", "dtype": "float32", "validation_fraction": 0.0, "gas_constant": 263.8}
    begin = time.process_time()
    model = ThermodynamicPIHM(**sizes("B"), **options, trainer=trainer, max_iter=EPOCHS, random_state=args.seed)
    curve = model.fit(train[COLUMNS[1:]], train["mdot"]).loss_curve_
    losses = ", ".join(f"{epoch}: {curve[epoch - 1]:.3g}" for epoch in SHOWN)
    seconds = time.process_time() - begin
    print(f"{args.changed} changed, {len(train)} rows, {seconds:.0f} CPU s; loss by epoch: {losses}")


if __name__ == "__main__":
    main()
