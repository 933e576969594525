"""Time of ``predict`` on one row, as an array and as a DataFrame, for every estimator that answers row by row."""

from __future__ import annotations

import argparse
import time
import warnings
from typing import Any

import numpy as np
import pandas as pd
from pamid.estimators import (
    MLP,
    ConformalRegressor,
    ForwardModel,
    FullFineTuning,
    GeometricFlow,
    GeometricForce,
    HosovskyHybrid,
    InverseModel,
    InvertedForce,
    JointPIHM,
    LawRegressor,
    LoRA,
    NonlinearElastic,
    OnlineAdapter,
    PartialFineTuning,
    PolynomialFlow,
    PolynomialForce,
    QAdapter,
    ResidualHybrid,
    ScaleAdapter,
    SINDyModel,
    SINDyRegressor,
    StaticForceMap,
    StaticPIHM,
    ThermodynamicPIHM,
    ThreeElement,
)
from sklearn.base import clone
from sklearn.frozen import FrozenEstimator
from sklearn.linear_model import LinearRegression

from pamid.volume.braided import BraidedVolume, chou_hannaford
from pamid.volume.functions import flow

STATE = ["eps", "deps", "P", "dP"]


def muscle(rows: int = 400) -> pd.DataFrame:
    """Make up signals of a muscle; how well a model fits does not matter for its time."""
    rng = np.random.default_rng(0)
    X = pd.DataFrame(
        {
            "eps": rng.uniform(0.0, 0.2, rows),
            "deps": rng.normal(0.0, 0.2, rows),
            "P": rng.uniform(1.5e5, 6e5, rows),
            "dP": rng.normal(0.0, 3e5, rows),
            "load": rng.uniform(5.0, 50.0, rows),
        }
    )
    pull = chou_hannaford(X.P, X.eps, rest_diameter=0.021, braid_angle=0.45)
    X["F"] = pull - 40.0 * np.tanh(8.0 * X.deps) - 200.0 * X.eps + rng.normal(0.0, 1.0, rows)
    X["mdot"] = flow(BraidedVolume(0.2, 0.021, 0.45), X.P, X.dP, X.eps, X.deps)
    return X.assign(V=7e-5, V_eps=pull * 0.2 / (X.P - 101_325.0), V_P=0.0)


def fitted(table: pd.DataFrame) -> list[tuple[Any, pd.DataFrame, Any]]:
    """Return estimators with what they are fitted on, at their default sizes."""
    hybrid: dict[str, Any] = {"max_iter": 5, "random_state": 0}
    force, flow_ = (table[STATE], table["F"]), (table[STATE], table["mdot"])
    short, both = (table[["eps", "P"]], table["F"]), (table[STATE], table[["F", "mdot"]])
    inverse = (table[["F", "eps"]], table["P"])
    source = FrozenEstimator(StaticPIHM(**hybrid).fit(*force))
    one: dict[str, Any] = {"n_starts": 1, "max_iter": 10, "random_state": 0}
    return [
        (LinearRegression(), *force),
        (GeometricForce(), *short),
        (GeometricForce("tondu_lopez", friction=True), table[["eps", "deps", "P"]], table["F"]),
        (GeometricFlow(), *flow_),
        (PolynomialForce(), *short),
        (PolynomialFlow(), *flow_),
        (StaticForceMap(), *short),
        (NonlinearElastic(), *short),
        (HosovskyHybrid(), table[["eps", "deps", "P"]], table["F"]),
        (ThreeElement(), *force),
        (LawRegressor(), table[[*STATE, "V", "V_eps", "V_P"]], table["F"]),
        (SINDyRegressor(), *force),
        (
            SINDyModel(("P",), ("eps", "deps", "mdot"), sampling_period=0.01, one_trajectory=True),
            table[["P", "eps", "deps", "mdot"]],
            None,
        ),
        (ResidualHybrid(**one), *force),
        (InverseModel(on_unreachable="clip", **one), *inverse),
        (ForwardModel(**one), table[["P", "load"]], table[["F", "eps"]]),
        (InvertedForce(GeometricForce(), on_unreachable="clip"), *inverse),
        (StaticPIHM(**hybrid), *force),
        (ThermodynamicPIHM(**hybrid), *flow_),
        (JointPIHM(**hybrid), *both),
        (QAdapter(source, **hybrid), *force),
        (ScaleAdapter(source, random_state=0), *force),
        (LoRA(source, **hybrid), *force),
        (FullFineTuning(source, **hybrid), *force),
        (PartialFineTuning(source, **hybrid), *force),
        (OnlineAdapter(source), *force),
        (MLP(("eps", "P"), max_iter=5, random_state=0), *short),
        (ConformalRegressor(PolynomialForce(2), independent_rows=True, confidence=0.5), *short),
    ]


def times(model: Any, X: Any, calls: int) -> tuple[float, float]:
    """Return median and 99 % quantile of a call, µs; a model that searches for its answer is called for 2 s at most."""
    for _ in range(20):
        model.predict(X)
    taken, end = [], time.perf_counter() + 2.0
    while len(taken) < calls and time.perf_counter() < end:
        start = time.perf_counter()
        model.predict(X)
        taken.append(time.perf_counter() - start)
    median, late = np.quantile(taken, [0.5, 0.99]) * 1e6
    return float(median), float(late)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--calls", type=int, default=2000, help="calls of predict each (default: 2000)")
    parser.add_argument("--target", type=float, default=100.0, help="µs that are asked (default: 100)")
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    print("estimator                array / µs  99 %   DataFrame / µs  99 %")
    above = []
    for model, X, y in fitted(muscle()):
        plain, named = clone(model).fit(X.to_numpy(), y), clone(model).fit(X, y)
        row = X.iloc[[7]]
        (a, a_late), (b, b_late) = times(plain, row.to_numpy(), args.calls), times(named, row, args.calls)
        name = type(model).__name__
        if max(a, b) > args.target and not isinstance(model, LinearRegression):
            above.append(name)
        print(f"{name:24} {a:10.1f} {a_late:6.0f} {b:15.1f} {b_late:6.0f}", flush=True)
    print(f"above {args.target:g} µs in the median: {', '.join(above) or 'none'} (LinearRegression is scikit-learn's)")


if __name__ == "__main__":
    main()
