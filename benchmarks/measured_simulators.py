"""Simulators against measured logs: a rotary pendulum, two tanks, falling balls; causes, sizes, free-run errors.

Reads ``qube_pendulum``, ``cascaded_tanks``, ``falling_balls`` under ``--real`` (public data of three repositories that
are not part of this package, see docs/measured.md).
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import pandas as pd

from pamid.gap import Diagnosis, diagnose_simulator
from pamid.gap.simulated import free_run
from pamid.simulators import FunctionSimulator, Port, Simulator

GRAVITY = 9.81


def tell(title: str, found: Diagnosis, begun: float) -> None:
    """Print what a diagnosis says, in a few lines."""
    print(f"\n{title}\n  verdict {found.verdict}, p = {found.p_value:.1g}, {time.perf_counter() - begun:.0f} s")
    for c in found.causes:
        values = ", ".join(
            f"{k} {p.value:.4g} [{p.ci90[0]:.3g}, {p.ci90[1]:.3g}] {p.unit}" for k, p in c.parameters.items()
        )
        names = " or ".join(f"{e} at {w}" for e, w in zip(c.effects, c.where, strict=True))
        print(f"  {names}: confidence {c.confidence:.2f}, share {c.share:.2f}; {values}")
    for c in found.closure:
        print(f"  {c.equation}: {c.rmse_before:.3g} -> {c.rmse_after:.3g}, floor {c.noise_floor:.3g}, held out")


# --- rotary pendulum ------------------------------------------------------------------------------------------
def qube(folder: Path) -> None:
    """Diagnose a QUBE whose simulator has inertia and gravity alone."""
    runs = []
    for file in sorted(folder.glob("*.csv")):
        d = pd.read_csv(file, skipinitialspace=True)
        runs.append(d[["t", "plant_input", "theta", "alpha"]].set_axis(["time", "V", "theta", "alpha"], axis=1))
        runs[-1]["trajectory"] = file.stem
    R, k, arm, r = 8.4, 0.042, 0.095, 0.085

    def rates(t: Any, x: Any, u: Any, p: Any) -> list[Any]:
        s, c, half, Jp = np.sin(x.alpha), np.cos(x.alpha), 0.5 * p.length, p.bob * p.length**2 / 3.0
        a, b = p.Jr + p.bob * r * r + Jp * s * s, p.bob * r * half * c
        tau = k * u.V / R - 2 * Jp * s * c * x.dtheta * x.dalpha + p.bob * r * half * s * x.dalpha**2
        turn = Jp * s * c * x.dtheta**2 + p.bob * GRAVITY * half * s
        det = a * Jp - b * b
        return [x.dtheta, x.dalpha, (Jp * tau - b * turn) / det, (a * turn - b * tau) / det]

    ports = [
        Port("V", "input", "V"), Port("theta", "state", "rad"), Port("alpha", "state", "rad"),
        Port("dtheta", "state", "rad/s"), Port("dalpha", "state", "rad/s"),
        Port("motor", "joint", "V", position="theta", velocity="dtheta", through="V"),
    ]  # fmt: skip
    begun = time.perf_counter()
    # Inertia is free: the arm as a rod about its end, though most of its mass sits nearer to the hub.
    numbers = {"Jr": (arm * r * r / 3.0, 0.6, "kg m^2"), "bob": (0.024, 0.4, "kg"), "length": (0.129, 0.2, "m")}
    simulator = FunctionSimulator(rates, ports, numbers)
    tell("QUBE, nominal: inertia and gravity", diagnose_simulator(pd.concat(runs), simulator), begun)


def qube_clock(folder: Path) -> None:
    """Print what a regression says of the motor's size if the voltage acts a part of a step later."""
    from scipy.signal import filtfilt, firwin

    lowpass = firwin(201, 12.0, fs=500.0)
    for late in (0.0, 0.25, 0.5):
        rows, volts = [], []
        for file in sorted(folder.glob("*.csv")):
            d = pd.read_csv(file, skipinitialspace=True)
            held = d["plant_input"].to_numpy()
            mean = 0.5 * (held + np.concatenate([[0.0], held[:-1]]))
            mean = (1.0 - late) * mean + late * np.concatenate([[0.0], mean[:-1]])
            theta, alpha, V = (filtfilt(lowpass, [1.0], x) for x in (d["theta"], d["alpha"], mean))
            (w, v), dt = (np.gradient(x, 0.002) for x in (theta, alpha)), 0.002
            turn = np.cos(alpha) * np.gradient(v, dt) - np.sin(alpha) * v * v
            A = np.column_stack([np.gradient(w, dt), turn, np.ones(len(w)), w, np.sign(w)])
            rows.append(A[300:-300])  # a hand holds the pendulum at the beginning
            volts.append(V[300:-300])
        A, V = np.concatenate(rows), np.concatenate(volts)
        x = np.linalg.lstsq(A, V, rcond=None)[0]
        left = [float(np.std(V - A[:, :k] @ np.linalg.lstsq(A[:, :k], V, rcond=None)[0])) for k in (3, 5)]
        print(
            f"  QUBE below 12 Hz, voltage {2 * late:.1f} ms later: {x[3]:.4f} V s/rad, Coulomb {x[4]:.3f} V, offset "
            f"{x[2]:.3f} V; {left[0]:.3f} -> {left[1]:.3f} V"
        )


