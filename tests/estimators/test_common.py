"""What holds for every public estimator and transformer, without naming any of them."""

from __future__ import annotations

import ast
import copy
import functools
import hashlib
import inspect
import os
import pickle
import random
import subprocess
import sys
import warnings
from collections.abc import Iterable
from pathlib import Path
from unittest import SkipTest

import numpy as np
import pamid.estimators
import pandas as pd
import pytest
import sklearn
from pamid.estimators import RateTransformer, all_estimators, checked_instances
from sklearn.base import BaseEstimator, TransformerMixin, clone
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, GroupKFold, cross_validate
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn.utils import get_tags
from sklearn.utils.estimator_checks import check_regressors_train, estimator_checks_generator
from sklearn.utils.fixes import parse_version

from pamid.errors import MissingTrajectoryError, ParameterError, ShortTrajectoryError

INSTANCES = checked_instances()
pytestmark = pytest.mark.filterwarnings(
    "ignore::pamid.errors.PamidWarning", "ignore::sklearn.exceptions.ConvergenceWarning"
)


def name_of(estimator: BaseEstimator) -> str:
    return type(estimator).__name__


each_instance = pytest.mark.parametrize("estimator", INSTANCES, ids=name_of)


def takes(estimator: BaseEstimator, method: str, argument: str) -> bool:
    return hasattr(estimator, method) and argument in inspect.signature(getattr(estimator, method)).parameters


GROUPED = [e for e in INSTANCES if takes(e, "fit", "groups")]
OF_EACH_KIND = list(
    {
        tuple(takes(e, m, "groups") for m in ("partial_fit", "predict", "transform", "score")): e for e in GROUPED
    }.values()
)
"""One instance of each set of methods that take groups: what scikit-learn does with them depends on no more."""
each_grouped_instance = pytest.mark.parametrize("estimator", GROUPED, ids=name_of)


def values():
    """Four trajectories of twelve rows: a table without names, a target, and the trajectory of each row."""
    rng = np.random.default_rng(3)
    X = rng.uniform(0.2, 1.0, (48, 3))
    return X, 2.0 + X[:, 0] + 0.1 * rng.standard_normal(48), np.repeat(np.arange(4), 12)


@pytest.fixture(scope="module")
def data():
    """The values, which no fit and no prediction changes: test_input_untouched."""
    return values()


def with_trajectory(X: np.ndarray, groups: np.ndarray) -> pd.DataFrame:
    """Name the trajectory of each row in a column, where routing does not bring it."""
    return pd.DataFrame(X, columns=["a", "b", "c"]).assign(trajectory=[f"run {g}" for g in groups])


def seeded(estimator: BaseEstimator) -> BaseEstimator:
    estimator = clone(estimator)
    return estimator.set_params(random_state=7) if "random_state" in estimator.get_params() else estimator


def needing_trajectories(estimator: BaseEstimator) -> BaseEstimator:
    """Take back an instance's word that all rows are one trajectory, so that it fails if nothing tells."""
    estimator = seeded(estimator)
    if "one_trajectory" in estimator.get_params():
        estimator.set_params(one_trajectory=False)
    return estimator


@pytest.fixture(scope="module")
def kept(data):
    """The fits of all instances, each made once; what it gives is not to be changed."""

    return functools.cache(lambda place: fitted(INSTANCES[place], data))


def fitted(estimator: BaseEstimator, data) -> BaseEstimator:
    X, y, groups = data
    estimator = seeded(estimator)
    return estimator.fit(X, y, groups=groups) if takes(estimator, "fit", "groups") else estimator.fit(X, y)


def outputs(estimator: BaseEstimator, data) -> dict[str, np.ndarray]:
    X, _, groups = data
    return {
        method: np.asarray(
            getattr(estimator, method)(X, **({"groups": groups} if takes(estimator, method, "groups") else {}))
        )
        for method in ("predict", "transform")
        if hasattr(estimator, method)
    }


