"""``partial_fit`` of every estimator: the fit of all rows so far, in whatever order they come."""

import warnings

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import (
    MLP,
    NNARX,
    CarriedForce,
    ConformalRegressor,
    CylinderForce,
    ForwardModel,
    FullFineTuning,
    GapDiagnoser,
    GeometricFlow,
    GeometricForce,
    HosovskyHybrid,
    InverseModel,
    InvertedForce,
    JointDrive,
    JointPIHM,
    LawRegressor,
    LiftedLoad,
    LinearStateSpace,
    LoRA,
    NonlinearElastic,
    OnlineAdapter,
    PartialFineTuning,
    PolynomialFlow,
    PolynomialForce,
    PolynomialNARX,
    QAdapter,
    RateTransformer,
    Recurrent,
    ResidualHybrid,
    ScaleAdapter,
    SINDyModel,
    SINDyRegressor,
    StaticForceMap,
    StaticPIHM,
    ThermodynamicPIHM,
    ThreeElement,
    TransferFunction,
    all_estimators,
)
from sklearn.base import clone
from sklearn.frozen import FrozenEstimator

from pamid.constants import GRAVITY
from pamid.errors import StreamChangeWarning
from pamid.volume.braided import BraidedVolume, chou_hannaford
from pamid.volume.functions import flow

pytestmark = [
    pytest.mark.filterwarnings("ignore::pamid.errors.PamidWarning"),
    pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning"),
]

RUNS, STEPS = 20, 20
"""Runs that lift a load, and rows of each."""
ROWS = 200
"""Rows in random motion."""
STATE = ["eps", "deps", "P", "dP"]
LARGER = 1.3
"""Factor by which the other muscle pulls harder and takes more air."""


def muscle(seed: int, factor: float = 1.0) -> pd.DataFrame:
    """Rows of a muscle in random motion."""
    rng = np.random.default_rng(seed)
    n = ROWS
    table = pd.DataFrame(
        {
            "eps": rng.uniform(0.0, 0.2, n),
            "deps": rng.normal(0.0, 0.2, n),
            "P": rng.uniform(1.5e5, 6e5, n),
            "dP": rng.normal(0.0, 3e5, n),
        }
    )
    return of_state(table, rng, factor)


def of_state(table: pd.DataFrame, rng: np.random.Generator, factor: float = 1.0) -> pd.DataFrame:
    """What a muscle gives in these states."""
    n = len(table)
    eps, deps, P, dP = (table[name].to_numpy() for name in STATE)
    F = chou_hannaford(P, eps, rest_diameter=0.021, braid_angle=0.45) - 60.0 * np.tanh(8.0 * deps) - 200.0 * eps
    mdot = flow(BraidedVolume(0.2, 0.021, 0.45), P, dP, eps, deps)
    push = 5e-4 * (P - 101_325.0) + 40.0 * np.tanh(deps / 0.05) + 50.0 * np.sin(eps)
    return table.assign(
        push=factor * push + rng.normal(0.0, 5.0, n),
        F=factor * F + rng.normal(0.0, 5.0, n),
        mdot=factor * mdot + rng.normal(0.0, 0.01 * mdot.std(), n),
        V=factor * 7e-5,
        V_eps=factor * F * 0.2 / (P - 101_325.0),
        V_P=0.0,
    )


def lifts(seed: int, factor: float = 1.0) -> pd.DataFrame:
    """Runs in which a muscle lifts a load: it lags behind its pressure by 0.3 s and begins each run at rest."""
    rng, every, lag = np.random.default_rng(seed), 0.01, 0.3
    t, runs = np.arange(0.0, 2.0, every), []
    for run in range(RUNS):
        load, (a, b) = rng.choice([10.0, 20.0, 40.0]), rng.uniform(0.0, 2.0 * np.pi, 2)
        P = 5e5 + 4e4 * (np.sin(4.0 * t + a) + np.sin(7.0 * t + b))
        rest = factor * (1e-3 * (P - 101_325.0) - GRAVITY * load / 4.0) / 2000.0
        lift, out = rest[0], []
        for r in rest:
            out.append(lift)
            lift += every / lag * (r - lift)
        columns = {"trajectory": run, "time": t, "P": P, "load": load, "lift": out, "rest": rest[0]}
        runs.append(pd.DataFrame(columns)[::10])
    table = pd.concat(runs, ignore_index=True)
    return table.assign(lift=table["lift"] + rng.normal(0.0, 5e-4, len(table)))


