"""Numbers that stand beside a computation: what each computes, on small data of its own, as it is, halved and doubled.

`benchmarks/settings.py --computed` prints them. A number of which nothing hangs gives the same figures three times.
"""

from __future__ import annotations

import importlib
import math
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest import mock

import numpy as np
import pandas as pd

SEED = 20_261_123
DRAWS = 60


def times(value: Any, factor: float) -> Any:
    """Return a number, or the width of each range about its middle, times a factor; whole numbers stay whole."""
    if isinstance(value, dict):
        return {k: (math.sqrt(a * b) / (r := math.sqrt(b / a) ** factor), math.sqrt(a * b) * r) if a > 0.0
                else (a, b * factor) for k, (a, b) in value.items()}  # fmt: skip
    return max(1, round(value * factor)) if isinstance(value, int) else value * factor


def finer(value: np.ndarray, factor: float) -> np.ndarray:
    """Return a grid of as many points more, or fewer, between the same ends."""
    n = len(value)
    return np.interp(np.linspace(0.0, n - 1.0, round(n * factor)), np.arange(n), value)


@dataclass(frozen=True)
class Number:
    """A number of a module, and what is computed with it.

    Parameters
    ----------
    module, name : str
        Where it stands.
    figures : callable
        Returns what is computed, by name.
    change : callable
        From its value and a factor to another value.
    """

    module: str
    name: str
    figures: Callable[[], dict[str, float]]
    change: Callable[[Any, float], Any] = times

    @property
    def value(self) -> Any:
        """What it is."""
        return getattr(importlib.import_module(f"pamid.{self.module}"), self.name)

    @contextmanager
    def changed(self, factor: float) -> Iterator[None]:
        """Replace it wherever it was read under its name."""
        was = self.value
        now = self.change(was, factor)
        with ExitStack() as stack:
            for module in [m for k, m in list(sys.modules.items()) if k.startswith("pamid.")]:
                if vars(module).get(self.name) is was:
                    stack.enter_context(mock.patch.object(module, self.name, now))
            yield


# --- fits whose numbers are hardly known ------------------------------------------------------------------------
@cache
def _tanks(brim: float) -> tuple[pd.DataFrame, Any]:
    """Return a log of two tanks whose upper one, not logged, runs over at a level, and equations known to 80 %."""
    from pamid.simulators import EquationSimulator, Port

    rng, runs = np.random.default_rng(SEED), []
    for k in range(2):
        inflow, upper, lower, read = np.repeat(rng.uniform(0.6, 5.2, 15), 20), 4.0, 3.0 + k, []
        for u in inflow:
            read.append(lower + 0.01 * rng.standard_normal())
            for _ in range(8):
                over = 0.2 * max(upper - brim, 0.0)
                out, end = 0.07 * math.sqrt(max(upper, 0.0)), 0.055 * math.sqrt(max(lower, 0.0))
                upper, lower = upper + 0.5 * (0.05 * u - out - over), lower + 0.5 * (0.57 * out - end + 0.5 * over)
        runs.append(pd.DataFrame({"trajectory": k, "time": 4.0 * np.arange(len(read)), "u": inflow, "lower": read}))
    ports = [Port("u", "input", "V"), Port("upper", "state", "V", start=4.0), Port("lower", "state", "V")]
    right = {"dupper/dt": "a*u - b*sqrt(max(upper, 0))", "dlower/dt": "c*sqrt(max(upper, 0)) - d*sqrt(max(lower, 0))"}
    return pd.concat(runs, ignore_index=True), EquationSimulator(right, ports, dict.fromkeys("abcd", (0.05, 0.8)))


def hardly_known() -> dict[str, float]:
    """Return how well four numbers that are known to 80 % fit, and whether a diagnosis with them is right."""
    from pamid.gap import diagnose_simulator

    log, simulator = _tanks(7.0)
    found = diagnose_simulator(log, simulator, ["overflow", "leakage", "sensor_gain"])
    right = bool(found.causes) and found.causes[0].effects[0] == "overflow"
    after = sum(c.rmse_after for c in found.closure) / sum(c.rmse_before for c in found.closure)
    return {"right": float(right), "left of the gap": after}


def ended_sensor() -> dict[str, float]:
    """Return whether the end of a sensor's range is the cause that is named, and where it is put, beside the truth."""
    from pamid.gap import diagnose_simulator

    log, simulator = _tanks(math.inf)
    end = 0.9 * float(log["lower"].max())
    cut = log.assign(lower=np.minimum(log["lower"], end))
    found = diagnose_simulator(cut, simulator, ["sensor_saturation", "sensor_gain", "leakage"])
    named = [c for c in found.causes if "sensor_saturation" in c.effects]
    limit = next(iter(named[0].parameters.values())).value / end if named else math.nan
    return {"named": float(bool(named)), "limit": limit}


def no_gap_at_once() -> dict[str, float]:
    """Return the score of the library and its threshold on a log of the bench."""
    from pamid.bench import BenchParameters, simulate, sine
    from pamid.gap import diagnose

    params = BenchParameters.for_muscle("B")
    log = simulate(params, [sine(3, 12, 600)], effects=["dead_volume"], seed=1)
    found = diagnose(log, params, seed=0)
    return {"p": found.p_value, "effects": float(len(found.causes))}


