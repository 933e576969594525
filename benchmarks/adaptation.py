"""Adaptation from muscle A to B and C on the simulated bench as in the study, and between measured Festo muscles.

Parts: ``table`` (parameters, loss, errors on target, triangles and steps, time, of pamid's own methods; the published
ones stand in ``adaptation_published.py``), ``rates`` (errors where the rate of the pressure is taken with the valve's
flow at its command as an input), ``samples`` (held-out error over the number of adaptation samples), ``muscles`` (every
muscle as source and as target), ``scaling`` (a step's time and memory over samples and width, against the matrix
products alone), ``festo`` (needs ``--festo FOLDER`` with ``10mm_20cm_Unkink.mat`` and its like in it or below, of
github.com/Agile-and-Adaptive-Robotics/Muscle_Sensory, no licence stated and not part of this package). Times are CPU
seconds of one thread, so that other work on the machine does not count.
"""

from __future__ import annotations

import argparse
import json
import os
import time
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # the figures are for one core
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pandas as pd
import torch
from pamid.estimators import (
    QAdapter,
    RateTransformer,
    ScaleAdapter,
    StaticPIHM,
    ThermodynamicPIHM,
)
from sklearn.frozen import FrozenEstimator

from pamid.bench import BenchParameters, dataset, unfold
from pamid.laws.gas import mass_flow
from pamid.laws.thermodynamic import ThermodynamicFlow
from pamid.laws.valve import Valve
from pamid.signals import State

EPOCHS = 10_000
"""Epochs of the published algorithms."""
COLUMNS = ["trajectory", "eps", "deps", "P", "dP"]
SETS = ("target", "tri", "step", "true tri", "true step")
"""Data sets; the true ones are free of the sensors' noise and of errors of estimated rates."""
CUTOFFS: dict[tuple[str, str], Any] = {}


def sizes(muscle: str) -> dict[str, float]:
    m = BenchParameters.for_muscle(muscle).muscle
    return {"rest_length": m.rest_length, "rest_diameter": m.rest_diameter}


@cache
def log(name: str, muscle: str, seed: int, driven: str = "") -> pd.DataFrame:
    """Simulate a data set and take the upper muscle with its rates, tuned on the first seed's runs.

    With a method as `driven`, the rate of the pressure is taken with the flow of the valve at its command as an input.
    """
    params = BenchParameters.for_muscle(muscle)
    table = unfold(dataset(name, seed=seed, muscle=muscle), params)
    table = table[table["muscle"] == 1].reset_index(drop=True)
    flow = Valve(**vars(params.valve), supply_pressure=params.gas.supply_pressure).flow(table["u"], table["P"])
    table = table[["trajectory", "time", "eps", "P", "mdot"]]
    if driven:
        rates = RateTransformer(columns=("eps", "P"), smooth=True, method=driven, inputs={"P": ["flow"]})
        return rates.fit_transform(table.assign(flow=flow))
    rates = RateTransformer(columns=("eps", "P"), smooth=True, tuning=CUTOFFS.get((name, muscle), "auto")).fit(table)
    CUTOFFS.setdefault((name, muscle), tuple(rates.cutoffs_))
    return rates.transform(table)


@cache
def truth(name: str, muscle: str) -> pd.DataFrame:
    """Return the simulator's own signals of the upper muscle and the flow that its volume takes."""
    plant = BenchParameters.for_muscle(muscle).plant()
    table, true = dataset(name, seed=0, muscle=muscle, truth=True)
    eps, deps, P, dP = (np.asarray(true[f"{s}1"], dtype=float) for s in ("eps", "deps", "P", "dP"))
    flow = mass_flow(P, dP, np.asarray(true["V1"], dtype=float), plant.volume_slope(eps) * deps)
    return pd.DataFrame(
        {"trajectory": table["trajectory"].to_numpy(), "eps": eps, "deps": deps, "P": P, "dP": dP, "mdot": flow}
    )


