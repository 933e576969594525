"""Force of Festo fluidic muscles held at fixed contraction: hybrid models against networks, trees and geometry.

For each cut length all models are fitted on all repeats but the last of each contraction and scored on the last one,
then once more with each whole contraction left out of the fit. Samples with F > 5 N are scored; all models read the
same signals. The data are those of github.com/Agile-and-Adaptive-Robotics/Muscle_Sensory (no licence stated, so they
are not part of this package); ``--data`` names the folder that holds ``10mm_20cm_Unkink.mat`` and its like.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from pamid.estimators import MLP, GeometricForce, PolynomialForce, RateTransformer, StaticPIHM
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from pamid.effects._memory import relax_along
from pamid.signals import read_log, thinned_rows
from pamid.signals.state import State

MAPPING = Path(__file__).parent.parent / "docs" / "mappings" / "festo.toml"
REST_LENGTH = {20: 0.182, 30: 0.281, 40: 0.382}
DIAMETER = 0.010
STATE = ["eps", "deps", "P", "dP"]
REFERENCE = (
    "seen elsewhere: plain 64-64 network 5.8, 4.5, 3.9 N; boosting 5.9, 5.0, 4.9; cubic with branch 6.0, 5.5, 4.8"
)


def table(files: Sequence[Path], cutoff: float) -> pd.DataFrame:
    """Read one muscle: signals with rates, the contraction's file, and whether a row is of its last repeat."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        log = read_log(list(files), MAPPING, nan="drop")
        times = log["time"].to_numpy()
        log = (
            RateTransformer(("eps", "P"), tuning=cutoff)
            .fit_transform(log[["trajectory", "time", "eps", "P"]])
            .assign(trajectory=log["trajectory"].to_numpy(), F=log["F"].to_numpy(), branch=log["branch"].to_numpy())
        )
    log["time"] = times
    log["file"] = log["trajectory"].str.rsplit("-", n=1).str[0]
    repeat = log["trajectory"].map(lambda name: int(re.findall(r"Test(\d+)", name)[-1]))
    log["last"] = repeat == repeat.groupby(log["file"]).transform("max")
    return log


def models(cut: int, seed: int) -> dict[str, tuple[object, list[str]]]:
    """Name the models and the columns that each reads."""
    muscle = {"rest_length": REST_LENGTH[cut], "rest_diameter": DIAMETER}
    plain = ["eps", "P", "dP"]
    return {
        "StaticPIHM": (StaticPIHM(**muscle, random_state=seed), STATE),
        "StaticPIHM, published network": (StaticPIHM(**muscle, volume_model="neural", random_state=seed), STATE),
        "plain network 64-64": (MLP(inputs=plain, hidden=(64, 64), random_state=seed), plain),
        "gradient boosting": (HistGradientBoostingRegressor(random_state=seed), plain),
        "cubic polynomial with branch": (cubic(), [*plain, "branch"]),
        "cubic polynomial": (cubic(), plain),
        "PolynomialForce(surface)": (PolynomialForce(form="surface", degree=3, **only(PolynomialForce, muscle)), STATE),
        "GeometricForce(chou_hannaford)": (GeometricForce("chou_hannaford", **muscle), STATE),
        "GeometricForce(tondu_lopez)": (GeometricForce("tondu_lopez", **muscle), STATE),
        "GeometricForce(bou_saba)": (GeometricForce("bou_saba", **muscle), STATE),
    }


def only(cls: type, values: dict[str, float]) -> dict[str, float]:
    """Keep the values that a class takes."""
    return {k: v for k, v in values.items() if k in cls().get_params()}


def cubic() -> object:
    return make_pipeline(StandardScaler(), PolynomialFeatures(3), LinearRegression())


MEMORY = ("tube", "pressure_hysteresis", "pressure_relaxation")
"""Effects of the model with memory: the sensor's tube, hysteresis in the pressure, slow relaxation."""
PASTS = (0.02, 0.1, 0.5, 2.0, 8.0)
"""Time constants of the weighted pasts of the pressure that boosted trees read, s."""