# --- tanks ----------------------------------------------------------------------------------------------------
def tanks(folder: Path) -> None:
    """Diagnose two tanks by Bernoulli's law, and compare free runs on the runs to come."""
    d = pd.read_csv(folder / "dataBenchmark.csv")
    dt = float(d["Ts"].dropna().iloc[0])
    log, future = (
        pd.DataFrame({"trajectory": w, "time": np.arange(len(d)) * dt, "u": d[f"u{w}"], "y": d[f"y{w}"]})
        for w in ("Est", "Val")
    )

    def rates(t: Any, x: Any, u: Any, p: Any) -> list[Any]:
        one, two = np.sqrt(np.maximum(x.h1 + p.zero1, 0.0)), np.sqrt(np.maximum(x.h2 + p.zero2, 0.0))
        return [p.k4 * u.u - p.k1 * one, p.k2 * one - p.k3 * two]

    ports = [Port("u", "input", "V"), Port("h1", "state", "V", start=5.0), Port("h2", "state", "V", column="y")]
    # Nothing is known but the law: levels are in volts, and where their outlets are in volts is not known either.
    numbers = {f"k{k}": (0.05, 1.0) for k in (1, 2, 3, 4)} | {"zero1": (1.0, 2.0, "V"), "zero2": (1.0, 2.0, "V")}
    simulator: Simulator = FunctionSimulator(rates, ports, numbers)
    begun = time.perf_counter()
    found = diagnose_simulator(log, simulator)
    tell("Cascaded tanks, nominal: Bernoulli's law", found, begun)
    print("  parameters, in tolerances:", {n: round(v, 3) for n, v in found.deviations.items()})
    if found.corrected is not None:
        for name, some in (("estimation", log), ("validation", future)):
            y = free_run(some, found.corrected)["h2"].to_numpy()
            print(f"  free run on {name}: RMSE {float(np.sqrt(np.mean(np.square(some['y'] - y)))):.3f} V")


# --- falling balls --------------------------------------------------------------------------------------------
def balls(folder: Path) -> None:
    """Diagnose each ball's fall against free fall, from heights alone."""
    ports = [Port("h", "state", "m"), Port("v", "state", "m/s", column="not logged")]
    for file in sorted(folder.glob("*.csv")):
        d = pd.read_csv(file).rename(columns={"drop": "trajectory"})
        log = d[["trajectory", "time", "h"]].drop_duplicates(["trajectory", "time"])
        begun = time.perf_counter()
        simulator = FunctionSimulator(lambda t, x, u, p: [x.v, -p.g + 0.0 * x.v], ports, {"g": (9.8, 0.0, "m/s^2")})
        tell(file.stem, diagnose_simulator(log, simulator), begun)


STUDIES: dict[str, tuple[Any, str]] = {
    "qube": (qube, "qube_pendulum"),
    "qube_clock": (qube_clock, "qube_pendulum"),
    "tanks": (tanks, "cascaded_tanks"),
    "balls": (balls, "falling_balls"),
}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--real", type=Path, metavar="FOLDER", help="folder with the measured data")
    parser.add_argument("--only", choices=STUDIES, action="append", help="one study; may be repeated")
    args = parser.parse_args()
    for name in args.only or STUDIES:
        study, folder = STUDIES[name]
        if args.real is None or not (args.real / folder).is_dir():
            print(
                f"skipped {name}: --real FOLDER names the folder that holds {folder}, which is not part of this package"
            )
            continue
        study(args.real / folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