class TrueVolume:
    """What the law gives with the simulator's own volume: the error that rates and sensors leave."""

    n_parameters_ = 0

    def __init__(self, muscle: str) -> None:
        self.plant = BenchParameters.for_muscle(muscle).plant()

    def predict(self, X: pd.DataFrame) -> np.ndarray:
        """Predict the flow, kg/s."""
        state = State(*(X[s].to_numpy() for s in COLUMNS[1:]))
        V = self.plant.volume(state.eps)
        return ThermodynamicFlow().predict(V, self.plant.volume_slope(state.eps), 0 * V, state)


def sets_of(muscle: str, seed: int, driven: str = "") -> dict[str, pd.DataFrame]:
    return {
        "target": log(f"D_{muscle}", muscle, seed, driven),
        "tri": log("D_tri", muscle, 0, driven),
        "step": log("D_step", muscle, 0, driven),
        "true tri": truth("D_tri", muscle),
        "true step": truth("D_step", muscle),
    }


def errors(model: Any, muscle: str, seed: int, driven: str = "") -> dict[str, float]:
    """Root mean square errors, kg/s."""
    tables = sets_of(muscle, seed, driven)
    out = {}
    for name, d in tables.items():
        X = d[COLUMNS[1:]] if isinstance(model, ThermodynamicPIHM) else d[COLUMNS]
        out[name] = float(np.sqrt(np.mean((model.predict(X) - d["mdot"]) ** 2)))
    return out


def source(kind: str, muscle: str, seed: int, steps: int, driven: str = "") -> ThermodynamicPIHM:
    """Train a source on all its samples; the published network by second order, to the same loss in less time."""
    d = log(f"D_{muscle}", muscle, seed, driven)
    model = ThermodynamicPIHM(**sizes(muscle), volume_model=kind, max_iter=steps, random_state=seed)
    return model.fit(d[COLUMNS[1:]], d["mdot"], groups=d["trajectory"])


def timed(fit: Callable[[], Any]) -> tuple[Any, float]:
    start = time.process_time()
    return fit(), time.process_time() - start


# --- the table -----------------------------------------------------------------------------------------------
def methods(neural: Any, anchored: Any, muscle: str, seed: int) -> dict[str, Any]:
    """Return pamid's adaptations."""
    ours = {**sizes(muscle), "random_state": seed}
    return {
        "Q alone": QAdapter(anchored, base="frozen", **ours),
        "scales": ScaleAdapter(anchored, rest_length=sizes(muscle)["rest_length"], random_state=seed),
        "Q, pull chosen": QAdapter(anchored, **ours),
        **{f"Q, pull {pull:g}": QAdapter(anchored, weight_decay=pull, **ours) for pull in PULLS},
        "Q alone, published network": QAdapter(neural, base="frozen", **ours),
        "Q, pull 1e-05, published network": QAdapter(neural, weight_decay=1e-5, **ours),
    }


PULLS = (1e-3, 1e-4, 1e-5, 1e-6)
"""Strengths of the pull toward the source; a weaker one lets the training loss fall further."""


