"""SO-101 arm: its public model against its log; a few motions to fit, free runs on all others beside other fits.

A vendor's fit was made on another arm of the type. RMSE of free runs in mrad: they start from the reading, a command is
held until the next, contacts and limits are off.
"""

from __future__ import annotations

import argparse
import ast
import csv
import re
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks._answers import Record, answer_of, each, keep, lines_of, short, times_of

JOINTS = {"Rotation": "shoulder_pan", "Pitch": "shoulder_lift", "Elbow": "elbow_flex", "Wrist_Pitch": "wrist_flex",
          "Wrist_Roll": "wrist_roll", "Jaw": "gripper"}  # fmt: skip
"""Names of the log and of the model."""
FIT = ("sinusoidal_sweep", "hold_under_gravity", "ramp_motion")
"""Motions that are fitted: sines, holds and slow ramps, at most 9,000 rows."""
VENDOR = {
    "shoulder_pan": (48.9, 2.31, 0.058, 0.215, 1.07), "shoulder_lift": (51.3, 2.78, 0.044, 0.318, 0.877),
    "elbow_flex": (18.6, 0.535, 0.055, 0.402, 0.493), "wrist_flex": (43.0, 2.72, 0.051, 0.296, 0.517),
    "wrist_roll": (47.1, 1.79, 0.051, 0.283, 0.450), "gripper": (50.8, 2.35, 0.043, 0.312, 1.14),
}  # fmt: skip
"""kp N m/rad, kd N m s/rad, armature kg m^2, dry friction N m, damping N m s/rad."""


def read(folder: Path) -> pd.DataFrame:
    """Return a motion: time, readings by joint, commands as ``JOINT_ctrl``."""
    tables = {}
    for name in ("control.csv", "state_motor.csv"):
        with (folder / name).open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        t = np.array([float(r["timestamp"]) for r in rows]) * 1e-6
        tables[name] = t, np.array([ast.literal_eval(r["positions"]) for r in rows], dtype=float)
    order = [JOINTS[n] for n in re.findall(r"\w+", (folder / "joint_list.txt").read_text(encoding="utf-8"))]
    (t, q), (when, command) = tables["state_motor.csv"], tables["control.csv"]
    held = command[np.clip(np.searchsorted(when, t, side="right") - 1, 0, None)]
    log = {"trajectory": folder.name, "time": t - t[0]}
    log |= {n: q[:, k] for k, n in enumerate(order)} | {f"{n}_ctrl": held[:, k] for k, n in enumerate(order)}
    return pd.DataFrame(log)


def model_text(folder: Path, vendor: bool) -> str:
    """Return the public model without contacts, with its own numbers or the vendor's."""
    text = (folder / "so101.xml").read_text(encoding="utf-8")
    flags = '<option timestep="0.002"><flag contact="disable" limit="disable"/></option>'
    text = text.replace('<mujoco model="so101">', f'<mujoco model="so101">{flags}')
    for joint, (kp, kd, armature, friction, damping) in VENDOR.items() if vendor else ():
        plain, servo = f'name="{joint}" type="hinge" class="s"', f'<position class="s" joint="{joint}"'
        text = text.replace(plain, f'{plain} armature="{armature}" frictionloss="{friction}" damping="{damping}"')
        text = text.replace(servo, f'{servo} kp="{kp}" kv="{kd}"')
    return text


