"""Time to the first and to the whole answer for a robot arm in MuJoCo, logged with encoders and commands alone.

An arm of N joints with position servos lacks dry friction at one joint and damping at another. Every size runs in a
process of its own; processor time is that of one core. Run with ``python benchmarks/robot_arms.py``; ``--rows`` and
``--joints`` choose sizes, ``--against DIR`` takes turns with another checkout of pamid and prints ratios. ``--samples``
times the runs over single samples alone: by `mujoco.rollout` in threads, and by single calls.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # the figures are for one core
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pandas as pd

JOINTS, ROWS, DT, STEP = 6, (2_000, 8_000), 0.01, 0.002
ENCODER = 2.0 * np.pi / 4096
ROUNDS = 7
FRICTION, DAMPING = 0.25, 0.4
"""What the log has and the model lacks: N m of dry friction at the third joint, N m s/rad at the second."""


def arm(joints: int, friction: float = 0.0, damping: float = 0.0) -> str:
    """Return the MJCF of an arm that hangs from its first joint, every second axis turned."""
    bodies, ends = "", ""
    for k in range(joints):
        axis = "0 1 0" if k % 2 else "1 0 0"
        more = f' damping="{damping}"' if k == 1 and damping else ""
        bodies += (
            f'<body name="link{k}" pos="0 0 {-0.12 if k else 0.0}"><joint name="j{k}" axis="{axis}" armature="0.1" '
            f'frictionloss="{0.1 + (friction if k == 2 else 0.0)}"{more}/>'
            f'<geom type="capsule" fromto="0 0 0 0 0 -0.12" size="0.02" mass="{0.16 - 0.02 * k:.3f}" '
            'contype="0" conaffinity="0"/>'
        )
        ends += "</body>"
    servos = "".join(f'<position name="servo{k}" joint="j{k}" kp="50" kv="4"/>' for k in range(joints))
    head = f'<mujoco><compiler angle="radian"/><option timestep="{STEP}"/><worldbody>'
    return f"{head}{bodies}{ends}</worldbody><actuator>{servos}</actuator></mujoco>"


def log_of(joints: int, rows: int) -> pd.DataFrame:
    """Return one record of the arm with what the model lacks, angles read by encoders of 12 bits."""
    import mujoco

    m = mujoco.MjModel.from_xml_string(arm(joints, FRICTION, DAMPING))
    d, rng = mujoco.MjData(m), np.random.default_rng(0)
    rate, phase = 2.0 * np.pi * rng.uniform(0.15, 0.5, (3, joints)), rng.uniform(0.0, 6.0, (3, joints))
    table = np.zeros((rows, 1 + 2 * joints))
    for k in range(rows):
        t = k * DT
        command = 0.25 * np.sum(np.sin(rate * t + phase) - np.sin(phase), axis=0)
        table[k] = [t, *(np.round(d.qpos / ENCODER) * ENCODER), *command]
        d.ctrl[:] = command
        mujoco.mj_step(m, d, nstep=round(DT / STEP))
    names = ["time", *(f"j{k}_q" for k in range(joints)), *(f"servo{k}" for k in range(joints))]
    return pd.DataFrame(table, columns=names).assign(trajectory="record")


def one(joints: int, rows: int) -> dict[str, object]:
    """Diagnose one log; return what it took until the first words, a first cause and the end, and the answer."""
    from pamid.gap import diagnose_simulator
    from pamid.simulators.mujoco_model import MujocoSimulator

    log, began, told = log_of(joints, rows), (time.perf_counter(), time.process_time()), {}

    def step(text: str) -> None:
        if type(text) is not str:
            told.setdefault("words" if "the gap is" in text else "cause", time.perf_counter() - began[0])

    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "arm.xml"
        page.write_text(arm(joints))
        found = diagnose_simulator(log, MujocoSimulator(page), progress=step)
    whole, cpu = time.perf_counter() - began[0], time.process_time() - began[1]
    causes = [f"{c.effects[0]}@{c.where[0]} {c.share:.1%}" for c in found.causes]
    return {"first words": told.get("words"), "first cause": told.get("cause"), "whole": whole, "cpu": cpu,
            "answer": found.verdict, "causes": causes}  # fmt: skip


def apart(joints: int, rows: int, folder: Path) -> dict[str, object]:
    """Return the same of a process of its own, with the pamid of a checkout."""
    command = [sys.executable, str(Path(__file__).resolve()), "--one", str(joints), str(rows)]
    env = {**os.environ, "PYTHONPATH": str(folder)}
    out = subprocess.run(command, env=env, capture_output=True, text=True, check=True)
    return dict(json.loads(out.stdout.splitlines()[-1]))


def samples(joints: int, rows: int) -> None:
    """Print the least time of the runs over each sample, of as many rounds, by `mujoco.rollout` and by single calls."""
    from pamid.simulators import mujoco_model

    rng, ways = (
        np.random.default_rng(0),
        {"mujoco.rollout, one thread": 1, "two threads": 2, "four": 4, "single calls": 0},
    )
    x, starts = rng.uniform(-0.3, 0.3, (2, 2 * joints, rows))
    ends = starts + rng.uniform(-0.02, 0.02, starts.shape)
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "arm.xml"
        page.write_text(arm(joints))
        simulator = mujoco_model.MujocoSimulator(page)
        given = x, starts, ends, np.repeat(simulator.numbers[:, None], rows, axis=1), DT, STEP
        known, least, answers = mujoco_model.rolls_out, dict.fromkeys(ways, (np.inf, np.inf)), []
        for _ in range(ROUNDS):
            for way, threads in ways.items():
                os.environ["OMP_NUM_THREADS"] = str(max(threads, 1))
                mujoco_model.rolls_out = known if threads else lambda: False
                began = time.perf_counter(), time.process_time()
                answers.append(simulator.own_steps(*given))
                took = time.perf_counter() - began[0], time.process_time() - began[1]
                least[way] = min(least[way][0], took[0]), min(least[way][1], took[1])
        mujoco_model.rolls_out = known
    print(
        f"{joints} joints, {rows} samples of {round(DT / STEP)} steps, least of {ROUNDS} rounds, {os.cpu_count()} cores"
    )
    for way, (wall, cpu) in least.items():
        print(f"  {way:27s} {wall:6.3f} s, {cpu:6.3f} s of CPU")
    print(f"  largest difference {max(float(np.max(np.abs(a - answers[0]))) for a in answers):.0e}")


def main() -> None:
    """Print a line for each size."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--joints", type=int, nargs="+", default=[JOINTS])
    parser.add_argument("--rows", type=int, nargs="+", default=list(ROWS))
    parser.add_argument("--against", type=Path, help="another checkout, for ratios side by side")
    parser.add_argument("--samples", action="store_true", help="time the runs over single samples alone")
    parser.add_argument("--one", type=int, nargs=2, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one:
        print(json.dumps(one(*args.one)))
        return
    if args.samples:
        for joints in args.joints:
            for rows in args.rows:
                samples(joints, rows)
        return
    here = Path(__file__).resolve().parents[1]
    print("joints   rows   first words   first cause   whole     cpu   answer")
    for joints in args.joints:
        for rows in args.rows:
            found = {folder: apart(joints, rows, folder) for folder in (here, args.against) if folder}
            for folder, r in found.items():
                times = "".join(
                    "            - " if r[k] is None else f"{r[k]:12.1f} s" for k in ("first words", "first cause")
                )
                print(f"{joints:6d} {rows:6d}{times}{r['whole']:8.0f} s{r['cpu']:6.0f} s   {r['answer']}: "
                      f"{', '.join(r['causes'])}{'' if folder == here else '   (the other)'}")  # fmt: skip
            if args.against:
                print(f"{'':13s} ratio of processor time {found[here]['cpu'] / found[args.against]['cpu']:.2f}")


if __name__ == "__main__":
    main()
