"""EMPS, an electro-mechanical positioning system: mass and drive gain alone as the simulator, given in five ways.

Published (least squares on the inverse model): 95.1 kg, 203.5 N s/m, 20.39 N, offset -3.16 N, with friction that
differs by direction. The speed column is the position, differentiated as users do it.
"""

from __future__ import annotations

import argparse
import itertools
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks._answers import Record, answer_of, each, keep, lines_of, times_of

MASS, COULOMB, VISCOUS = 95.1089, 20.4, 203.0
WITHIN = 0.1
WAYS = ("equations", "function", "mujoco", "diagnoser", "inverse")
"""Equations as text, a Python function, a MuJoCo slide, `GapDiagnoser` on the function, `GapDiagnoser` on the inverse
model: the force that the drive must deliver."""
SPEEDS = ("none", "savgol", "butterworth", "difference", "causal")
"""No speed column; cubics over 41 ms; a filter of 100 Hz to and fro; differences; these behind a filter of 50 Hz."""
COULOMBS = {
    "coulomb_friction": ("amplitude",),
    "stribeck_friction": ("coulomb",),
    "directional_friction": ("forward", "backward"),
}
"""Names of sliding friction, and the parameters whose mean is its size."""
VISCOUSES = {
    "viscous_friction": ("coefficient",),
    "back_emf": ("constant",),
    "directional_damping": ("forward", "backward"),
}
ASYMMETRIES = ("actuator_bias", *(n for n in (*COULOMBS, *VISCOUSES) if n.startswith("directional")))


def read(folder: Path, records: int, speed: str, thin: int) -> tuple[pd.DataFrame, float]:
    """Return the log, in as many runs of equal length, and the drive's gain, N/V."""
    from scipy.io import loadmat

    d = loadmat(folder / "DATA_EMPS.mat")
    t, q, V = (np.ravel(d[k]).astype(float) for k in ("t", "qm", "vir"))
    log = pd.DataFrame({"trajectory": "0", "time": t, "vir": V, "q": q})
    if speed != "none":
        log["v"] = _speed(q, t, speed)
    rows = np.arange(len(log)) * records // len(log)
    log["trajectory"] = [f"piece {k + 1}" for k in rows]
    return log.iloc[::thin].reset_index(drop=True), float(d["gtau"].item())


def _speed(q: np.ndarray, t: np.ndarray, way: str) -> np.ndarray:
    from scipy.signal import butter, filtfilt, lfilter, savgol_filter

    if way == "savgol":
        return np.asarray(savgol_filter(q, 41, 3, deriv=1, delta=1e-3))
    if way == "butterworth":
        return np.gradient(filtfilt(*butter(4, 100.0, fs=1000.0), q), t)
    raw = np.diff(q, prepend=q[0]) / 1e-3
    return raw if way == "difference" else np.asarray(lfilter(*butter(2, 50.0, fs=1000.0), raw))


def simulator_of(way: str, gain: float, folder: Path) -> Any:
    """Return mass and drive gain as a simulator of one kind."""
    from pamid.simulators import EquationSimulator, FunctionSimulator, MujocoSimulator, Port

    if way == "mujoco":
        (folder / "emps.xml").write_text(
            '<mujoco><option gravity="0 0 0" timestep="0.001"/><worldbody><body name="carriage">'
            '<joint name="axis" type="slide" axis="1 0 0"/>'
            f'<inertial pos="0 0 0" mass="{MASS}" diaginertia="1 1 1"/></body></worldbody>'
            f'<actuator><motor name="drive" joint="axis" gear="{gain}"/></actuator></mujoco>'
        )
        columns = [Port("drive", "input", "V", column="vir"), Port("axis_q", "state", "m", column="q"),
                   Port("axis_dq", "state", "m/s", column="v")]  # fmt: skip
        return MujocoSimulator(folder / "emps.xml", columns)
    ports = [Port("vir", "input", "V"), Port("q", "state", "m"), Port("v", "state", "m/s")]
    numbers = {"gain": (gain, 0.0, "N/V"), "mass": (MASS, 0.0, "kg")}
    if way == "equations":
        return EquationSimulator({"dq/dt": "v", "dv/dt": "gain*vir/mass"}, ports, numbers)
    return FunctionSimulator(lambda t, x, u, p: [x.v, p.gain * u.vir / p.mass], ports, numbers)