def rolled(text: str, log: pd.DataFrame) -> np.ndarray:
    """Return the joints of a free run by MuJoCo itself, shape (rows, joints)."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    names = list(VENDOR)
    rows = [model.joint(n).qposadr[0] for n in names]
    command = log[[f"{n}_ctrl" for n in names]].to_numpy()
    data.qpos[rows] = log[names].to_numpy()[0]
    out = np.empty((len(log), len(names)))
    steps = np.diff(np.round(log["time"].to_numpy() / model.opt.timestep).astype(int), append=0)
    for k in range(len(log)):
        out[k] = data.qpos[rows]
        data.ctrl[:] = command[k]
        for _ in range(max(0, steps[k])):
            mujoco.mj_step(model, data)
    return out


def diagnosed(folder: Path, motions: dict[str, pd.DataFrame], fit: list[str], effects: Any) -> Record:
    """Return the answer on the motions to fit, and errors of free runs of what it corrects, by motion and joint."""
    from pamid.gap import diagnose_simulator
    from pamid.gap.simulated import free_run
    from pamid.simulators import MujocoSimulator, Port

    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "so101.xml"
        path.write_text(model_text(folder, vendor=False), encoding="utf-8")
        ports = [Port(f"{n}_q", "state", "rad", column=n) for n in VENDOR]
        own = MujocoSimulator(path, ports)
        named = {i: f"{n}_ctrl" for i, n in zip(own.inputs, VENDOR, strict=False)}
        ports += [Port(i, "input", "rad", column=c) for i, c in named.items() if i != c]
        simulator = MujocoSimulator(path, ports)
        found = diagnose_simulator(pd.concat([motions[n] for n in fit], ignore_index=True), simulator, effects, seed=0)
        errors = {}
        for name, log in motions.items():
            if found.corrected is not None:
                y = free_run(log, found.corrected)
                errors[name] = [float(np.mean(np.square(y[f"{n}_q"].to_numpy() - log[n]))) for n in VENDOR]
    answer = answer_of(found)
    return answer | {"said": short(answer), "errors": errors}


def told(title: str, errors: dict[str, list[float]], names: list[str]) -> str:
    """Return a line of RMSE, all joints and each."""
    squares = np.array([errors[n] for n in names if n in errors])
    if not len(squares):
        return f"  {title:38s} –"
    each_joint = 1e3 * np.sqrt(squares.mean(axis=0))
    return f"  {title:38s} {1e3 * np.sqrt(squares.mean()):5.1f}: " + ", ".join(f"{x:.1f}" for x in each_joint)


def study(folder: Path, args: argparse.Namespace) -> None:
    """Print errors of free runs, then the diagnosis as it ends."""
    motions = {p.parent.name: read(p.parent) for p in sorted(folder.glob("*/state_motor.csv"))}
    fit = [n for n in FIT if n in motions]
    left = [n for n in motions if n not in fit]
    rows = sum(len(motions[n]) for n in fit)
    print(f"SO-101: {len(motions)} motions, fitted {', '.join(fit)} ({rows} rows); RMSE in mrad, all and by joint")
    known: dict[str, dict[str, list[float]]] = {"the command itself": {}, "public model": {}, "vendor's fit": {}}
    for name, log in motions.items():
        y = log[list(VENDOR)].to_numpy()
        runs = (
            log[[f"{n}_ctrl" for n in VENDOR]].to_numpy(),
            *(rolled(model_text(folder, v), log) for v in (False, True)),
        )
        for table, run in zip(known.values(), runs, strict=True):
            table[name] = list(np.mean(np.square(run - y), axis=0))
    for title, errors in known.items():
        print(told(f"{title}, all motions", errors, list(motions)))
        print(told(f"{title}, left out", errors, left), flush=True)
    effects = args.effects.split(",") if args.effects else "all"
    job = lambda: diagnosed(folder, {n: log.iloc[:: args.thin] for n, log in motions.items()}, fit, effects)  # noqa: E731
    for name, record in each([("so101", job)], args.limit):
        keep(args.out, name, record)
        if "error" in record:
            print(f"  diagnosis: {record['error']}, {times_of(record)}")
            continue
        print(f"  diagnosis: {record['verdict']}, {times_of(record)}")
        print("\n".join(f"    {line}" for line in lines_of(record)))
        print(told("corrected, fitted motions", record["errors"], fit))
        print(told("corrected, left out", record["errors"], left), flush=True)