@pytest.fixture(scope="module")
def rows():
    """Training, held-out and the other muscle's data."""
    return muscle(0), muscle(1), muscle(2, LARGER), muscle(3, LARGER)


@pytest.fixture(scope="module")
def runs():
    """The same for models of sequences."""
    return lifts(0), lifts(1), lifts(2, LARGER), lifts(3, LARGER)


@pytest.fixture
def stream(request, rows, runs):
    """What the case of a test reads."""
    case = request.node.callspec.params["case"] if hasattr(request.node, "callspec") else ""
    return runs if case and {"load", "lift"} & set(CASES[case][1][0]) else rows


@pytest.fixture(scope="module")
def sources():
    """Models of a smaller muscle, from which adapters start."""
    table = muscle(9, 0.8)
    small = {"hidden_layer_sizes": (12,), "max_iter": 15, "random_state": 0}
    carried = CarriedForce(rest_diameter=0.018, pressure_memory=False).fit(table[["eps", "P"]], table["F"])
    return {
        "carried": FrozenEstimator(carried),
        "force": FrozenEstimator(StaticPIHM(0.2, 0.02, **small).fit(table[STATE], table["F"])),
    }


PIHM = {"hidden_layer_sizes": (8,), "max_iter": 10, "random_state": 0}
ADAPT = {"max_iter": 5, "random_state": 0}
PLAIN = {"hidden": (8,), "batch_size": 64, "max_iter": 60, "learning_rate": 0.02, "random_state": 0}
MEMORY = {"hidden": 4, "window": 20, "burn_in": 5, "max_iter": 40, "batch_size": 4, "learning_rate": 0.05}
LAGGED = {"output_lags": 1, "horizon": 10, "max_iter": 15, "start": "rest"}
FORCE, SEQUENCE, FLOW = (STATE, "F"), (["trajectory", "time", "P", "load", "rest"], "lift"), (STATE, "mdot")

CASES = {
    "CarriedForce": (lambda s: CarriedForce(pressure_memory=False), (["eps", "P"], "F")),
    "CarriedForce, from a source": (
        lambda s: CarriedForce(s["carried"], pressure_memory=False), (["eps", "P"], "F")
    ),
    "ConformalRegressor": (
        lambda s: ConformalRegressor(PolynomialForce(2), independent_rows=True, confidence=0.5), (["eps", "P"], "F")
    ),
    "CylinderForce": (lambda s: CylinderForce(still=0.05, signals={"dx": "deps"}), (["deps", "P"], "push")),
    "ForwardModel": (
        lambda s: ForwardModel(hidden=4, n_starts=1, random_state=0), (["P", "load"], ["load", "lift"])
    ),
    "FullFineTuning": (lambda s: FullFineTuning(s["force"], **ADAPT), FORCE),
    "GeometricFlow": (lambda s: GeometricFlow(), FLOW),
    "GeometricForce": (lambda s: GeometricForce("tondu_lopez", friction=True), (["eps", "deps", "P"], "F")),
    "HosovskyHybrid": (lambda s: HosovskyHybrid(max_iter=20), (["eps", "deps", "P"], "F")),
    "InverseModel": (lambda s: InverseModel(hidden=4, n_starts=1, random_state=0, on_unreachable="clip"),
                     (["F", "eps"], "P")),
    "InvertedForce": (lambda s: InvertedForce(GeometricForce(), on_unreachable="clip"), (["F", "eps"], "P")),
    "JointPIHM": (lambda s: JointPIHM(0.2, 0.02, **PIHM), (STATE, ["F", "mdot"])),
    "JointDrive": (
        lambda s: JointDrive(signals={"q": "eps", "dq": "deps", "ddq": "P"}), (["eps", "deps", "P"], "push")
    ),
    "LawRegressor": (lambda s: LawRegressor(), ([*STATE, "V", "V_eps", "V_P"], "F")),
    "LiftedLoad": (lambda s: LiftedLoad(start="rest"), SEQUENCE),
    "LinearStateSpace": (lambda s: LinearStateSpace(start="rest", order=1, block_rows=4), SEQUENCE),
    "LoRA": (lambda s: LoRA(s["force"], ranks=(3,), **ADAPT), FORCE),
    "MLP": (lambda s: MLP(("eps", "P"), **PLAIN), (["eps", "P"], "F")),
    "NNARX": (lambda s: NNARX(hidden=3, random_state=0, **LAGGED), SEQUENCE),
    "NonlinearElastic": (lambda s: NonlinearElastic(), (["eps", "P"], "F")),
    "OnlineAdapter": (lambda s: OnlineAdapter(s["force"]), FORCE),
    "PartialFineTuning": (lambda s: PartialFineTuning(s["force"], **ADAPT), FORCE),
    "PolynomialFlow": (lambda s: PolynomialFlow(), FLOW),
    "PolynomialForce": (lambda s: PolynomialForce(2, "surface"), (["eps", "P"], "F")),
    "PolynomialNARX": (lambda s: PolynomialNARX(degree=2, n_terms=6, **LAGGED), SEQUENCE),
    "QAdapter": (lambda s: QAdapter(s["force"], **ADAPT), FORCE),
    "RateTransformer": (lambda s: RateTransformer(("lift",)), (["trajectory", "time", "lift"], "lift")),
    "Recurrent": (lambda s: Recurrent(("P", "load"), random_state=0, **MEMORY), SEQUENCE),
    "ResidualHybrid": (lambda s: ResidualHybrid(hidden=4, n_starts=1, random_state=0), FORCE),
    "SINDyModel": (lambda s: SINDyModel(("lift",), ("P", "load"), degree=1, smoothing_window=1),
                   (["trajectory", "time", "lift", "P", "load"], None)),
    "SINDyRegressor": (lambda s: SINDyRegressor(), FORCE),
    "ScaleAdapter": (lambda s: ScaleAdapter(s["force"], random_state=0), FORCE),
    "StaticForceMap": (lambda s: StaticForceMap(), (["eps", "P"], "F")),
    "StaticPIHM": (lambda s: StaticPIHM(0.2, 0.02, **PIHM), FORCE),
    "StaticPIHM, adam": (
        lambda s: StaticPIHM(0.2, 0.02, trainer="adam", **PIHM | {"max_iter": 100}), FORCE
    ),
    "QAdapter, frozen": (lambda s: QAdapter(s["force"], base="frozen", random_state=0), FORCE),
    "ThermodynamicPIHM": (lambda s: ThermodynamicPIHM(0.2, 0.02, **PIHM), FLOW),
    "ThreeElement": (lambda s: ThreeElement(), FORCE),
    "TransferFunction": (lambda s: TransferFunction(n_poles=1, horizon=20, start="rest"), SEQUENCE),
}  # fmt: skip

