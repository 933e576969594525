"""The gap diagnosis on measured systems: a cylinder, air chambers, a servo, Festo muscles, a piezo stage, EMPS, an arm.

Reads ``pneumatic_cylinder``, ``servo_pendulum``, ``festo_muscles``, ``piezo``, ``emps``, ``so101`` under ``--real``
(public data that are not part of this package, see docs/measured.md). ``--plots DIR`` writes the pictures of that page.
EMPS is diagnosed in many ways, each in a process of its own; ``--way``, ``--records``, ``--speed`` choose among them.
"""

from __future__ import annotations

import argparse
import os
import sys
import warnings
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
if __package__ in (None, ""):
    sys.path[0] = str(Path(__file__).resolve().parents[1])

import numpy as np
import pandas as pd
from pamid.estimators import GapDiagnoser, GeometricForce
from scipy.signal import savgol_filter
from sklearn.linear_model import LinearRegression

from benchmarks import _emps, _so101
from pamid.constants import ATMOSPHERIC_PRESSURE
from pamid.signals import read_log
from pamid.systems.muscle import Muscle

MAPPINGS = Path(__file__).parent.parent / "docs" / "mappings"
AREA = np.pi / 4 * 0.025**2
EVERYTHING = "all"  # the whole library
UNITS_OF_THE_SERVO = {"target": "V", "position": "rad", "pressure": "V"}


def log_of(files: list[Path], mapping: str) -> pd.DataFrame:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return read_log(sorted(files), MAPPINGS / mapping, nan="drop")


def rate(log: pd.DataFrame, column: str, seconds: float, order: int = 1) -> np.ndarray:
    """Differentiate a column within each run, over a window."""
    parts = []
    for _, run in log.groupby("trajectory", sort=False):
        dt = float(np.median(np.diff(run["time"])))
        width = max(5, 2 * round(0.5 * seconds / dt) + 1)
        parts.append(savgol_filter(run[column], width, 3, deriv=order, delta=dt))
    return np.concatenate(parts)


def tell(title: str, found: GapDiagnoser) -> None:
    """Print what a diagnosis says, in a few lines."""
    print(f"\n{title}\n  verdict {found.verdict_}, p = {found.p_value_:.1g}")
    for c in found.causes_:
        values = ", ".join(
            f"{k} {p.value:.3g} [{p.ci90[0]:.3g}, {p.ci90[1]:.3g}] {p.unit}" for k, p in c.parameters.items()
        )
        print(f"  {' or '.join(c.effects)}: confidence {c.confidence:.2f}, share {c.share:.2f}; {values}")
    for c in found.closure_:
        print(
            f"  held out: RMSE {c.rmse_before:.3g} -> {c.rmse_after:.3g}, floor {c.noise_floor:.3g}, closed "
            f"{c.closed_share:.2f} [{c.ci90[0]:.2f}, {c.ci90[1]:.2f}]"
        )
    ranking = [f"{c.effect} {c.confidence:.2f} ({c.score:.0f}, closes {c.closed_share:.2f})"
               for c in found.candidates_[:5]]  # fmt: skip
    print("  ranking: " + "; ".join(ranking))
    for r in found.where_["regions"][:1]:
        print(f"  where: {r.query} holds {r.share:.2f} of the gap in {r.samples:.2f} of the samples")


def cylinder(folder: Path, plots: Path | None) -> None:
    log = log_of(list(folder.glob("O-ring_*.csv")), "cylinder.toml")
    log["p"] = log["P"] - ATMOSPHERIC_PRESSURE
    log["v"] = rate(log, "x", 0.15)
    log["gap"] = log["F"] - log["p"] * AREA
    moving = log[np.abs(log["v"]) > 2e-4]
    print("\nCylinder: F - P A while the stroke moves, N")
    rows = []
    for name, run in moving.groupby("trajectory"):
        for way, part in (("outward", run[run["v"] > 0]), ("inward", run[run["v"] < 0])):
            rows.append((name, way, part["p"].mean() / 1e5, part["gap"].mean(), part["gap"].std(), len(part)))
            _, _, bar, mean, spread, n = rows[-1]
            print(f"  {name:12s} {way:8s} {bar:5.2f} bar  {mean:8.2f} +- {spread:6.2f}  {n:6d} rows")
    thin = log.iloc[::6].reset_index(drop=True)
    nominal = lambda X: AREA * X["p"].to_numpy()  # noqa: E731
    found = GapDiagnoser(
        nominal,
        EVERYTHING,
        signals={"time": "time", "position": "x", "pressure": "p"},
        units={"target": "N", "position": "m", "pressure": "Pa"},
        random_state=0,
    )
    found.fit(thin[["time", "x", "p"]], thin["F"], groups=thin["trajectory"])
    tell("Cylinder, all pressures, nominal F = P A", found)
    if plots:
        table = pd.DataFrame(rows, columns=["run", "way", "bar", "gap", "spread", "n"])
        picture(plots / "measured-cylinder.svg", "seal of a cylinder", "gauge pressure / bar", "F - P A / N",
                [(w, g["bar"], g["gap"], g["spread"]) for w, g in table.groupby("way")])  # fmt: skip