def assert_same_outputs(one: BaseEstimator, other: BaseEstimator, data) -> None:
    ours, theirs = outputs(one, data), outputs(other, data)
    assert ours, "nothing to compare"
    for method, result in ours.items():
        np.testing.assert_allclose(theirs[method], result, rtol=1e-9, atol=1e-12)


def _check_name(check) -> str:
    if not isinstance(check, functools.partial):
        return check.__name__
    return "-".join([check.func.__name__, *(f"{k}={v}" for k, v in check.keywords.items())])


# --- the contract of scikit-learn -----------------------------------------------------------------------------
SKIPPED = {
    (
        "RateTransformer",
        name,
    ): "a rate depends on the rows around it: test_rates_pass_all_checks_but_those_of_single_rows"
    for name in ("check_pipeline_consistency", "check_transformer_data_not_an_array", "check_transformer_general")
}
"""Checks of scikit-learn that an estimator's own tags skip, by class and check, and where they are run instead."""


def offences(checks) -> list[str]:
    """Checks that an estimator fails; a skip that is not in the list is one, and so is a place there without need."""
    found = []
    for estimator, check in checks:
        name = _check_name(check)
        reason = SKIPPED.get((name_of(estimator), name.partition("-")[0]))
        try:
            check(estimator)
        except SkipTest as skipped:
            found += [] if reason else [f"skips {name}: {skipped}"]
        except Exception as error:
            found.append(f"fails {name}: {type(error).__name__}: {error}")
        else:
            found += [f"passes {name}: its place in the list is needless"] if reason else []
    return found


@each_instance
def test_scikit_learn_contract(estimator):
    found = offences(estimator_checks_generator(estimator))
    assert not found, "\n".join(found)


def test_a_check_that_fails_is_found():
    class Rude(Ridge):
        def fit(self, X, y):
            self.seen = True
            return super().fit(X, y)

    checks = [(e, c) for e, c in estimator_checks_generator(Rude()) if "overwrite" in _check_name(c)]
    assert [text.split()[0] for text in offences(checks)] == ["fails"]


ROUTED = ("fit_returns_self", "sample_weight", "pipeline", "get_params", "partial_fit", "metadata")
"""Words of the checks that metadata can change: what routes none of it does the same under either setting."""


@pytest.mark.slow
@pytest.mark.parametrize("estimator", {name_of(e): e for e in reversed(GROUPED)}.values(), ids=name_of)
def test_scikit_learn_contract_with_routing(estimator):
    """Routing reads what a class requests: one instance of each is enough."""
    checks = [c for _, c in estimator_checks_generator(estimator) if any(word in _check_name(c) for word in ROUTED)]
    with sklearn.config_context(enable_metadata_routing=True):
        found = offences((clone(estimator), check) for check in checks)
    assert not found, "\n".join(found)


def test_array_api_is_checked_not_skipped():
    """The check that scikit-learn leaves out without SCIPY_ARRAY_API is among those that run."""
    assert os.environ["SCIPY_ARRAY_API"] == "1"
    if parse_version(sklearn.__version__) < parse_version("1.9"):
        pytest.skip("scikit-learn asks it of every estimator from 1.9 on")
    for estimator in INSTANCES:
        names = [_check_name(check) for _, check in estimator_checks_generator(estimator)]
        assert any("check_array_api_input" in name for name in names), name_of(estimator)


class _Steady(RateTransformer):
    """A transformer of rates without the tag that leaves out more checks than rows in time order call for."""

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.non_deterministic = False
        return tags


STEADY = [
    (e, c)
    for own in RateTransformer._checked_instances()
    for e, c in estimator_checks_generator(_Steady(**own.get_params()))
]
ROW_BY_ROW = ("check_methods_sample_order_invariance", "check_methods_subset_invariance")
"""Checks that transform shuffled and single rows."""


def test_rates_pass_all_checks_but_those_of_single_rows():
    found = offences((clone(e), c) for e, c in STEADY if _check_name(c) not in ROW_BY_ROW)
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    ("estimator", "check"),
    [(e, c) for e, c in STEADY if _check_name(c) in ROW_BY_ROW],
    ids=lambda value: name_of(value) if isinstance(value, BaseEstimator) else _check_name(value),
)
def test_rates_need_the_tag_that_leaves_them_out(estimator, check):
    """Both fail without the tag, so that the tag is needed."""
    with pytest.raises((AssertionError, ShortTrajectoryError)):
        check(clone(estimator))