LINEAR = {"CylinderForce", "JointDrive", "PolynomialForce", "PolynomialFlow", "SINDyModel", "SINDyRegressor"}
"""Sufficient statistics: exactly the fit of all batches, however many rows."""

FORGETTING = {"OnlineAdapter"}
"""What forgets by time, and promises no fit of all rows."""

EFFECTS = {"none": np.inf, "hysteresis": 0.03, "friction": 0.002, "drift": None}
"""What a stream in time order has, by the play of its bristles, that of none never pulls; a drift is 10 % from its
begin to its end."""
AT_LEAST = ("hysteresis", "drift")
"""What is told of estimators whose fits take long: a memory, and a change that no memory explains."""
ALL = LINEAR | {"GeometricForce", "InverseModel", "InvertedForce", "NonlinearElastic", "StaticForceMap"}
"""Of which all of them are told."""


def bristle(x: np.ndarray, play: float) -> np.ndarray:
    """Deflection of a bristle that slips, from −1 to 1."""
    out = np.zeros(len(x))
    for k in range(1, len(x)):
        out[k] = np.clip(out[k - 1] + (x[k] - x[k - 1]) / play, -1.0, 1.0)
    return out


def in_time(columns: list[str], seed: int, effect: str) -> pd.DataFrame:
    """Rows in the order of time, of a motion that grows: of a muscle, or of runs where these count."""
    rng, play = np.random.default_rng(seed), EFFECTS[effect]
    if {"load", "lift"} & set(columns):
        table = lifts(seed)
        lift, share = table["lift"].to_numpy(), table["trajectory"] / RUNS
        hung = [bristle(run["lift"].to_numpy(), 0.1 * (play or 1.0)) for _, run in table.groupby("trajectory")]
        return table.assign(lift=lift + 3e-3 * np.concatenate(hung) if play else lift * (1.0 + 0.1 * share))
    t = 0.05 * np.arange(ROWS)
    size, (a, b, c, d) = 0.3 + 0.7 * t / t[-1], rng.uniform(0.0, 2.0 * np.pi, 4)
    eps = 0.1 + size * (0.05 * np.sin(1.7 * t + a) + 0.04 * np.sin(4.3 * t + b))
    P = 3.7e5 + size * (1.4e5 * np.sin(1.1 * t + c) + 0.7e5 * np.sin(3.1 * t + d))
    table = of_state(pd.DataFrame({"eps": eps, "deps": np.gradient(eps, t), "P": P, "dP": np.gradient(P, t)}), rng)
    if play is None:
        return table.assign(**{name: table[name] * (1.0 + 0.1 * t / t[-1]) for name in ("push", "F", "mdot")})
    hung = bristle(eps, play)
    more = {"push": -60.0, "F": -60.0, "mdot": 0.1 * table["mdot"].std()}
    return table.assign(**{name: table[name] + size * hung for name, size in more.items()})


