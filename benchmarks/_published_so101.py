"""SO-101, a small robot arm: free-run error on motions left out, of public numbers, other tools' fits and named causes.

Half of the motions, drawn by a seed, are for fitting. A run starts from the first reading, commands are held until the
next; the error is the root of the mean square over motions and joints. Each servo is diagnosed alone: its joint in the
public model, the others at rest. The causes then act on commands and readings of the public model of the whole arm.
"""

from __future__ import annotations

import time
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks._so101 import model_text, read
from benchmarks._so101_fits import (
    JOINTS,
    SOFT,
    TOOLS,
    Fit,
    Motions,
    directions,
    errors_of,
    free_runs,
    loaded,
    public,
    trees,
    vendors,
)
from benchmarks._so101_tools import evolved, identified

SEED, SHARE = 0, 0.5
TARGET, RATIO, MINUTES = 14.0, 0.75, 5.0
EFFECTS = (
    "actuator_delay@command",
    "actuator_slew_rate@command",
    "actuator_lag@command",
    "actuator_bias@command",
    "sensor_backlash@angle",
)
"""What may act between the command of a position servo and the reading of its joint."""
STEP = 0.01
"""Step of MuJoCo's implicit integrator, s."""
THIN = 2
"""A diagnosis reads each second row."""
PROCESSES = 2
PACE, SYSID = TOOLS.values()
Causes = list[tuple[str, str, dict[str, float]]]
"""Effect, port, values."""