def diagnosed(data: Path, way: str, records: int, speed: str, thin: int, effects: Any) -> Record:
    """Return the answer to one case, judged."""
    from pamid.estimators import GapDiagnoser

    from pamid.gap import diagnose_simulator

    log, gain = read(data, records, speed, thin)
    with tempfile.TemporaryDirectory() as folder:
        if way == "inverse":
            found = _inverse(log, gain, effects)
        elif way == "diagnoser":
            columns = ["time", "vir", *(["v"] if "v" in log else [])]
            model = GapDiagnoser(simulator_of("function", gain, Path(folder)), effects, random_state=0)
            found = model.fit(log[columns], log["q"], groups=log["trajectory"]).diagnosis_
        else:
            found = diagnose_simulator(log, simulator_of(way, gain, Path(folder)), effects, seed=0)
    answer = answer_of(found)
    return answer | judged(answer, gain)


def _inverse(log: pd.DataFrame, gain: float, effects: Any) -> Any:
    """Return what is said of the drive's force beyond mass times acceleration."""
    from pamid.estimators import GapDiagnoser
    from scipy.signal import savgol_filter

    slope = lambda x, order: savgol_filter(x, 41, 3, deriv=order, delta=float(np.median(np.diff(log["time"][:50]))))  # noqa: E731
    runs = [part for _, part in log.groupby("trajectory", sort=False)]
    table = log.assign(
        a=np.concatenate([slope(r["q"], 2) for r in runs]), dq=np.concatenate([slope(r["q"], 1) for r in runs])
    )
    speed = "v" in log
    roles = {"time": "time", "position": "q"} | ({"velocity": "dq"} if speed else {})
    model = GapDiagnoser(
        lambda T: MASS * T["a"].to_numpy(), effects, equation="force", sense=-1, signals=roles,
        units={"target": "N", "position": "m"}, random_state=0,
    )  # fmt: skip
    X = table[["time", "q", "a", *(["dq"] if speed else [])]]
    return model.fit(X, gain * table["vir"], groups=table["trajectory"]).diagnosis_


def judged(answer: Record, gain: float) -> Record:
    """Return sizes in N and N s/m, what is foreign, and whether the answer is right."""
    coulomb = viscous = float("nan")
    asymmetry, foreign = False, []
    for cause in answer["causes"]:
        names = [n.split("@")[0] for n in cause["names"]]
        first = names[0]
        for table in (COULOMBS, VISCOUSES):
            for name, keys in table.items():
                values = [cause["sizes"][k] for k in keys if k in cause["sizes"]]
                if name == first and values:
                    force = [v * (gain if unit.startswith("V") else 1.0) for v, _, _, unit in values]
                    size = sum(force) / len(force)
                    coulomb, viscous = (size, viscous) if table is COULOMBS else (coulomb, size)
        asymmetry = asymmetry or any(n in ASYMMETRIES for n in names)
        if first not in (*COULOMBS, *VISCOUSES, *ASYMMETRIES):
            foreign.append(first)
    near = [abs(size / true - 1.0) < WITHIN for size, true in ((coulomb, COULOMB), (viscous, VISCOUS))]
    return {
        "coulomb": coulomb, "viscous": viscous, "asymmetry": asymmetry, "foreign": foreign,
        "right": bool(all(near) and asymmetry and not foreign),
        "said": f"Coulomb {coulomb:.3g} N, viscous {viscous:.4g} N s/m, "
                f"{'offset or asymmetry' if asymmetry else 'no asymmetry'}, foreign {', '.join(foreign) or 'none'}",
    }  # fmt: skip


def study(folder: Path, args: argparse.Namespace) -> None:
    """Print each case as it ends."""
    cases = itertools.product(args.way or WAYS, args.records or (1, 6), args.speed or SPEEDS[:2])
    jobs = []
    effects = args.effects.split(",") if args.effects else "all"
    for way, records, speed in cases:
        name = f"emps {way}, {records} record{'s' * (records > 1)}, speed {speed}"
        job = lambda w=way, r=records, s=speed: diagnosed(folder, w, r, s, args.thin, effects)  # noqa: E731
        jobs.append((name, job))
    print(f"EMPS: Coulomb {COULOMB} N, viscous {VISCOUS:g} N s/m, offset -3.2 N are true", flush=True)
    right = 0
    for name, record in each(jobs, args.limit, args.workers):
        keep(args.out, name, record)
        right += record.get("right", False)
        if "error" in record:
            print(f"\n{name}: {record['error']}, {times_of(record)}", flush=True)
            continue
        word = "RIGHT" if record["right"] else "WRONG"
        print(f"\n{name}: {word}, {record['verdict']}, {times_of(record)}\n  {record['said']}")
        print("\n".join(f"  {line}" for line in lines_of(record)), flush=True)
    print(f"\nEMPS: {right} of {len(jobs)} right")