def test_every_estimator_streams():
    names = {name for name, _ in all_estimators()}
    assert names == {name.split(",")[0] for name in CASES} | {"GapDiagnoser"}
    assert [name for name, c in all_estimators() if not hasattr(c, "partial_fit")] == []


def of(case: str, sources):
    make, (columns, target) = CASES[case]
    return make(sources), columns, target


def given(table: pd.DataFrame, columns: list[str], target):
    y = None if target is None else table[target].to_numpy()
    return table[columns], y


def error(model, table: pd.DataFrame, columns: list[str], target) -> float:
    """Root mean square error on a table, in units of the targets' spread."""
    X, y = given(table, columns, target)
    if isinstance(model, RateTransformer):
        true = np.concatenate([np.gradient(run["lift"], run["time"]) for _, run in table.groupby("trajectory")])
        return float(np.std(model.transform(X)["dlift"] - true))
    if target is None:
        y = np.concatenate([np.gradient(run["lift"], run["time"]) for _, run in table.groupby("trajectory")])
    off = (np.asarray(model.predict(X)) - y) / np.std(y, axis=0)
    return float(np.sqrt(np.mean(off**2)))


def batches(table: pd.DataFrame, columns: list[str], seed: int | None, number: int = 10) -> list[pd.DataFrame]:
    """Batches of rows, or of whole runs where the order of time counts; shuffled, or as they come without a seed."""
    rows = "trajectory" not in columns
    order = np.arange(len(table) if rows else RUNS)
    parts = np.array_split(order if seed is None else np.random.default_rng(seed).permutation(order), number)
    return [table.iloc[part] if rows else table[table["trajectory"].isin(part)] for part in parts]


def streamed(model, parts, columns, target):
    """The model after all batches."""
    for part in parts:
        model.partial_fit(*given(part, columns, target))
    return model


@pytest.mark.parametrize("case", [c for c in CASES if c not in FORGETTING])
def test_a_stream_is_worth_a_fit(case, stream, sources):
    """Five shuffled batches reach 1.1 times the held-out error of a fit, and two more passes do no harm."""
    train, test, _, _ = stream
    model, columns, target = of(case, sources)
    whole = error(clone(model).fit(*given(train, columns, target)), test, columns, target)
    for passes, number in ((1, 5), (2, 1)):
        for k in range(passes):
            streamed(model, batches(train, columns, k + number, number), columns, target)
        assert error(model, test, columns, target) <= 1.1 * whole


@pytest.mark.parametrize("case", [c for c in CASES if c not in FORGETTING])
def test_the_order_of_time_takes_nothing_away(case, sources):
    """Whatever the stream has, row after row as they come: the fit of all rows, and no word of a change."""
    model, columns, target = of(case, sources)
    for effect in EFFECTS if case in ALL else AT_LEAST:
        train, test = in_time(columns, 0, effect), in_time(columns, 1, effect)
        with warnings.catch_warnings():
            warnings.simplefilter("error", StreamChangeWarning)
            late = streamed(clone(model), batches(train, columns, None, 3), columns, target)
        whole = clone(model).fit(*given(train, columns, target))
        for table in (train, test):
            wanted = error(whole, table, columns, target)
            assert error(late, table, columns, target) <= (1.0 + 1e-6 if case in LINEAR else 1.1) * wanted, effect


@pytest.mark.parametrize("case", ["GeometricForce", "MLP", "PolynomialForce", "QAdapter", "ThreeElement"])
def test_another_muscle_is_the_users_to_tell(case, stream, sources):
    """After another muscle the model is the fit of both; ``fit`` forgets the first."""
    train, _, other, test = stream
    model, columns, target = of(case, sources)
    streamed(model, [*batches(train, columns, 0), *batches(other, columns, 1)], columns, target)
    both = clone(model).fit(*given(pd.concat([train, other]), columns, target))
    assert error(model, test, columns, target) <= 1.1 * error(both, test, columns, target)
    best = error(clone(model).fit(*given(other, columns, target)), test, columns, target)
    assert error(model.fit(*given(other, columns, target)), test, columns, target) == pytest.approx(best)