@pytest.mark.slow
@pytest.mark.parametrize(
    "estimator", [e for e in INSTANCES if (r := get_tags(e).regressor_tags) is not None and r.poor_score], ids=name_of
)
def test_a_poor_score_is_not_claimed_without_need(estimator):
    """What says that it fits scikit-learn's data poorly does so: the check of its score fails without the tag."""
    kind = type(estimator)

    class Scored(kind):
        def __sklearn_tags__(self):
            tags = super().__sklearn_tags__()
            tags.regressor_tags.poor_score = False
            return tags

    Scored.__name__ = kind.__name__
    with pytest.raises(AssertionError):
        check_regressors_train(kind.__name__, Scored(**estimator.get_params(deep=False)))


def test_every_tag_that_leaves_something_out_is_known():
    """No estimator asks for fewer checks but by the two tags above, and by a target that it may do without."""
    for estimator in INSTANCES:
        tags = get_tags(estimator)
        assert not tags._skip_test and not tags.no_validation and tags.requires_fit, name_of(estimator)
        assert tags.input_tags.two_d_array and not tags.input_tags.positive_only, name_of(estimator)
        assert tags.non_deterministic == isinstance(estimator, RateTransformer), name_of(estimator)


# --- discovery ------------------------------------------------------------------------------------------------
def test_every_estimator_of_the_folder_is_found():
    """A class in a public module that can be fitted is listed, whatever its bases say in the source."""
    folder = Path(pamid.estimators.__file__).parent
    with_fit = {
        node.name
        for path in folder.glob("[!_]*.py")
        for node in ast.parse(path.read_text("utf-8")).body
        if isinstance(node, ast.ClassDef)
        and not node.name.startswith("_")
        and any(isinstance(f, ast.FunctionDef) and f.name == "fit" for f in node.body)
    }
    names = [name for name, _ in all_estimators()]
    assert names == sorted(set(names))
    assert with_fit <= set(names)
    assert {"SINDyModel", "SINDyRegressor"} <= set(names)


def test_every_estimator_is_checked():
    assert {name for name, _ in all_estimators()} == {name_of(e) for e in INSTANCES}


def test_attributes_of_the_package():
    known = dict(all_estimators())
    assert {name: getattr(pamid.estimators, name) for name in known} == known
    assert known.keys() <= set(dir(pamid.estimators))


def test_unknown_attribute():
    with pytest.raises(AttributeError, match="NoSuchModel"):
        _ = pamid.estimators.NoSuchModel