def table_part(args: argparse.Namespace) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    for seed in range(args.first_seed, args.first_seed + args.seeds):
        networks = {kind: FrozenEstimator(source(kind, "A", seed, args.steps)) for kind in ("neural", "anchored")}
        for muscle in args.targets:
            whole = log(f"D_{muscle}", muscle, seed)
            few = whole.iloc[::100]
            for name, estimator in methods(networks["neural"], networks["anchored"], muscle, seed).items():
                if args.methods and not any(wanted in name for wanted in args.methods):
                    continue
                model, seconds = timed(lambda e=estimator, d=few: e.fit(d[COLUMNS], d["mdot"]))
                row = {"muscle": muscle, "seed": seed, "method": name, "parameters": model.n_parameters_}
                row |= {"samples": len(few), "loss": loss(model, few), "seconds": seconds}
                row |= errors(model, muscle, seed)
                if seed == 0 and muscle == "B":
                    row["curve"] = [float(v) for v in model.loss_curve_][:: max(1, len(model.loss_curve_) // 400)]
                found.append(row)
                show(row)
            if seed == 0:
                row = {"muscle": muscle, "seed": seed, "method": "true volume", "parameters": 0, "samples": 0}
                found.append(
                    row
                    | {"loss": loss(TrueVolume(muscle), whole), "seconds": 0.0}
                    | errors(TrueVolume(muscle), muscle, 0)
                )
                show(found[-1])
            for kind in ("neural", "anchored") if seed < args.scratch_seeds else ():
                model, seconds = timed(lambda k=kind, m=muscle, s=seed: source(k, m, s, args.steps))
                row = {"muscle": muscle, "seed": seed, "method": f"scratch, {kind}", "parameters": model.n_parameters_}
                row |= {"samples": len(whole), "loss": loss(model, whole), "seconds": seconds}
                found.append(row | errors(model, muscle, seed))
                show(found[-1])
    return found


def loss(model: Any, data: pd.DataFrame) -> float:
    """Mean squared residual on the data of the fit, in units of their variance."""
    X = data[COLUMNS[1:]] if isinstance(model, ThermodynamicPIHM) else data[COLUMNS]
    return float(np.mean((model.predict(X) - data["mdot"]) ** 2) / np.var(data["mdot"]))


def show(row: dict[str, Any]) -> None:
    cells = " ".join(f"{1e6 * row[s]:8.2f}" for s in SETS)
    print(
        f"{row['muscle']} seed {row['seed']} {row['method']:32s} {row['parameters']:7d} {row['loss']:.3e} {cells} "
        f"{row['seconds']:9.2f}",
        flush=True,
    )


def medians(found: list[dict[str, Any]]) -> None:
    """Print medians and ranges over seeds."""
    d = pd.DataFrame(found).drop(columns=["curve", "epochs", "predictions"], errors="ignore")
    print(f"\nmedian [least, greatest] over {d['seed'].nunique()} seeds (n where fewer); 1e-6 kg/s; CPU s")
    print(
        f"{'':2s}{'method':34s}{'params':>8s} {'loss/1e-5':>22s} "
        + " ".join(f"{s:>22s}" for s in SETS)
        + f"{'time':>12s}"
    )
    for (muscle, method), g in d.groupby(["muscle", "method"], sort=False):

        def cell(column: str, unit: float, g: pd.DataFrame = g) -> str:
            v = g[column] / unit
            return f"{v.median():8.2f} [{v.min():.2f}, {v.max():.2f}]".rjust(22)

        cells = " ".join([cell("loss", 1e-5), *(cell(s, 1e-6) for s in SETS)])
        few = f" (n = {len(g)})" if len(g) < d["seed"].nunique() else ""
        print(f"{muscle:2s}{method + few:34s}{g['parameters'].max():8d} {cells}{g['seconds'].median():12.2f}")


# --- other parts ---------------------------------------------------------------------------------------------
COUNTS = (30, 100, 300, 1000, 3000)


def samples_part(args: argparse.Namespace) -> list[dict[str, Any]]:
    """Held-out error over the number of adaptation samples, evenly spread over all runs."""
    found = []
    for seed in range(args.first_seed, args.first_seed + args.seeds):
        networks = {kind: FrozenEstimator(source(kind, "A", seed, args.steps)) for kind in ("neural", "anchored")}
        for muscle in args.targets:
            whole = log(f"D_{muscle}", muscle, seed)
            for count in COUNTS:
                few = whole.iloc[:: len(whole) // count]
                common = {**sizes(muscle), "random_state": seed}
                for name, estimator in (
                    ("Q alone", QAdapter(networks["anchored"], base="frozen", **common)),
                    ("Q, pull chosen", QAdapter(networks["anchored"], **common)),
                    ("Q, published network", QAdapter(networks["neural"], **common)),
                    ("no source", ThermodynamicPIHM(**common, max_iter=40)),
                ):
                    X = few[COLUMNS] if isinstance(estimator, QAdapter) else few[COLUMNS[1:]]
                    row = {"muscle": muscle, "seed": seed, "count": count, "method": name}
                    found.append(row | errors(estimator.fit(X, few["mdot"]), muscle, seed))
                    cells = " ".join(f"{1e6 * found[-1][s]:8.2f}" for s in SETS)
                    print(f"{muscle} seed {seed} {count:5d} samples {name:22s} {cells}", flush=True)
    return found


def muscles_part(args: argparse.Namespace) -> list[dict[str, Any]]:
    """Every muscle as source and as target."""
    found = []
    for seed in range(args.first_seed, args.first_seed + args.seeds):
        for first in "ABC":
            network = FrozenEstimator(source("anchored", first, seed, args.steps))
            for second in "ABC":
                if first == second:
                    continue
                few = log(f"D_{second}", second, seed).iloc[::100]
                model = QAdapter(network, **sizes(second), random_state=seed).fit(few[COLUMNS], few["mdot"])
                row = {"seed": seed, "source": first, "muscle": second, "Q": model.q_, "Q0": model.q0_}
                found.append(row | errors(model, second, seed))
                cells = " ".join(f"{1e6 * found[-1][s]:8.2f}" for s in SETS)
                print(f"seed {seed} {first} -> {second} Q = {model.q_:.4f} (Q0 = {model.q0_:.4f}) {cells}", flush=True)
    return found


def scaling_part(args: argparse.Namespace) -> list[dict[str, Any]]:
    """Time and memory of one step in sample space, against its matrix products and factorisation alone."""
    from pamid.training import LevenbergMarquardt, TrainingProblem
    from pamid.training.network import initial_parameters

    found = []
    for width in (32, 64, 128, 256):
        for n in (100, 300, 1000, 2000):
            rng = np.random.default_rng(0)
            direction, a = rng.normal(size=(n, 4)) * [1, 0, 1, 0], rng.normal(size=n)
            problem = TrainingProblem.from_arrays(rng.normal(size=(n, 4)), direction, a, rng.normal(size=n))
            start = initial_parameters((4, width, width, 1), np.random.RandomState(0), torch.float64)
            trainer = LevenbergMarquardt(max_iter=10**6, batch_size=n, damping=1.0, tolerance=0.0)
            steps = trainer.steps(problem, start, "softplus", np.random.RandomState(0))
            next(steps)
            spent, held = [], peak_memory()
            for _ in range(args.repeats):
                begin = time.process_time()
                next(steps)
                spent.append(time.process_time() - begin)
            memory = peak_memory(reset=False) - held
            floor = min(products(n, width) for _ in range(args.repeats))
            row = {"width": width, "n": n, "seconds": min(spent), "floor": floor, "bytes": memory}
            found.append(row)
            print(
                f"width {width:4d} samples {n:5d} step {1e3 * row['seconds']:8.2f} ms, products {1e3 * floor:8.2f} ms, "
                f"ratio {row['seconds'] / floor:5.2f}, "
                f"{memory / 2**20:6.1f} MiB above the start",
                flush=True,
            )
    return found


def peak_memory(*, reset: bool = True) -> int:
    """Return the most memory held since the last reset, bytes (Linux; 0 elsewhere)."""
    status, clear = Path("/proc/self/status"), Path("/proc/self/clear_refs")
    if not (status.exists() and clear.exists()):
        return 0
    if reset:
        clear.write_text("5", encoding="ascii")
    line = next(v for v in status.read_text(encoding="ascii").splitlines() if v.startswith("VmHWM"))
    return 1024 * int(line.split()[1])


def products(n: int, width: int) -> float:
    """Time the products of a step: forward, adjoint, gradient, trial, the Gram matrices of each layer, one factor."""
    A, W, K = torch.randn(2 * n, width).double(), torch.randn(width, width).double(), torch.eye(n).double()
    begin = time.process_time()
    for _ in range(2):
        _ = A @ W.T
    _ = A @ W, A.T @ A
    H = A[:n]
    for _ in range(8):
        _ = H @ H.T
    _ = torch.linalg.cholesky(K)
    return time.process_time() - begin


# --- Festo ---------------------------------------------------------------------------------------------------
FESTO = {
    "10mm_30cm": (0.281, 0.010),
    "10mm_20cm": (0.182, 0.010),
    "10mm_40cm": (0.382, 0.010),
    "20mm_10cm": (0.098, 0.020),
}
"""Measured muscles: the beginning of their files' names, length and diameter, m."""
CUTOFF = 2.0
"""Cut-off of the measured muscles' rates, Hz."""
WHOLE = 6000
"""Rows of a fit on all data."""


def festo_part(args: argparse.Namespace) -> list[dict[str, Any]]:
    """Adapt between measured muscles: other cut lengths, other bore."""
    folder = Path(args.festo or "")
    files = {name: sorted(folder.rglob(f"{name}_*.mat")) for name in FESTO} if args.festo else {}
    if not files or not all(files.values()):
        print("festo: skipped, there is no folder of measured data (--festo FOLDER)")
        return []
    from _sources_kept import adapters, fresh
    from festo import table, thin  # the neighbouring benchmark reads the logs

    found: list[dict[str, Any]] = []
    split, first = {}, args.source
    for name, paths in files.items():
        d = table(paths, CUTOFF)
        d = d[d["F"] > 5.0]
        split[name] = d[~d["last"]], d[d["last"]]
    others = [name for name in args.muscles or FESTO if name != first]

    def rmse(model: Any, columns: list[str], test: pd.DataFrame) -> float:
        return float(np.sqrt(np.mean((model.predict(test[columns]) - test["F"]) ** 2)))

    def whole(name: str) -> StaticPIHM:
        rows = thin(split[name][0], WHOLE)
        return StaticPIHM(*FESTO[name], max_iter=args.steps, random_state=args.first_seed).fit(
            rows[COLUMNS[1:]], rows["F"]
        )

    network = FrozenEstimator(whole(first))
    print("Festo: RMSE / N on the last repeat of each contraction, F > 5 N; a seed is a draw of samples")
    for name in others:
        train, test = split[name]
        own = rmse(whole(name), COLUMNS[1:], test)
        for seed in range(args.first_seed, args.first_seed + args.seeds):
            options = dict(zip(("rest_length", "rest_diameter"), FESTO[name], strict=True), random_state=seed)
            for count in args.counts:
                step = len(train) // count
                few = train.iloc[(seed * step) // max(args.seeds, 1) :: step]
                row = {"muscle": name, "seed": seed, "count": count, "all": own}
                for method, adapter in adapters(network, options).items():
                    model = adapter.fit(few[COLUMNS], few["F"])
                    row |= {method: rmse(model, COLUMNS, test), f"{method} keeps": float(model.source_kept_[0])}
                    if method == "Q":
                        row |= {"Q0": model.q0_, "factor": model.q_}
                for method, (model, columns) in fresh().items():
                    row[method] = rmse(model.fit(few[columns], few["F"]), columns, test)
                found.append(row)
                print(f"{first} -> {name}", {k: round(v, 3) for k, v in row.items() if k != "muscle"}, flush=True)
    d = pd.DataFrame(found)
    print("\nRMSE / N, median and greatest; best fresh fit: that of the kind whose median is least")
    for (name, count), g in d.groupby(["muscle", "count"], sort=False):
        kinds = list(fresh())
        best = min(kinds, key=lambda kind, g=g: g[kind].median())
        cells = ", ".join(
            f"{m} {g[m].median():.2f} ({g[m].max():.2f}), keeps {g[f'{m} keeps'].median():.0%}"
            for m in adapters(network, {})
        )
        print(
            f"{first} -> {name} {count:4d} samples: {cells}; "
            + ", ".join(f"{kind} {g[kind].median():.2f} ({g[kind].max():.2f})" for kind in kinds)
            + f"; Q over {best}: median {g['Q'].median() / g[best].median():.2f}, "
            f"worst {g['Q'].max() / g[best].max():.2f}",
            flush=True,
        )
    print(f"\nmedian over {args.seeds} draws; ratio: Q over all data, with the least and the greatest")
    for (name, count), g in d.groupby(["muscle", "count"], sort=False):
        ratio = g["Q"] / g["all"]
        print(
            f"{first} -> {name} {count:4d} samples: Q {g['Q'].median():6.2f}, all data {g['all'].median():6.2f} N, "
            f"ratio {ratio.median():.2f} [{ratio.min():.2f}, {ratio.max():.2f}]; "
            f"Q {g['factor'].median():.3f}, by geometry {g['Q0'].median():.3f}"
        )
    return found


def rates_part(args: argparse.Namespace) -> list[dict[str, Any]]:
    """Errors where rates know the valve's command, for every method of rates."""
    found = []
    for seed in range(args.first_seed, args.first_seed + args.seeds):
        for method in args.rates:
            network = FrozenEstimator(source("anchored", "A", seed, args.steps, method))
            for muscle in args.targets:
                few = log(f"D_{muscle}", muscle, seed, method).iloc[::100]
                adapted = QAdapter(network, **sizes(muscle), random_state=seed).fit(few[COLUMNS], few["mdot"])
                for name, model in (("QAdapter()", adapted), ("true volume", TrueVolume(muscle))):
                    row = {"muscle": muscle, "seed": seed, "method": f"{name}, {method or 'savgol, command unknown'}"}
                    found.append(row | errors(model, muscle, seed, method))
                    cells = " ".join(f"{1e6 * found[-1][s]:8.2f}" for s in SETS)
                    print(f"{muscle} seed {seed} {row['method']:40s} {cells}", flush=True)
    return found


PARTS = {
    "rates": rates_part,
    "table": table_part,
    "samples": samples_part,
    "muscles": muscles_part,
    "scaling": scaling_part,
    "festo": festo_part,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS), help="which parts (default: all)")
    parser.add_argument("--seeds", type=int, default=5, help="seeds of noise, weights and draws (default 5)")
    parser.add_argument("--first-seed", type=int, default=0, help="where the seeds start (default 0)")
    parser.add_argument("--targets", nargs="+", default=["B", "C"], choices=["B", "C"], help="target muscles")
    parser.add_argument("--scratch-seeds", type=int, default=5, help="seeds of the models from scratch (default 5)")
    parser.add_argument("--steps", type=int, default=40, help="steps of a source or from scratch (default 40)")
    parser.add_argument("--repeats", type=int, default=5, help="repeats of a timing (default 5)")
    methods = ["", "savgol", "spline", "kalman"]
    parser.add_argument("--rates", nargs="+", choices=methods, default=methods, help="methods of rates ('': unknown)")
    parser.add_argument("--methods", nargs="*", help="only adaptations whose names hold one of these texts")
    parser.add_argument("--counts", type=int, nargs="+", default=[30, 100, 300], help="samples of the Festo part")
    parser.add_argument("--source", choices=FESTO, default="10mm_30cm", help="source of the Festo part")
    parser.add_argument("--muscles", nargs="+", choices=FESTO, help="targets of the Festo part (default: all others)")
    parser.add_argument("--festo", metavar="FOLDER", help="folder of measured Festo logs")
    parser.add_argument(
        "--out", metavar="FILE.json", help="where to keep all figures, for benchmarks/adaptation_plots.py"
    )
    parser.add_argument(
        "--merge", nargs="+", metavar="FILE.json", help="print the table that earlier runs kept; a later file wins"
    )
    args = parser.parse_args()
    if args.merge:
        rows = [row for file in args.merge for row in json.loads(Path(file).read_text(encoding="utf-8"))["table"]]
        medians(list({(r["muscle"], r["seed"], r["method"]): r for r in rows}.values()))
        return
    torch.set_num_threads(1)
    warnings.simplefilter("ignore")
    kept: dict[str, Any] = {}
    for part in args.parts:
        print(f"\n--- {part}", flush=True)
        kept[part] = PARTS[part](args)
        if part == "table":
            medians(kept[part])
        if args.out:
            Path(args.out).write_text(json.dumps(kept), encoding="utf-8")


if __name__ == "__main__":
    main()