# --- readings ---------------------------------------------------------------------------------------------------
def ends_of_ranges() -> dict[str, float]:
    """Return the shares of ended and of unended signals that are taken for what they are, noise and steps various."""
    from pamid.signals.ends import end_of

    rng, right = np.random.default_rng(SEED), {"ended": [], "free": [], "rounded": []}
    for _ in range(DRAWS):
        n = int(rng.integers(200, 3000))
        x = np.cumsum(rng.standard_normal(n)) / math.sqrt(n) + np.sin(np.arange(n) / rng.uniform(5.0, 50.0))
        x += 10.0 ** rng.uniform(-4.0, -1.0) * rng.standard_normal(n)
        limit, spans = float(np.quantile(np.abs(x), rng.uniform(0.8, 0.98))), [(0, n)]
        step = np.ptp(x) / rng.uniform(10.0, 30.0)
        right["ended"].append(end_of(np.clip(x, -limit, limit), spans) is not None)
        right["free"].append(end_of(x, spans) is None)
        right["rounded"].append(end_of(np.round(x / step) * step, spans) is None)
    return {k: float(np.mean(v)) for k, v in right.items()}


def rests() -> dict[str, float]:
    """Return the shares of rows at rest and of rows in motion that are found to be such, noise and speed various."""
    from pamid.signals.resting import resting_rows

    rng, still, moving = np.random.default_rng(SEED), [], []
    for _ in range(DRAWS):
        dt, moves = 10.0 ** rng.uniform(-3.0, -1.7), rng.uniform(0.8, 3.0)
        t, period = np.arange(0.0, 20.0, dt), moves + rng.uniform(1.0, 3.0)
        x = np.sin(2.0 * np.pi / moves * np.minimum(t % period, moves))
        x += 10.0 ** rng.uniform(-6.0, -3.5) * rng.standard_normal(len(t))
        rows, phase = resting_rows(x, dt, np.zeros(len(t), dtype=int)), t % period
        still.append(rows[(phase > moves + 0.2) & (phase < period - 0.2)].mean())
        moving.append(1.0 - rows[(phase > 0.1) & (phase < moves - 0.1)].mean())
    return {"rest found": float(np.mean(still)), "motion kept": float(np.mean(moving))}


# --- a driven joint ---------------------------------------------------------------------------------------------
def _joint_run(rng: np.random.Generator, reach: float, level: float) -> pd.DataFrame:
    t = np.arange(0.0, 20.0, 0.01)
    centre, (slow, fast) = rng.uniform(-1.0, 1.0), rng.uniform(1.0, 8.0, 2)
    q = centre + reach * (0.7 * np.sin(slow * t) + 0.3 * np.sin(fast * t))
    dq, ddq = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    drive = 0.05 * ddq + 2.0 * np.sin(q) + level * np.cos(q) + 0.1 + 0.2 * np.tanh(dq / 0.05) + 0.1 * dq
    q, drive = q + 2e-4 * rng.standard_normal(len(t)), drive + 0.02 * rng.standard_normal(len(t))
    return pd.DataFrame({"trajectory": "0", "time": t, "q": q, "drive": drive})