def chambers(folder: Path, plots: Path | None) -> None:
    log = log_of([folder / "Aluminium.csv", folder / "Formlabs.csv"], "air_chamber.toml")
    lines = []
    for name, run in log.groupby("trajectory"):
        # Slopes between means over 3 s: neighbours share one block.
        block = run[["time", "P"]].groupby(np.arange(len(run)) // 30).mean().iloc[1:-1]
        slope = block.diff().iloc[1:]
        X, y = block.iloc[1:], slope["P"] / slope["time"]
        roles = {"time": "time", "pressure": "P"}
        found = GapDiagnoser(
            None,
            ("leakage", "flow_bias"),
            equation="flow",
            sense=-1,
            one_trajectory=True,
            signals=roles,
            units={"target": "Pa/s", "pressure": "Pa"},
            random_state=0,
        ).fit(X, y)
        seconds = block["time"].iloc[-1] - block["time"].iloc[0]
        span = (block["P"].iloc[0] - ATMOSPHERIC_PRESSURE) / 1e5, (block["P"].iloc[-1] - ATMOSPHERIC_PRESSURE) / 1e5
        print(f"\nChamber {name}: {span[0]:.3f} to {span[1]:.3f} bar in {seconds:.0f} s")
        tell(f"dP/dt, nominal 0 (tight); mean {y.mean():.1f} +- {y.std() / np.sqrt(len(y)):.1f} Pa/s", found)
        shown = block.groupby(np.arange(len(block)) // 5).mean()
        lines.append((name, shown["time"] - shown["time"].iloc[0], (shown["P"] - shown["P"].iloc[0]) / 1e3, None))
    if plots:
        picture(plots / "measured-chambers.svg", "two air chambers, shut", "time / s", "pressure lost / kPa", lines)


def servo(folder: Path, plots: Path | None) -> None:
    log = log_of(list(folder.glob("20*.json")), "servo.toml")
    log = log[~log["trajectory"].str.contains("drop")].reset_index(drop=True)  # there the drive is off while it falls
    v, a, q = rate(log, "q", 0.08), rate(log, "q", 0.12, 2), log["q"].to_numpy(float)
    # The servo's own law: duty = kp / 128 * error in steps of 1/4096 turn, of 885; its load reading is too coarse.
    gain = log["trajectory"].str.extract(r"kp(\d+)")[0].astype(float).to_numpy() * 4096 / (2 * np.pi * 128 * 885)
    duty = gain * (log["q_ref"] - log["q"]).to_numpy(float)
    drive = np.clip(duty, -1, 1) * log["voltage"].to_numpy(float)
    kept = np.abs(duty) < 0.95
    X = np.column_stack([a, np.sin(q), np.cos(q), np.tanh(v / 0.05), v])
    model = LinearRegression().fit(X[kept], drive[kept])
    terms = " ".join(
        f"{c:+.3f} {n}" for c, n in zip(model.coef_, ("ddq", "sin q", "cos q", "sgn dq", "dq"), strict=True)
    )
    print(f"\nServo: drive / V = {terms}, R2 {model.score(X[kept], drive[kept]):.3f}")
    table = pd.DataFrame({"time": log["time"], "q": q, "dq": v, "load": np.abs(model.coef_[1] * np.sin(q))})
    table["gap"], table["run"] = drive - model.predict(X), log["trajectory"]
    table["bare"] = table["gap"] + model.coef_[3] * np.tanh(v / 0.05) + model.coef_[4] * v
    table = table[kept].iloc[::2]
    roles = {"time": "time", "position": "q", "velocity": "dq", "pressure": "load"}
    for what, title in (("bare", "inertia and gravity"), ("gap", "inertia, gravity, Coulomb and viscous friction")):
        found = GapDiagnoser(
            None, EVERYTHING, equation="torque", sense=-1, signals=roles, units=UNITS_OF_THE_SERVO, random_state=0
        )
        found.fit(table[["time", "q", "dq", "load"]], table[what], groups=table["run"])
        tell(f"Servo, beyond {title} (drive in V; 'pressure' is the load by gravity)", found)
    if plots:
        fast, edges, lines = table[np.abs(table["dq"]) > 0.1], np.linspace(0, table["load"].max(), 9), []
        for way, part in (("dq > 0", fast[fast["dq"] > 0]), ("dq < 0", fast[fast["dq"] < 0])):
            mean = part.groupby(pd.cut(part["load"], edges), observed=True)[["load", "gap"]].mean()
            lines.append((way, mean["load"], mean["gap"], None))
        title = "servo: what Coulomb and viscous friction leave"
        picture(plots / "measured-servo.svg", title, "load by gravity / V", "gap / V", lines)


REST_LENGTH = {20: 0.182, 30: 0.281, 40: 0.382}  # m, of the muscles by their cut length in cm
TAUT = 5.0  # N: below, the muscle hangs loose and its tension is that of a tube that has buckled


def muscle(folder: Path, cut: int) -> pd.DataFrame:
    """Read a muscle's log, every tenth reading, and mark the last repeat of each contraction."""
    log = log_of(list(folder.glob(f"10mm_{cut}cm_*.mat")), "festo.toml")
    log = log[log.groupby("trajectory").cumcount() % 10 == 0].reset_index(drop=True)
    repeat = log["trajectory"].str.extract(r"Test(\d+)")[0].astype(int)
    kind = log["trajectory"].str.rsplit("-", n=1).str[0]
    return log.assign(deps=0.0, dP=rate(log, "P", 0.2), last=repeat == repeat.groupby(kind).transform("max"))


def correct(log: pd.DataFrame, seen: pd.Series, cut: int, effects: str | list[str]) -> tuple[GapDiagnoser, np.ndarray]:
    """Fit geometry and diagnose on the rows that are seen; return the diagnosis, and errors on the others.

    The errors, in N, are those of geometry and of geometry with the causes, on taut rows.
    """
    state, taut = ["eps", "deps", "P", "dP"], log["F"] > TAUT
    model = GeometricForce("chou_hannaford", rest_length=REST_LENGTH[cut], rest_diameter=0.01)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what else acts makes the fitted braid too wide, which is the point
        model.fit(log.loc[seen & taut, state], log.loc[seen & taut, "F"])
    sizes = {k: model.parameters_[k] for k in ("rest_diameter", "braid_angle")}
    plant = Muscle(rest_length=REST_LENGTH[cut], **sizes).plant()
    found = GapDiagnoser(lambda T: model.predict(T[state]), effects, plant=plant, random_state=0)
    X = log[["time", *state]]
    found.fit(X[seen], log.loc[seen, "F"], groups=log.loc[seen, "trajectory"], where=taut[seen])
    new = log[~seen]
    predicted = model.predict(new[state]), found.predict(X[~seen], groups=new["trajectory"])
    error = [(y - new["F"])[taut[~seen]] for y in predicted]
    return found, np.array([np.sqrt(np.mean(np.square(e))) for e in error])


def festo(folder: Path, plots: Path | None) -> None:
    found: dict[int, GapDiagnoser] = {}
    for cut in REST_LENGTH:
        log = muscle(folder, cut)
        found[cut], (before, after) = correct(log, ~log["last"], cut, EVERYTHING)
        tell(f"Festo muscle of 10 mm and {cut} cm, nominal: geometry, without the last repeats", found[cut])
        floor = found[cut].closure_[0].noise_floor
        closed = (before**2 - after**2) / (before**2 - floor**2)
        print(f"  last repeats, unseen: RMSE {before:.1f} -> {after:.2f}, closed {closed:.3f}", flush=True)
        if plots and cut == 30:
            gaps(log, plots)
        left_out(log, cut, list(found[cut].effects_), floor)
    side_by_side(found)


def left_out(log: pd.DataFrame, cut: int, effects: list[str], floor: float) -> None:
    """Diagnose with each contraction left out in turn, among some effects, and print what they predict of it."""
    total = np.zeros((0, 3))
    for eps, rows in log.groupby(log["eps"].round(4)):
        seen = ~log.index.isin(rows.index)
        _, errors = correct(log, pd.Series(seen), cut, effects)
        total = np.vstack([total, [*errors, np.sum(rows["F"] > TAUT)]])
        print(f"  contraction {100 * eps:4.1f} % left out: RMSE {errors[0]:.1f} -> {errors[1]:.1f}", flush=True)
    before, after = np.sqrt(total[:, 2] @ np.square(total[:, :2]) / total[:, 2].sum())
    closed = (before**2 - after**2) / (before**2 - floor**2)
    print(f"  all contractions left out in turn: RMSE {before:.1f} -> {after:.1f}, closed {closed:.3f}", flush=True)


def side_by_side(found: dict[int, GapDiagnoser]) -> None:
    """Print the parameters at the three lengths."""
    print("\nParameters at the three lengths")
    for name in sorted(set.union(*(set(d.effects_) for d in found.values()))):
        values = [d.effects_.get(name, {}) for d in found.values()]
        for key in sorted(set().union(*values)):
            print(f"  {name + ' ' + key:36s} " + " ".join(f"{v.get(key, np.nan):12.4g}" for v in values))


LAWS = ["constant_area", "threshold_pressure", "effective_contraction", "slack", "tube"]
"""Effects without polynomials of the contraction, and without corrections of the geometry that the first replaces."""


def laws(folder: Path, plots: Path | None) -> None:
    """Diagnose each length among laws, whose numbers can be compared and which hold beyond what was seen."""
    found = {}
    for cut in REST_LENGTH:
        log = muscle(folder, cut)
        found[cut], (before, after) = correct(log, ~log["last"], cut, LAWS)
        tell(f"Festo muscle of 10 mm and {cut} cm, among laws", found[cut])
        print(f"  last repeats, unseen: RMSE {before:.1f} -> {after:.2f}", flush=True)
        left_out(log, cut, list(found[cut].effects_), found[cut].closure_[0].noise_floor)
    side_by_side(found)


def together(folder: Path, plots: Path | None) -> None:
    """Diagnose all three lengths as one muscle, every thirtieth reading: a force of the contraction has no length."""
    logs = []
    for cut in REST_LENGTH:
        log = muscle(folder, cut)
        log = log[log.groupby("trajectory").cumcount() % 3 == 0]
        logs.append(log.assign(trajectory=f"{cut} cm " + log["trajectory"]))
    log = pd.concat(logs, ignore_index=True)
    found, (before, after) = correct(log, ~log["last"], 30, EVERYTHING)
    tell("Festo muscles of 10 mm and 20, 30, 40 cm as one, without the last repeats", found)
    print(f"  last repeats, unseen: RMSE {before:.1f} -> {after:.2f}")


def gaps(log: pd.DataFrame, plots: Path) -> None:
    """Draw what geometry leaves against pressure, one line a contraction."""
    log = log[log["F"] > TAUT]
    model, lines = GeometricForce("chou_hannaford", rest_length=REST_LENGTH[30], rest_diameter=0.01), []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        gap = log["F"] - model.fit(log[["eps", "P"]], log["F"]).predict(log[["eps", "P"]])
    for eps, part in gap.groupby(log["eps"].round(3)):
        p = (log.loc[part.index, "P"] - ATMOSPHERIC_PRESSURE) / 1e5
        mean = pd.DataFrame({"p": p, "gap": part}).groupby(pd.cut(p, 8), observed=True).mean()
        lines.append((f"contraction {100 * eps:.0f} %", mean["p"], mean["gap"], None))
    title = "Festo muscle: measured less geometry"
    picture(plots / "measured-festo.svg", title, "gauge pressure / bar", "F / N", lines)


def piezo(folder: Path, plots: Path | None) -> None:
    names = ["row", "time", "x", "drive"]
    log = pd.read_csv(folder / "hysteresis_v_150_1hz.csv", header=None, names=names).iloc[::10].reset_index(drop=True)
    line = np.polyfit(log["drive"], log["x"], 1)
    print(f"\nPiezo stage: x / um = {line[0]:.4f} drive / V {line[1]:+.3f}")
    roles, units = {"time": "time", "position": "drive"}, {"target": "um", "position": "V"}
    found = GapDiagnoser(
        lambda T: np.polyval(line, T["drive"]),
        EVERYTHING,
        signals=roles,
        units=units,
        one_trajectory=True,
        random_state=0,
    )
    found.fit(log[["time", "drive"]], log["x"])
    tell("Piezo stage, nominal: gain and offset", found)
    if plots:
        last = log[log["time"] > log["time"].max() - 1.0]
        error = last["x"] - np.polyval(line, last["drive"])
        lines = [("last cycle", last["drive"], error, None)]
        picture(plots / "measured-piezo.svg", "piezo stage: displacement less its gain", "drive / V", "gap / um", lines)


def picture(path: Path, title: str, x: str, y: str, lines: list) -> None:
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as plt

    with plt.rc_context({"svg.fonttype": "none", "svg.hashsalt": "pamid", "font.size": 9}):
        figure, axes = plt.subplots(figsize=(5.2, 3.0))
        for (name, a, b, spread), colour in zip(lines, ("#0072B2", "#D55E00", "#009E73", "#CC79A7"), strict=False):
            axes.errorbar(a, b, spread, label=name, color=colour, marker="o" if len(a) < 50 else "", capsize=3)
        axes.axhline(0.0, color="#7F7F7F", lw=0.7)
        axes.set(title=title, xlabel=x, ylabel=y)
        axes.legend(frameon=False, fontsize=8)
        axes.spines[["top", "right"]].set_visible(False)
        figure.tight_layout()
        figure.savefig(path, metadata={"Date": None})
        plt.close(figure)
    print(f"  wrote {path.name}")


STUDIES = {
    "cylinder": (cylinder, "pneumatic_cylinder"),
    "chambers": (chambers, "pneumatic_cylinder"),
    "servo": (servo, "servo_pendulum"),
    "piezo": (piezo, "piezo"),
    "festo": (festo, "festo_muscles/10mm"),
    "festo_laws": (laws, "festo_muscles/10mm"),
    "festo_together": (together, "festo_muscles/10mm"),
}
MANY = {"emps": (_emps, "emps"), "so101": (_so101, "so101")}
"""Studies whose diagnoses run in processes of their own with a time limit."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--real", type=Path, metavar="FOLDER", help="folder with the measured data")
    parser.add_argument("--plots", type=Path, metavar="DIR", help="write the pictures there")
    parser.add_argument("--only", choices=[*STUDIES, *MANY], action="append", help="one study; may be repeated")
    parser.add_argument("--data", type=Path, metavar="FOLDER", help="folder of the one study that --only names")
    parser.add_argument("--way", choices=_emps.WAYS, action="append", help="EMPS: how the simulator is given")
    parser.add_argument("--records", type=int, action="append", metavar="N", help="EMPS: runs to cut the record into")
    parser.add_argument("--speed", choices=_emps.SPEEDS, action="append", help="EMPS: how the speed column is made")
    parser.add_argument(
        "--no-speed", dest="speed", action="append_const", const="none", help="the same as --speed none"
    )
    parser.add_argument("--thin", type=int, default=1, metavar="N", help="EMPS, arm: each Nth row")
    parser.add_argument("--effects", metavar="A,B,...", help="EMPS, arm: the library (default: all of it)")
    parser.add_argument("--limit", type=float, default=600.0, metavar="S", help="seconds for one case of EMPS, the arm")
    parser.add_argument("--workers", type=int, default=1, metavar="N", help="cases of EMPS side by side")
    parser.add_argument("--out", type=Path, metavar="FILE", help="keep cases of EMPS, the arm there, as JSON lines")
    args = parser.parse_args()
    if args.plots:
        args.plots.mkdir(parents=True, exist_ok=True)
    for name in args.only or [*STUDIES, *MANY]:
        study, folder = (STUDIES | MANY)[name]
        data = args.data or (args.real / folder if args.real else None)
        if data is None or not data.is_dir():
            print(
                f"skipped {name}: --real FOLDER names the folder that holds {folder}, which is not part of this package"
            )
            continue
        if name in MANY:
            study.study(data, args)
        else:
            study(data, args.plots)
    return 0


if __name__ == "__main__":
    sys.exit(main())
