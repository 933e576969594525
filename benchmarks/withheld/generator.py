"""From a list of specifications to logs and their keys: many benches at once, amplitudes set by what they leave."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd

from . import several
from .catalogue import VOCABULARY, catalogue
from .excitation import DT, Reference, draw_plan
from .loop import Control, as_columns, draw_control, record, told_by
from .plant import Ingredient, Plant
from .quantities import Noise, Numbers, draw_noise, draw_offsets, nominal
from .strength import EQUATIONS, WINDOW, Readings, Strength, strength

FUTURE_RUNS = 3
COLUMNS = ("trajectory", "time", "q_ref", "q", "u1", "P1", "F1", "mdot1", "u2", "P2", "F2", "mdot2")


@dataclass(frozen=True)
class Spec:
    """What a case is to be.

    Parameters
    ----------
    suite : str
        Name of its suite.
    index : int
        Number within it.
    entropy : tuple of int
        Seed: no two cases share one.
    muscle : str
        ``"A"``, ``"B"`` or ``"C"``.
    targets : dict of str to float
        What it has, and how strong over the floor.
    left_out : tuple of str
        Effects to take out of the library before the diagnosis.
    poor : bool
        Slow sines and triangles only.
    """

    suite: str
    index: int
    entropy: tuple[int, ...]
    muscle: str
    targets: dict[str, float] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()
    poor: bool = False

    @property
    def name(self) -> str:
        """Name of the case, which says nothing of its cause."""
        return f"{self.suite}-{self.index:04d}"


@dataclass
class _Draw:
    """Everything about a case that chance decides."""

    spec: Spec
    simulator: Numbers
    offsets: dict[str, float]
    noise: Noise
    control: Control
    plan: list[Reference]
    future: list[Reference]
    shapes: dict[str, dict[str, float]]
    noise_seed: tuple[int, ...]

    def true(self) -> Numbers:
        n = self.simulator.changed(**self.offsets)
        for name, p in self.shapes.items():
            if p["a"] > 0:
                n = catalogue()[name]().numbers(n, p)
        return n


@dataclass
class Case:
    """A log with its simulator, and apart from both its key.

    Parameters
    ----------
    spec : Spec
        What was asked for.
    log, future, future_clean : DataFrame
        What the diagnosis sees; other trajectories of the same bench; the same without noise.
    sim_toml : str
        The nominal simulator's file.
    key : dict
        What is true.
    contributions : dict of str to array
        What the effects leave in each equation's windows after a refit, shape (windows, sides).
    centres : dict of str to array
        Row of the log at the centre of each window.
    drawn : object
        The bench itself, for `record_more`.
    each : dict of str to dict of str to array
        For each effect what it leaves by itself, like ``contributions``.
    """

    spec: Spec
    log: pd.DataFrame
    future: pd.DataFrame
    future_clean: pd.DataFrame
    sim_toml: str
    key: dict[str, Any]
    contributions: dict[str, np.ndarray]
    centres: dict[str, np.ndarray]
    drawn: _Draw
    each: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)


def draw(spec: Spec, runs: int, samples: int) -> _Draw:
    """Draw a case."""
    rng = np.random.default_rng(spec.entropy)
    n = nominal(spec.muscle)
    offsets = draw_offsets(rng)
    shapes = {}
    for name in spec.targets:
        ingredient = catalogue()[name]()
        shapes[name] = ingredient.draw(rng, n)
        if hasattr(ingredient, "key"):
            offsets.pop(ingredient.key, None)
    return _Draw(
        spec, n, offsets, draw_noise(rng, n), draw_control(rng, spec.muscle), draw_plan(rng, runs, samples, spec.poor),
        draw_plan(rng, FUTURE_RUNS, samples), shapes, (*spec.entropy, 1),
    )  # fmt: skip


def _ingredients(draws: list[_Draw], repeats: list[int]) -> list[Ingredient]:
    """Make everything that any of the cases has; the others have it at amplitude 0."""
    made = []
    for name, cls in catalogue().items():
        if not any(name in d.shapes for d in draws):
            continue
        ingredient = cls()
        absent = [{**cls().draw(np.random.default_rng(0), d.simulator), "a": 0.0} for d in draws]
        shapes = [
            {k: v for k, v in {**a, **d.shapes.get(name, {})}.items()} for a, d in zip(absent, draws, strict=True)
        ]
        ingredient.p = SimpleNamespace(**{k: np.repeat([s[k] for s in shapes], repeats) for k in shapes[0]})
        made.append(ingredient)
    return made


def _delays(draws: list[_Draw], repeats: list[int]) -> tuple[np.ndarray, np.ndarray]:
    split, lag = [], []
    for d in draws:
        p = d.shapes.get("transport_delay")
        if p is None or p["a"] <= 0:
            split.append(0.5)
            lag.append(0)
            continue
        whole = math.floor(p["a"] / DT)
        part = min(max(p["a"] / DT - whole, 0.3), 0.7)
        p["a"] = (whole + part) * DT
        split.append(part)
        lag.append(whole + 1)
    return np.repeat(split, repeats), np.repeat(lag, repeats)


@dataclass
class _Run:
    name: str
    q_ref: np.ndarray
    clean: Readings
    noisy: Readings
    logged: np.ndarray


def simulate(draws: list[_Draw], future: bool) -> list[list[_Run]]:
    """Simulate all runs of all cases together; return those of each case, the future ones last."""
    plans = [d.plan + (d.future if future else []) for d in draws]
    repeats = [len(p) for p in plans]
    truths = [d.true() for d in draws]
    plant = Plant(
        [t for t, r in zip(truths, repeats, strict=True) for _ in range(r)],
        _ingredients(draws, repeats),
        [k for r in repeats for k in range(r)],
    )
    q_ref = np.column_stack([run.q for plan in plans for run in plan])
    samples = len(q_ref)
    noise, steps = [], []
    for d, plan in zip(draws, plans, strict=True):
        e = d.noise
        scale = np.array([e.q, e.P, e.P, e.F, e.F, e.mdot, e.mdot])
        step = np.array(
            [e.step_q, e.step_pressure, e.step_pressure, e.step_force, e.step_force, e.step_mdot, e.step_mdot]
        )
        for k in range(len(plan)):
            rng = np.random.default_rng((*d.noise_seed, k))
            noise.append(d.noise(rng, (samples, 7)) * scale)
            steps.append(step)
    split, lag = _delays(draws, repeats)
    control = as_columns([d.control for d in draws], repeats)
    told = told_by([run for plan in plans for run in plan])
    done = record(plant, q_ref, np.stack(noise, -1), np.stack(steps, -1), control, split, lag, told)
    out: list[list[_Run]] = []
    column = 0
    for plan in plans:
        runs = []
        for run in plan:
            rows = slice(run.lead, samples)

            def readings(x: np.ndarray, extra: np.ndarray, rows: slice = rows, column: int = column) -> Readings:
                x = x[rows, :, column]
                end = done.mdot_end[rows, :, column] + extra[rows]
                return Readings(x[:, 0], x[:, 1:3], x[:, 3:5], x[:, 5:7], done.u[rows, :, column], end)

            noise_of_flow = done.noisy[:, 5:7, column] - done.clean[:, 5:7, column]
            runs.append(
                _Run(
                    run.name,
                    run.q[rows],
                    readings(done.clean, np.zeros_like(noise_of_flow)),
                    readings(done.noisy, noise_of_flow),
                    done.noisy[rows, :, column],
                )
            )
            column += 1
        out.append(runs)
    return out


def _frame(runs: list[_Run], clean: bool) -> pd.DataFrame:
    parts = []
    for run in runs:
        s = run.clean if clean else run.noisy
        part = {"trajectory": run.name, "time": np.arange(len(run.q_ref)) * DT, "q_ref": run.q_ref, "q": s.q}
        for k in (0, 1):
            part |= {
                f"u{k + 1}": s.u[:, k],
                f"P{k + 1}": s.P[:, k],
                f"F{k + 1}": s.F[:, k],
                f"mdot{k + 1}": s.mdot[:, k],
            }
        parts.append(pd.DataFrame(part)[list(COLUMNS)])
    frame = pd.concat(parts, ignore_index=True)
    if clean:
        return frame
    return frame.astype({c: np.float32 for c in COLUMNS[2:]})


def _measure(d: _Draw, runs: list[_Run]) -> Strength:
    return strength(d.simulator, d.offsets, [r.clean for r in runs], [r.noisy for r in runs])


def _alone(d: _Draw) -> list[_Draw]:
    """Return the case with each of its effects alone."""
    return [replace(d, shapes={name: p}) for name, p in d.shapes.items()]


def _calibrate(draws: list[_Draw], rounds: int = 3) -> list[dict[str, Strength]]:
    """Set the amplitudes so that each effect alone is as strong as asked; return what was measured."""
    singles = [(d, name, one) for d in draws for (name, one) in zip(d.shapes, _alone(d), strict=True)]
    if not singles:
        return [{} for _ in draws]
    for _, name, one in singles:
        p = one.shapes[name]
        p["a"] = min(max(0.3 * p["a"], p["lo"]), p["hi"])
    past: dict[int, tuple[float, float]] = {}
    measured: dict[int, Strength] = {}
    todo = list(range(len(singles)))
    for turn in range(rounds + 1):
        for k, runs in zip(todo, simulate([singles[k][2] for k in todo], False), strict=True):
            measured[k] = _measure(singles[k][2], runs)
        if turn == rounds:
            break
        missed = []
        for k in todo:
            d, name, one = singles[k]
            p, target = one.shapes[name], d.spec.targets[name]
            now = (math.log(p["a"]), math.log(max(measured[k].total, 1e-6)))
            slope = 1.0
            if k in past and abs(now[0] - past[k][0]) > 0.05:
                slope = min(max((now[1] - past[k][1]) / (now[0] - past[k][0]), 0.5), 2.0)
            past[k] = now
            wanted = min(max(math.exp(now[0] + (math.log(target) - now[1]) / slope), p["lo"]), p["hi"])
            if abs(now[1] - math.log(target)) > 0.1 and abs(math.log(wanted / p["a"])) > 0.02:
                p["a"] = wanted
                missed.append(k)
        todo = missed
        if not todo:
            break
    out: list[dict[str, Strength]] = [{} for _ in draws]
    at = {id(d): k for k, d in enumerate(draws)}
    for k, (d, name, _) in enumerate(singles):
        out[at[id(d)]][name] = measured[k]
    return out


def centres(length: int) -> dict[str, np.ndarray]:
    """Return the row at the centre of each window of a run of some length, by equation."""
    boxes = (length - WINDOW) // WINDOW + 1
    first = np.arange(boxes) * WINDOW
    torque = np.arange((length - 2 - 3 * (WINDOW - 1) - 1) // WINDOW + 1) * WINDOW
    middle = WINDOW // 2
    return {
        "force": first + middle,
        "flow": first[1:],
        "valve": first + middle,
        "joint": torque + 1 + 3 * (WINDOW - 1) // 2,
    }


def generate(specs: Sequence[Spec], layout: tuple[int, int]) -> list[Case]:
    """Generate cases together.

    Parameters
    ----------
    specs : sequence of Spec
        What they are to be.
    layout : tuple of int
        Runs a log, and samples a run with its lead.

    Returns
    -------
    list of Case
        In the order of `specs`.
    """
    draws = [draw(spec, *layout) for spec in specs]
    alone = _calibrate(draws)
    cases = []
    for d, runs, single in zip(draws, simulate(draws, True), alone, strict=True):
        seen, future = runs[: len(d.plan)], runs[len(d.plan) :]
        total = _measure(d, seen)
        rows = np.cumsum([0] + [len(r.q_ref) for r in seen])
        middle = [centres(len(r.q_ref)) for r in seen]
        cases.append(
            Case(
                d.spec,
                _frame(seen, False),
                _frame(future, False),
                _frame(future, True),
                d.simulator.toml(),
                _key(d, total, single),
                total.contribution,
                {e: np.concatenate([m[e] + a for m, a in zip(middle, rows, strict=False)]) for e in EQUATIONS},
                d,
                {name: s.contribution for name, s in single.items()},
            )
        )
    return cases


def record_more(
    cases: Sequence[Case],
    plans: Sequence[list[Reference]],
    seed: int,
    changed: Callable[[_Draw], _Draw] = lambda d: d,
) -> list[list[pd.DataFrame]]:
    """Record further runs on the benches of cases, with noise of their own.

    Parameters
    ----------
    cases : sequence of Case
        The cases.
    plans : sequence of list of Reference
        For each case its runs, all of one length.
    seed : int
        Seed of the noise, beside the case's own.
    changed : callable, optional
        Takes a bench, returns it as it is on that day.

    Returns
    -------
    list of list of DataFrame
        For each case a log a run.
    """
    draws = [
        replace(changed(c.drawn), plan=plan, future=[], noise_seed=(*c.drawn.noise_seed, seed))
        for c, plan in zip(cases, plans, strict=True)
    ]
    return [[_frame([run], False) for run in runs] for runs in simulate(draws, False)]


def _key(d: _Draw, total: Strength, single: dict[str, Strength]) -> dict[str, Any]:
    """Return what is true of a case."""
    effects = {
        name: {
            "family": VOCABULARY.get(name, "foreign"),
            "parameters": {k: v for k, v in p.items() if k not in ("lo", "hi")},
            "strength": single[name].total,
            "net": single[name].net,
            "raw": single[name].raw,
            "equation": single[name].equation,
            "share": several.share_of_gap(single[name].contribution, total.contribution, total.floors),
            "part": several.part_of_all(single[name].contribution, total.contribution, total.floors),
        }
        for name, p in d.shapes.items()
    }
    return {
        "name": d.spec.name,
        "suite": d.spec.suite,
        "entropy": list(d.spec.entropy),
        "muscle": d.spec.muscle,
        "effects": effects,
        "left_out": list(d.spec.left_out),
        "poor": d.spec.poor,
        "offsets": d.offsets,
        "strength": total.total,
        "net": total.net,
        "raw": total.raw,
        "floors": total.floors,
        "equation": total.equation,
        "noise": vars(d.noise),
        "control": vars(d.control),
    }
