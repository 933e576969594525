"""Turn what a diagnosis wrote into an answer, and see on unseen trajectories how far its correction goes."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pamid.bench import BenchParameters
from pamid.equations import evaluate_log

from .catalogue import VOCABULARY
from .generator import Case
from .metrics import Answer, Truth
from .quantities import LONG, nominal
from .regions import agreement, true_region
from .strength import Readings, refit


def simulator(text: str) -> BenchParameters:
    """Read a simulator file from its text."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sim.toml"
        path.write_text(text, encoding="utf-8")
        return BenchParameters.from_toml(path)


def truth(key: Mapping[str, Any]) -> Truth:
    """Return the truth of a case from its key."""
    net = key["net"]
    top = max(net.values())
    # Where refit noise alone remains, no equation is the right one.
    order = sorted((e for e in net if net[e] >= 0.5 * top), key=lambda e: -net[e])
    names = list(key["effects"])
    return Truth(
        key["suite"],
        {n: key["effects"][n]["strength"] for n in names},
        {n: key["effects"][n]["family"] for n in names},
        tuple(order) if names else (),
        not key["left_out"] and all(n in VOCABULARY for n in names),
    )


def readings(log: pd.DataFrame) -> list[Readings]:
    """Return the runs of a log as own code reads them; the flow at the end of an interval is the next one's start."""
    out = []
    for _, run in log.groupby("trajectory", sort=False):
        two = {c: run[[f"{c}1", f"{c}2"]].to_numpy(float) for c in ("P", "F", "mdot", "u")}
        out.append(Readings(run["q"].to_numpy(float), two["P"], two["F"], two["mdot"], two["u"], two["mdot"]))
    return out


def refitted(case: Case, params: BenchParameters) -> BenchParameters:
    """Return the nominal simulator refitted within its tolerances by own code: the reference for a correction."""
    changes = refit(nominal(case.spec.muscle), readings(case.log))
    return params.replace(**{LONG[k]: params.get(LONG[k]) * (1.0 + v) for k, v in changes.items()})


def closed_share(future: pd.DataFrame, before: BenchParameters, after: BenchParameters, equation: str) -> float | None:
    """Return the share of the mean square gap that a correction closes in an equation, on readings without noise.

    Without noise all that is left is gap: nothing has to be taken off.
    """
    worse = evaluate_log(future, before, [equation])[equation].rmse
    better = evaluate_log(future, after, [equation])[equation].rmse
    if not worse > 0 or not math.isfinite(better):
        return None
    return 1.0 - (better / worse) ** 2


def regions(case: Case, found: Sequence[Mapping[str, Any]], equation: str, table: pd.DataFrame) -> tuple[float, float]:
    """Return the F1 of an equation's named regions against where 80 % of the gap is, and where it is over the floor."""
    queries = [str(r["query"]) for r in found if r["equation"] == equation]
    gap, centres = case.contributions[equation], case.centres[equation]
    over = np.abs(gap) > case.key["floors"][equation]
    return agreement(table, queries, centres, true_region(gap)), agreement(table, queries, centres, over)


def left_share(case: Case, before: BenchParameters, after: BenchParameters) -> float:
    """Return the share of the gap's power that a correction leaves on readings without noise, over all equations.

    Each equation counts in units of its noise, and as much as it has windows, as in the remainder of a diagnosis.
    """
    weight = {e: case.contributions[e].size / case.key["floors"][e] ** 2 for e in case.contributions}
    was, now = evaluate_log(case.future_clean, before), evaluate_log(case.future_clean, after)
    total = [sum(w * found[e].rmse ** 2 for e, w in weight.items()) for found in (was, now)]
    return total[1] / total[0]


SAME_FORM = {
    "pressure_bias": ("offset", "signed"),
    "force_bias": ("offset", "signed"),
    "flow_bias": ("offset", "signed"),
    "length": ("deviation", "signed"),
    "transport_delay": ("delay", "plain"),
    "angle_delay": ("delay", "plain"),
}
"""Effects that mean the same here as in the library, and the parameter that is their amplitude."""


def amplitude_covered(d: Mapping[str, Any], key: Mapping[str, Any]) -> bool | None:
    """Return whether the 90 % interval of a right cause's amplitude holds the true one; None if not comparable."""
    for name, effect in key["effects"].items():
        for cause in d.get("causes", []):
            if name not in SAME_FORM or cause["effects"][0] != name:
                continue
            parameter, how = SAME_FORM[name]
            interval = _interval(cause["parameters"].get(parameter, {}).get("ci90"))
            p = effect["parameters"]
            value = p["a"] * (p["sign"] if how == "signed" else 1.0)
            return None if interval is None else interval[0] <= value <= interval[1]
    return None


def answer(
    d: Mapping[str, Any],
    true: Truth,
    families: Mapping[str, str],
    region: tuple[float, float] | None,
    realised: float | None,
    amplitude: bool | None,
    seconds: float,
) -> Answer:
    """Return the answer that a ``diagnosis.json`` gives."""
    where = d.get("where", {}).get("equations", [])
    closures = {c["equation"]: c for c in d.get("closure", [])}
    closure = closures.get(true.equations[0]) if true.equations else None
    names = [c for c in d.get("causes", []) if c.get("grade") != "family"]  # a family is not the name of its member
    return Answer(
        gap=bool(d["gap"]),
        verdict=d["verdict"] if names or not d.get("causes") else "unknown",
        confidence={c["effect"]: float(c["confidence"]) for c in d["candidates"]},
        causes=tuple(tuple(c["effects"]) for c in names),
        families=dict(families),
        equation=max(where, key=lambda e: e["share"])["equation"] if where and d["gap"] else None,
        region_f1=region and region[0],
        over_floor_f1=region and region[1],
        predicted=closure and _number(closure["closed_share"]),
        realised=realised,
        amplitude=amplitude,
        interval=closure and _interval(closure["ci90"]),
        seconds=seconds,
        reserved=bool(d.get("with_reserve")),
    )


def _number(x: Any) -> float | None:
    return float(x) if x is not None and math.isfinite(float(x)) else None


def _interval(x: Any) -> tuple[float, float] | None:
    if x is None or any(_number(v) is None for v in x):
        return None
    return float(x[0]), float(x[1])


def checked(d: Mapping[str, Any]) -> list[str]:
    """Return what is wrong with the form of a ``diagnosis.json``; an answer out of form is no answer."""
    wrong = []
    if d.get("verdict") not in ("cause", "class", "several", "unknown", "none"):
        wrong.append(f"verdict {d.get('verdict')!r}")
    sure = [float(c["confidence"]) for c in d.get("candidates", [])]
    names = {c["effect"] for c in d.get("candidates", [])}
    if not {"none", "unknown"} <= names:
        wrong.append("candidates lack none or unknown")
    if sure and abs(sum(sure) - 1.0) > 1e-6:
        wrong.append(f"confidences add to {sum(sure):.6f}")
    if bool(d.get("gap")) != (d.get("verdict") != "none"):
        wrong.append(f"gap {d.get('gap')} with verdict {d.get('verdict')}")
    return wrong


def state_table(log: pd.DataFrame, params: BenchParameters) -> pd.DataFrame:
    """Return the table that queries of regions read, as the diagnosis makes it."""
    from pamid.gap import state_table as make

    return make(log, params)