@pytest.mark.parametrize("case", ["GeometricForce", "HosovskyHybrid", "QAdapter", "ResidualHybrid", "ThreeElement"])
def test_the_memory_is_a_fit_of_its_rows(case, stream, sources):
    """As long as all rows are remembered a refit is that of one fit on them, in their order."""
    train, test, _, _ = stream
    model, columns, target = of(case, sources)
    streamed(model, (train[start : start + 100] for start in range(0, len(train), 100)), columns, target)
    whole = clone(model).fit(*given(train, columns, target))
    np.testing.assert_allclose(model.predict(test[columns]), whole.predict(test[columns]), rtol=1e-6)


def test_memory_does_not_grow(stream):
    """Beyond the bound a fair sample stands for the stream: weights add up to all rows, errors stay those of a fit."""
    model = GeometricForce()
    model._memory_rows = 150
    tables = [muscle(seed) for seed in range(10, 16)]
    with warnings.catch_warnings():
        warnings.simplefilter("error", StreamChangeWarning)
        for table in tables:
            model.partial_fit(table[["eps", "P"]], table["F"])
    held = model._recalled()
    assert len(held) == 150
    assert held.weight.sum() == pytest.approx(sum(map(len, tables)))
    whole = GeometricForce().fit(*given(pd.concat(tables), ["eps", "P"], "F"))
    test = muscle(1)
    assert error(model, test, ["eps", "P"], "F") < 1.1 * error(whole, test, ["eps", "P"], "F")
    narx = PolynomialNARX(degree=2, n_terms=6, **LAGGED)
    narx._memory_rows = 5 * STEPS + 3
    for seed in range(3):
        narx.partial_fit(*given(lifts(seed), *SEQUENCE))
    sizes = np.unique(narx._recalled().unit, return_counts=True)[1]
    assert list(sizes) == [STEPS] * 5, "whole trajectories stay"


def test_a_diagnosis_is_that_of_all_logs():
    """A second log of the same test rig joins the first one; the same log again changes nothing."""
    t = np.arange(0.0, 4.0, 0.005)
    rng = np.random.default_rng(0)

    def log(frequencies):
        rows = [
            pd.DataFrame(
                {"trajectory": w, "time": t, "eps": 0.1 + 0.05 * np.sin(w * t), "deps": 0.05 * w * np.cos(w * t)}
            )
            for w in frequencies
        ]
        table = pd.concat(rows, ignore_index=True)
        return table, -30.0 * table["deps"] + 0.2 * rng.standard_normal(len(table))

    library = ("viscous_friction", "bladder_elasticity", "force_bias")
    (X, y), (Z, w) = log([2.0, 4.0]), log([7.0, 9.0])
    stream = GapDiagnoser(effects=library, random_state=0).partial_fit(X, y)
    stream.partial_fit(Z, w)
    whole = GapDiagnoser(effects=library, random_state=0).fit(pd.concat([X, Z], ignore_index=True), pd.concat([y, w]))
    assert stream.verdict_ == whole.verdict_ == "cause"
    assert stream.effects_ == whole.effects_
    kept = stream.findings_
    assert stream.partial_fit(Z, w).findings_ is kept


@pytest.mark.parametrize(
    "case",
    ["FullFineTuning", "JointPIHM", "LoRA", "PartialFineTuning", "QAdapter", "StaticPIHM", "StaticPIHM, adam"],
)
@pytest.mark.parametrize("grouped", [False, True], ids=["no groups", "groups"])
def test_a_weight_is_a_repetition(case, grouped, rows, sources):
    """A weight of 2 is the same row twice, and one of 0 none, to the last bit."""
    train, test, _, _ = rows
    model, columns, target = of(case, sources)
    weight = np.random.default_rng(0).integers(0, 4, len(train))
    many = np.repeat(np.arange(len(train)), weight)
    groups = np.arange(len(train)) // 40 if grouped else None
    X, y = given(train, columns, target)
    weighted = clone(model).fit(X, y, sample_weight=weight.astype(float), groups=groups)
    repeated = clone(model).fit(X.iloc[many], y[many], groups=groups[many] if grouped else None)
    np.testing.assert_array_equal(weighted.predict(test[columns]), repeated.predict(test[columns]))