def split(names: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the motions to fit and those left out."""
    order = np.random.default_rng(SEED).permutation(len(names))
    chosen = set(order[: int(SHARE * len(names))].tolist())
    return [n for k, n in enumerate(names) if k in chosen], [n for k, n in enumerate(names) if k not in chosen]


def servo(folder: Path, joint: str) -> Any:
    """Return a servo of the public model as a simulator of whole runs: command in, angle out, the others at rest.

    The first reading is given like a command: it is what a play begins with, and nothing to be fitted. The servo itself
    begins where its first command is: how it would jump there from the first reading is no part of a run.
    """
    import mujoco
    from mujoco import rollout

    from pamid.simulators import FunctionSimulator, Port

    root = ET.fromstring(model_text(folder, vendor=False))
    for parent in root.iter():
        for child in list(parent):
            if (child.tag == "joint" and child.get("name") not in (None, joint)) or (
                child.tag == "position" and child.get("joint") not in (None, joint)
            ):
                parent.remove(child)
    model = mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    model.opt.timestep, model.opt.integrator = STEP, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    data, full = mujoco.MjData(model), mujoco.mjtState.mjSTATE_FULLPHYSICS
    begin = np.empty(mujoco.mj_stateSize(model, full))

    def run(u: Any, p: Any, x0: Any) -> np.ndarray:
        t, command, begins = np.asarray(u.time) - u.time[0], np.asarray(u.command), float(u.begin[0])
        when = np.arange(round(t[-1] / STEP) + 1) * STEP + 1e-6
        given = command[np.clip(np.searchsorted(t, when, side="right") - 1, 0, None)]
        if not np.isfinite(given).all() or not np.isfinite(begins):
            return np.full((1, len(t)), np.nan)
        mujoco.mj_resetData(model, data)
        data.qpos[0] = command[0]
        mujoco.mj_getState(model, data, begin, full)
        states, _ = rollout.rollout(model, data, begin[None], given[None, :, None])
        q = np.concatenate([[begins], states[0][:, 1]])
        return np.asarray(q[np.clip(np.round(t / STEP).astype(int), 0, len(q) - 1)][None])

    ports = [Port("command", "input", "rad"), Port("angle", "output", "rad"), Port("begin", "input", "rad")]
    return FunctionSimulator(run, ports, form="run")


def of_servo(motions: Motions, joint: str) -> pd.DataFrame:
    """Return the log of a servo where it is commanded to move; a run begins at its first reading."""
    moved = {n: log.iloc[::THIN] for n, log in motions.items() if np.ptp(log[f"{joint}_ctrl"]) > 0.0}
    parts = [
        pd.DataFrame({"trajectory": n, "time": log["time"], "command": log[f"{joint}_ctrl"], "angle": log[joint],
                      "begin": log[joint].iloc[0]}) for n, log in moved.items()]  # fmt: skip
    return pd.concat(parts, ignore_index=True)


def diagnosed(job: tuple[Path, str, Motions]) -> tuple[str, Causes, float]:
    """Return the causes that a diagnosis of a servo names, and its time of CPU, s."""
    from pamid.gap import diagnose_simulator

    folder, joint, motions = job
    begun = time.process_time()
    found = diagnose_simulator(of_servo(motions, joint), servo(folder, joint), EFFECTS, seed=0)
    causes = [] if found.corrected is None else [(n, w, dict(v)) for n, w, v in found.corrected.effects]
    return joint, causes, time.process_time() - begun


def all_diagnosed(folder: Path, motions: Motions) -> tuple[dict[str, Causes], float]:
    """Return and print the causes at all servos, diagnosed in processes; and the time of CPU, s."""
    import multiprocessing

    answers, total = {}, 0.0
    with multiprocessing.get_context("fork").Pool(PROCESSES) as pool:
        for joint, causes, seconds in pool.imap_unordered(diagnosed, [(folder, j, motions) for j in JOINTS]):
            said = "; ".join(f"{n} {', '.join(f'{k} {x:.3g}' for k, x in v.items())}" for n, _, v in causes)
            print(f"  {joint}, {seconds:.0f} s of CPU: {said or 'no cause'}", flush=True)
            answers[joint], total = causes, total + seconds
    return answers, total


def corrected(model: Any, motions: Motions, causes: Mapping[str, Causes]) -> dict[str, np.ndarray]:
    """Return free runs of the whole arm with causes at commands and readings."""
    driven, dt = {}, {}
    for n, log in motions.items():
        dt[n] = float(np.median(np.diff(log["time"])))
        driven[n] = log.astype({j: float for j in JOINTS})
        for j in JOINTS:
            x = log[f"{j}_ctrl"].to_numpy(dtype=float)
            for place, made in _acting(causes[j], "command"):
                x = place.drive(made, x, dt[n], np.array([0]))
            driven[n][f"{j}_ctrl"] = x
            driven[n].loc[driven[n].index[0], j] = x[0]
    out = free_runs(model, public(model), driven)
    for n, q in out.items():
        q[0] = motions[n][JOINTS].to_numpy()[0]
        for k, j in enumerate(JOINTS):
            for place, made in _acting(causes[j], "angle"):
                q[:, k] = place.reading(made, q[:, k], dt[n], np.array([0]))
    return out


def _acting(causes: Causes, port: str) -> list[tuple[Any, Any]]:
    """Return the effects at a port, in its units."""
    from pamid.simulators.catalogue import port_effects
    from pamid.simulators.dimensions import powers
    from pamid.simulators.placement import Placement, Scales

    found = []
    for name, where, values in causes:
        if where == port:
            kind, cls = port_effects()[name]
            hook = "command" if "command" in cls.hooks() else "measure"
            place = Placement(f"{name}@{where}", name, where, cls, kind, where, {}, Scales(), powers(cls, hook) or {})
            found.append((place, place.made(values)))
    return found


def told(errors: Mapping[str, Sequence[float]], names: Sequence[str]) -> tuple[float, np.ndarray]:
    """Return the error over some motions, mrad, and that of each joint."""
    squares = np.array([errors[n] for n in names])
    return 1e3 * float(np.sqrt(squares.mean())), 1e3 * np.sqrt(squares.mean(axis=0))


def others(folder: Path, motions: Motions, train: Motions) -> Iterator[tuple[str, dict[str, np.ndarray]]]:
    """Yield free runs of what other tools fit, and print what they fitted and what their motions leave open."""
    model = loaded(folder, STEP, implicit=True)
    yield "public model", free_runs(model, public(model), motions)
    yield "vendor's fit, another arm", free_runs(model, vendors(model), motions)
    for title, free in TOOLS.items():
        begun, fit = time.process_time(), Fit(model, train, free)
        numbers, slopes = fit.run({w: x for w, x in SOFT.items() if w in free})
        print(f"  {title}, {time.process_time() - begun:.0f} s of CPU: " + "; ".join(
            f"{w} {', '.join(f'{x:.3g}' for x in numbers[w])}" for w in free), flush=True)  # fmt: skip
        if "kp" in free:
            for joint, found in directions(fit, slopes).items():
                print(f"    {joint}: " + "; ".join(f"{size:.2g} mrad for {words}" for size, words in found), flush=True)
        yield title, free_runs(model, numbers, motions)
    for title, find, package in (
        ("PACE's parameters, CMA-ES", lambda: evolved(model, train, PACE), "cma"),
        ("MuJoCo sysid itself", lambda: identified(folder, STEP, train, SYSID), "mujoco[sysid]"),
    ):
        begun, numbers_or_none = time.process_time(), find()
        if numbers_or_none is None:
            print(f"  {title}: skipped, {package} is not installed", flush=True)
            continue
        print(f"  {title}, {time.process_time() - begun:.0f} s of CPU", flush=True)
        yield title, free_runs(model, numbers_or_none, motions)
    yield "boosted trees on the residual", trees(model, train, motions)


def draw(motions: Motions, runs: Mapping[str, Mapping[str, np.ndarray]], where: tuple[str, str], path: Path) -> None:
    """Draw a joint in a motion that was left out."""
    from matplotlib.figure import Figure

    from pamid.plots.style import BLUE, GREY, ORANGE, save_figure, style

    motion, joint = where
    log, k = motions[motion], JOINTS.index(joint)
    rows = log["time"].to_numpy() < 30.0
    with style():
        figure = Figure(figsize=(7.0, 2.8), layout="constrained")
        ax = figure.add_subplot()
        t = log["time"].to_numpy()[rows]
        ax.plot(t, 1e3 * log[joint].to_numpy()[rows], color=GREY, linewidth=2.5, label="reading")
        for (title, found), colour in zip(runs.items(), (ORANGE, BLUE), strict=True):
            ax.plot(t, 1e3 * found[motion][rows, k], color=colour, linewidth=1.0, label=title)
        ax.set_xlabel("time, s")
        ax.set_ylabel(f"{joint.replace('_', ' ')}, mrad")
        ax.legend(frameon=False)
        save_figure(figure, path)


def study(folder: Path, plots: Path | None = None) -> None:
    """Print the table, and draw the picture where a folder for it is given."""
    begun = time.perf_counter()
    motions = {p.parent.name: read(p.parent) for p in sorted(folder.glob("*/state_motor.csv"))}
    fit, left = split(list(motions))
    train = {n: motions[n] for n in fit}
    print(f"SO-101: {len(motions)} motions; fitted (seed {SEED}): {', '.join(fit)}")
    print(f"  free-run error, mrad: fitted, left out, by joint of those left out ({', '.join(JOINTS)})", flush=True)
    best, runs = np.inf, {}
    for title, runs[title] in others(folder, motions, train):
        best = min(best, line(title, runs[title], motions, fit, left))
    causes, seconds = all_diagnosed(folder, train)
    name = "pamid: causes it names"
    runs[name] = corrected(loaded(folder, STEP, implicit=True), motions, causes)
    own = line(name, runs[name], motions, fit, left)
    said = {True: "reached", False: "missed"}
    print(f"  target {TARGET:.0f} mrad: {said[own <= TARGET]}")
    print(f"  target {RATIO} of the best other: {own / best:.2f}, {said[own <= RATIO * best]}")
    print(f"  {seconds:.0f} s of CPU for {len(JOINTS)} diagnoses; target {60 * MINUTES:.0f} s of {PROCESSES} cores:")
    print(f"    {said[seconds <= 60 * MINUTES * PROCESSES]}; {time.perf_counter() - begun:.0f} s in all")
    if plots is not None:
        shown = {"public model": runs["public model"], "with the named causes": runs[name]}
        place = "multisine" if "multisine" in left else left[0]
        draw(motions, shown, (place, "elbow_flex"), plots / "published-so101.svg")


def line(
    title: str, runs: Mapping[str, np.ndarray], motions: Motions, fit: Sequence[str], left: Sequence[str]
) -> float:
    """Print a row of the table; return the error on the motions left out, mrad."""
    errors = errors_of(runs, motions)
    here, (there, joints) = told(errors, fit)[0], told(errors, left)
    print(f"  {title:34s} {here:6.1f} {there:8.1f}  {', '.join(f'{x:.1f}' for x in joints)}", flush=True)
    return there