def with_memory(cut: int, log: pd.DataFrame, rows: int, seed: int, left: str = "") -> tuple[float, float, StaticPIHM]:
    """Return RMSE (N), time of the fit (s) and model; whole runs carry the memory, thinned rows above 5 N count."""
    test = log["file"] == left if left else log["last"]
    X, scored = log[["trajectory", "time", *STATE]], log["F"] > 5
    fitted = log[~test]
    count = np.zeros(len(fitted))
    above = np.flatnonzero(fitted["F"] > 5)
    count[above[np.linspace(0, len(above) - 1, min(rows, len(above))).round().astype(int)]] = 1.0
    model = StaticPIHM(REST_LENGTH[cut], DIAMETER, effects=MEMORY, random_state=seed)
    start = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.fit(X[~test], fitted["F"], sample_weight=count)
        seconds = time.perf_counter() - start
        residual = (model.predict(X[test]) - log.loc[test, "F"])[scored[test]]
    return float(np.sqrt(np.mean(residual**2))), seconds, model


def with_pasts(log: pd.DataFrame) -> pd.DataFrame:
    """Append the pressure's exponentially weighted pasts, run by run."""
    pasts = {f"P {tau:g} s": np.empty(len(log)) for tau in PASTS}
    for rows in log.groupby("trajectory", sort=False).indices.values():
        P, steps = log["P"].to_numpy()[rows], np.diff(log["time"].to_numpy()[rows])
        for tau, values in zip(PASTS, pasts.values(), strict=True):
            values[rows] = relax_along(P, float(np.median(steps)), tau, np.array([0]))
    return log.assign(**pasts)


def memory_part(logs: dict[int, pd.DataFrame], rows: int, seeds: int) -> None:
    """Print models that remember, on the last repeat of every contraction."""
    print("with memory, last repeat, RMSE / N (F > 5 N)                   20 cm   30 cm   40 cm   fit / s")
    ours, trees, seconds = [], [], []
    for cut, log in logs.items():
        found = [with_memory(cut, log, rows, seed) for seed in range(seeds)]
        ours.append(float(np.median([f[0] for f in found])))
        seconds += [f[1] for f in found]
        table_ = with_pasts(log)
        train, test = table_[~log["last"] & (log["F"] > 5)], table_[log["last"] & (log["F"] > 5)]
        columns = ["eps", "P", "dP", *(c for c in table_ if c.startswith("P "))]
        trees.append(score(HistGradientBoostingRegressor(random_state=0), columns, train, test)[0])
        print(f"{cut} cm: {', '.join(map(repr, found[0][2].effects_))}", flush=True)
    print(f"{'StaticPIHM(effects=...)':58s} " + " ".join(f"{v:7.2f}" for v in ours) + f" {np.median(seconds):9.1f}")
    print(f"{'gradient boosting, weighted pasts, all rows':58s} " + " ".join(f"{v:7.2f}" for v in trees) + "\n")


def score(model: object, columns: list[str], train: pd.DataFrame, test: pd.DataFrame) -> tuple[float, float]:
    """Fit and return the RMSE on the test rows, N, and the time of the fit, s."""
    groups = {"groups": train["trajectory"].to_numpy()} if isinstance(model, StaticPIHM) else {}
    start = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.fit(train[columns], train["F"], **groups)
        seconds = time.perf_counter() - start
        return float(np.sqrt(np.mean((model.predict(test[columns]) - test["F"]) ** 2))), seconds