def levers() -> dict[str, float]:
    """Return the typical error of gravity, fitted on joints that move little and much, as a share of it."""
    import re

    from pamid.systems.joint import Joint

    rng, errors = np.random.default_rng(SEED), {"little": [], "much": []}
    for _ in range(DRAWS // 4):
        for name, reach in (("little", rng.uniform(0.1, 0.5)), ("much", rng.uniform(0.5, 1.5))):
            problem = Joint().nominal_problem(_joint_run(rng, reach, rng.uniform(-0.3, 0.3)))
            said = next(re.search(r"gravity (-?[\d.e+-]+)", note) for note in problem.notes if "gravity" in note)
            assert said is not None
            errors[name].append(abs(float(said[1]) / 2.0 - 1.0))
    return {k: float(np.median(v)) for k, v in errors.items()}


def moving_windows() -> dict[str, float]:
    """Return how many windows of motion stand in logs of servos of the check on any simulator, on the fewest."""
    from benchmarks.any_simulator.generator import Spec, make
    from benchmarks.any_simulator.nominal import simulator_of
    from pamid.gap.simulated import evidence_of

    fewest = math.inf
    with TemporaryDirectory() as folder:
        for plant in ("servo", "cart", "cylinder"):
            case = make(Spec("none", plant, 0, 3001))
            evidence = evidence_of(case.log, simulator_of(case.plant, Path(folder)))
            fewest = min(fewest, *(len(w.first) for w in evidence.windows))
    return {"fewest windows": fewest}


# --- the next run -----------------------------------------------------------------------------------------------
def controllers() -> dict[str, float]:
    """Return the largest error of a motion, as a share of it, under the gains that a log of the bench shows."""
    from pamid.bench import BenchParameters, Controller, simulate, sine, step
    from pamid.gap.design.followed import controller_of

    params, worst = BenchParameters.for_muscle("B"), {"slow": 0.0, "fast": 0.0}
    for seed, (forward, bandwidth) in enumerate([(1.0, 20.0), (0.7, 30.0), (0.9, 12.0)]):
        true = Controller(bandwidth=bandwidth, forward=forward)
        found = controller_of([simulate(params, [sine(4, 15, 1500)], controller=true, seed=seed)], params)
        for name, run in (("slow", sine(1, 10, 300)), ("fast", step(0, 15, 1200))):
            moved, wanted = (simulate(params, [run], controller=c, seed=0)["q"].to_numpy() for c in (found, true))
            worst[name] = max(worst[name], float(np.std(moved - wanted) / np.std(wanted)))
    return worst


def costs() -> dict[str, float]:
    """Return the largest error of an expected cost, beside sums over the noise, in nats per window."""
    from pamid.gap.design import expected_cost as table
    from pamid.gap.inference.student_t import GAUSSIAN
    from pamid.gap.settings import NU

    with mock.patch.multiple(table, TABLE=table._table()):
        rng, worst = np.random.default_rng(SEED), 0.0
        noise, weights = np.polynomial.hermite_e.hermegauss(80)
        for _ in range(DRAWS):
            left = 10.0 ** rng.uniform(-1.0, 3.0) * rng.standard_normal((40, 1))
            scales = np.geomspace(1.0, 170.0, 2000)
            z2 = np.square(left[:, 0, None] + noise)
            exact = min(
                float(np.sum(0.5 * (NU + 1.0) * np.log1p(z2 / (NU * (GAUSSIAN * s) ** 2)) @ weights / weights.sum()))
                + len(left) * math.log(s)
                for s in scales
            )
            base = 0.5 * (NU + 1.0) * np.log1p(np.square(noise) / (NU * GAUSSIAN**2)) @ weights / weights.sum()
            found = table.expected_cost(left, 0.0)[0][0]
            worst = max(worst, abs(found - (exact - len(left) * float(base))) / len(left))
    return {"nats a window": worst}


# --- forms ------------------------------------------------------------------------------------------------------
def braids() -> dict[str, float]:
    """Return how far the growth of a braid of 15° to 35° is from a multiple of that at the usual angle."""
    from pamid.effects.plant import BRAID_ANGLE

    eps, worst = np.linspace(0.0, 0.25, 100), 0.0

    def wider(angle: float) -> np.ndarray:
        return np.asarray(np.sqrt(1.0 - ((1.0 - eps) * math.cos(angle)) ** 2) / math.sin(angle) - 1.0)

    for degrees in range(15, 36, 5):
        one, other = wider(BRAID_ANGLE), wider(math.radians(degrees))
        left = other - one * float(one @ other) / float(one @ one)
        worst = max(worst, float(np.sqrt(np.mean(left**2) / np.mean(other**2))))
    return {"form": worst}


NUMBERS = (
    Number("gap.inference.descent", "DAMPED", hardly_known),
    Number("gap.inference.descent", "BROYDEN", hardly_known),
    Number("gap.residuals.tolerances", "CURVED", hardly_known),
    Number("simulators.catalogue", "NEAR_END", ended_sensor),
    Number("gap.inference.significance", "_AT_ONCE", no_gap_at_once),
    Number("signals.ends", "_IN_A_ROW", ends_of_ranges),
    Number("signals.ends", "_SELDOM", ends_of_ranges),
    Number("signals.resting", "DURATION", rests),
    Number("signals.resting", "SLOW", rests),
    Number("signals.resting", "NOISE", rests),
    Number("gap.residuals.direct", "LEAST_MOVING", moving_windows),
    Number("systems.joint", "_TELLING", levers),
    Number("gap.design.followed", "SMOOTH", controllers),
    Number("gap.design.followed", "PRIOR", controllers),
    Number("gap.design.followed", "SETTINGS", controllers),
    Number("gap.design.expected_cost", "SIZES", costs, finer),
    Number("gap.design.expected_cost", "SCALES", costs, finer),
    Number("effects.plant", "BRAID_ANGLE", braids),
)
"""All of them."""


def table(names: list[str] | None = None) -> Iterator[str]:
    """Yield a line for each number: what is computed with it as it is, halved and doubled."""
    usual: dict[Any, dict[str, float]] = {}
    yield f"{'number':14s} {'what is computed':18s} {'as it is':>10s} {'halved':>10s} {'doubled':>10s}"
    for number in NUMBERS:
        if names and number.name not in names:
            continue
        importlib.import_module(f"pamid.{number.module}")
        if number.figures not in usual:
            usual[number.figures] = number.figures()
        halved, doubled = ({}, {})
        with number.changed(0.5):
            halved = number.figures()
        with number.changed(2.0):
            doubled = number.figures()
        for key, value in usual[number.figures].items():
            yield f"{number.name:14s} {key:18s} {value:10.4g} {halved[key]:10.4g} {doubled[key]:10.4g}"