def test_imports_stay_light():
    """Neither the package nor the class of a network loads torch or PySINDy before a fit."""
    code = (
        "import sys, pamid, pamid.estimators as e; assert 'sklearn' not in sys.modules; e.all_estimators();"
        "loaded = {'torch', 'pysindy', 'matplotlib'} & set(sys.modules); assert not loaded, loaded"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def digests(models: Iterable[BaseEstimator] | None = None) -> list[str]:
    """What each instance with a seed predicts or transforms to, to the last bit; of models that are fitted already."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = [outputs(model, values()) for model in models or (fitted(e, values()) for e in INSTANCES)]
    return [hashlib.sha256(b"".join(a.tobytes() for a in one.values())).hexdigest() for one in found]


def test_a_seed_gives_the_same_numbers_in_every_process(kept):
    """Whatever the order of sets is in a process, and what was fitted before."""
    folder = str(Path(__file__).parent)
    code = f"import sys; sys.path.insert(0, {folder!r}); import test_common; print(*test_common.digests())"
    ours = {**os.environ, "PYTHONHASHSEED": "7"}
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, env=ours)
    assert done.returncode == 0, done.stderr
    names = [name_of(e) for e in INSTANCES]
    pairs = zip(names, digests(map(kept, range(len(INSTANCES)))), done.stdout.split(), strict=True)
    assert not [name for name, here, there in pairs if here != there]


# --- trajectories ---------------------------------------------------------------------------------------------
def scored(estimator: BaseEstimator) -> BaseEstimator:
    """Put an estimator in a pipeline that scores: as the last step, or before a regression."""
    if hasattr(estimator, "score"):
        return make_pipeline(FunctionTransformer(), estimator)
    return make_pipeline(estimator, FunctionTransformer(numbers_only), Ridge())


def numbers_only(X):
    """Leave out the names of trajectories, which a transformer hands on and a plain regression cannot read."""
    return X.select_dtypes("number") if isinstance(X, pd.DataFrame) else X


@pytest.fixture
def groups_seen(monkeypatch):
    """Record, for every call of an estimator's fit, how many trajectories it is told of."""
    seen: list[int] = []

    def spy_on(estimator: BaseEstimator) -> list[int]:
        original = type(estimator).fit

        @functools.wraps(original)
        def fit(self, *args, **kwargs):
            groups = inspect.signature(original).bind(self, *args, **kwargs).arguments.get("groups")
            seen.append(0 if groups is None else len(np.unique(groups)))
            return original(self, *args, **kwargs)

        monkeypatch.setattr(type(estimator), "fit", fit)
        return seen

    return spy_on


@each_grouped_instance
def test_groups_with_routing(estimator, data, groups_seen):
    """With routing on, each fold's fit is told its trajectories; no request has to be set by the user."""
    X, y, groups = data
    model = scored(needing_trajectories(estimator))
    seen = groups_seen(estimator)
    if takes(estimator, "transform", "groups") and parse_version(sklearn.__version__) < parse_version("1.8"):
        # There a pipeline is scored without what its steps ask for; the estimator says what it lacks.
        with (
            sklearn.config_context(enable_metadata_routing=True),
            pytest.raises(MissingTrajectoryError, match="trajectory' column"),
        ):
            cross_validate(model, X, y, cv=GroupKFold(2), params={"groups": groups}, error_score="raise")
        return
    with sklearn.config_context(enable_metadata_routing=True):
        search = GridSearchCV(model, {}, cv=GroupKFold(2), error_score="raise").fit(X, y, groups=groups)
        assert seen == [2, 2, 4]
        assert np.isfinite(search.best_score_)
        if estimator in OF_EACH_KIND:
            scores = cross_validate(model, X, y, cv=GroupKFold(2), params={"groups": groups}, error_score="raise")
            assert np.isfinite(scores["test_score"]).all()
            assert seen == [2, 2, 4, 2, 2]


def test_groups_are_requested_by_default():
    """Every method that takes groups asks for them without a word of the user."""
    methods = ("fit", "partial_fit", "predict", "transform", "score")
    with sklearn.config_context(enable_metadata_routing=True):
        requests = [(e, m, e.get_metadata_routing()) for e in GROUPED for m in methods if takes(e, m, "groups")]
    missing = [f"{name_of(e)}.{m}" for e, m, asked in requests if getattr(asked, m).requests["groups"] is not True]
    assert missing == []


@each_grouped_instance
def test_trajectory_column_without_routing(estimator, data):
    """With routing off the splitter alone reads groups; a trajectory column reaches the estimator all the same."""
    X, y, groups = data
    table = with_trajectory(X, groups)
    model = scored(needing_trajectories(estimator))
    search = GridSearchCV(model, {}, cv=GroupKFold(2), error_score="raise").fit(table, y, groups=groups)
    assert np.isfinite(search.best_score_)
    if estimator in OF_EACH_KIND:
        scores = cross_validate(model, table, y, groups=groups, cv=GroupKFold(2), error_score="raise")
        assert np.isfinite(scores["test_score"]).all()


@each_grouped_instance
def test_column_and_groups_agree(estimator, data):
    """A trajectory column and groups say the same thing to an estimator."""
    X, y, groups = data
    by_groups = needing_trajectories(estimator).fit(pd.DataFrame(X, columns=["a", "b", "c"]), y, groups=groups)
    by_column = needing_trajectories(estimator).fit(with_trajectory(X, groups), y)
    for method in ("predict", "transform"):
        if hasattr(estimator, method):
            told = {"groups": groups} if takes(estimator, method, "groups") else {}
            one = np.asarray(numbers_only(getattr(by_groups, method)(pd.DataFrame(X, columns=list("abc")), **told)))
            other = np.asarray(numbers_only(getattr(by_column, method)(with_trajectory(X, groups))))
            np.testing.assert_allclose(other[:, : one.shape[1]] if one.ndim == 2 else other, one)


# --- copies, seeds, side effects ------------------------------------------------------------------------------
@each_instance
def test_copies(estimator, data, kept):
    """A fitted estimator survives pickle and deepcopy with the same predictions; a clone fits to the same."""
    model = kept(INSTANCES.index(estimator))
    assert_same_outputs(model, pickle.loads(pickle.dumps(model)), data)
    assert_same_outputs(model, copy.deepcopy(model), data)
    assert_same_outputs(model, fitted(clone(model), data), data)


@each_instance
def test_fitted_state_is_plain(estimator, kept):
    """What fit sets is numpy, containers and plain Python, so that it can be stored without pickle."""

    def assert_plain(value, where: str) -> None:
        if isinstance(value, dict):
            for key, entry in value.items():
                assert_plain(entry, f"{where}[{key!r}]")
        elif isinstance(value, (list, tuple)):
            for entry in value:
                assert_plain(entry, f"{where}[...]")
        elif isinstance(value, BaseEstimator):
            for name in vars(value):
                assert_plain(vars(value)[name], f"{where}.{name}")
        else:
            module = type(value).__module__.partition(".")[0]
            assert module not in {"torch", "pysindy", "filterpy", "pandas"}, f"{where} is a {type(value)}"
            assert not inspect.isroutine(value), f"{where} is a {type(value)}"

    model = kept(INSTANCES.index(estimator))
    for name, value in vars(model).items():
        if name.endswith("_"):
            assert_plain(value, name)


@each_instance
def test_random_state(estimator, data, kept):
    """A seed gives the same model again, and no fit touches the global generators."""
    import torch

    before = (random.getstate(), np.random.get_state()[1].copy(), torch.get_rng_state().clone())  # noqa: NPY002
    assert_same_outputs(kept(INSTANCES.index(estimator)), fitted(estimator, data), data)
    assert random.getstate() == before[0]
    assert np.array_equal(np.random.get_state()[1], before[1])  # noqa: NPY002
    assert torch.equal(torch.get_rng_state(), before[2])


@each_instance
def test_input_untouched(estimator):
    """Neither fit nor predict alters what it is given, as an array or as a table."""
    X, y, groups = given = values()
    table, before = with_trajectory(X, groups), values()
    model = fitted(estimator, given)
    outputs(model, given)
    clone(estimator).fit(table, y)
    for now, then in zip(given, before, strict=True):
        np.testing.assert_array_equal(now, then)
    pd.testing.assert_frame_equal(table, with_trajectory(before[0], before[2]))


@each_instance
def test_parameters_survive_fit(estimator, kept):
    before = copy.deepcopy(seeded(estimator).get_params(deep=False))
    model = kept(INSTANCES.index(estimator))
    assert repr(model.get_params(deep=False)) == repr(before)


@each_instance
def test_html_representation(estimator, kept):
    model = kept(INSTANCES.index(estimator))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert name_of(estimator) in model._repr_html_()


@pytest.mark.parametrize("estimator", [e for e in INSTANCES if not isinstance(e, TransformerMixin)], ids=name_of)
def test_a_target_whose_square_overflows_is_refused(estimator):
    X = np.random.default_rng(0).uniform(0.1, 1.0, size=(40, 3))
    y = X @ [1.0, 2.0, 3.0]
    y[7] = 1e200
    with pytest.raises(ParameterError, match=r"y reaches 1e\+200"):
        clone(estimator).fit(X, y)