def thin(rows: pd.DataFrame, n: int) -> pd.DataFrame:
    return rows.iloc[thinned_rows(rows["trajectory"].to_numpy(dtype=object), n_rows=n)] if len(rows) > n else rows


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, help="folder with the .mat files of the 10 mm muscles")
    parser.add_argument("--cutoff", type=float, default=2.0, help="cut-off of the rates, Hz (default: 2)")
    parser.add_argument("--rows", type=int, default=8000, help="rows of a fit (default: 8000)")
    parser.add_argument("--seeds", type=int, default=3, help="seeds of the networks (default: 3)")
    parser.add_argument("--cuts", type=int, nargs="+", choices=REST_LENGTH, help="cut lengths, cm (default: all)")
    parser.add_argument("--memory", action="store_true", help="only the models that remember")
    args = parser.parse_args()
    if args.data is None or not list(args.data.rglob("10mm_*cm_*.mat")):
        print("skipped: --data DIR names the folder with the Festo logs, which are not part of this package")
        return 0
    logs = {cut: table(sorted(args.data.rglob(f"10mm_{cut}cm_*.mat")), args.cutoff) for cut in REST_LENGTH}
    logs = {cut: log for cut, log in logs.items() if not args.cuts or cut in args.cuts}
    print(f"rates with a cut-off of {args.cutoff:g} Hz; {args.rows} rows a fit; medians over {args.seeds} seeds\n")
    memory_part(logs, args.rows, args.seeds)
    if args.memory:
        return 0
    print("last repeat of every contraction, RMSE / N (F > 5 N)          20 cm   30 cm   40 cm   fit / s")
    for name in models(20, 0):
        line, seconds = [], []
        for cut, log in logs.items():
            train = thin(log[~log["last"] & (log["F"] > 5)], args.rows)
            test = log[log["last"] & (log["F"] > 5)]
            seeds = range(args.seeds if "PIHM" in name or "network" in name else 1)
            found = [score(*models(cut, seed)[name], train, test) for seed in seeds]
            line.append(np.median([f[0] for f in found]))
            seconds += [f[1] for f in found]
        print(f"{name:58s} " + " ".join(f"{v:7.2f}" for v in line) + f" {np.median(seconds):9.1f}", flush=True)
    print(f"({REFERENCE})\n")
    print("one whole contraction left out, RMSE / N (F > 5 N)     network   PIHM   anchor alone   PIHM / network")
    for cut, log in logs.items():
        pooled: dict[str, list[float]] = {"network": [], "pihm": []}
        for left in sorted(log["file"].unique(), key=lambda f: log.loc[log["file"] == f, "eps"].iloc[0]):
            out = log["file"] == left
            # Rows below 5 N tell where a muscle is slack; the fit sees them, with what a slack muscle pulls: nothing.
            train = thin(log[~out], args.rows).assign(F=lambda d: d["F"].clip(lower=0.0))
            test = log[out & (log["F"] > 5)]
            net, pihm = [], []
            for seed in range(args.seeds):
                chosen = models(cut, seed)
                net.append(score(*chosen["plain network 64-64"], train, test)[0])
                pihm.append(score(*chosen["StaticPIHM"], train, test)[0])
            hybrid = chosen["StaticPIHM"][0]
            state = State(*test[STATE].to_numpy().T)
            anchor = hybrid.laws()[0].predict(*hybrid.anchor_.jet(state), state) - test["F"].to_numpy()
            pooled["network"].append(float(np.median(net)))
            pooled["pihm"].append(float(np.median(pihm)))
            eps = log.loc[out, "eps"].iloc[0]
            print(
                f"{cut} cm, contraction {100 * eps:4.1f} %{'':27s} {np.median(net):8.1f} {np.median(pihm):7.1f} "
                f"{np.sqrt(np.mean(anchor**2)):10.1f} {np.median(pihm) / np.median(net):14.2f}",
                flush=True,
            )
        total = {k: np.sqrt(np.mean(np.square(v))) for k, v in pooled.items()}
        print(
            f"{cut} cm, all contractions{'':28s} {total['network']:8.1f} {total['pihm']:7.1f} {'':10s} "
            f"{total['pihm'] / total['network']:14.2f}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
