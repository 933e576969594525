"""Parameters as fields: the signature that they give, and docstrings that take from bases what they leave out."""

from __future__ import annotations

import inspect
from dataclasses import KW_ONLY, dataclass, field, fields
from typing import Annotated, Any, NamedTuple

from pamid.estimators import InverseModel, PolynomialForce, StaticPIHM
from pamid.estimators._base import SignalRegressor
from pamid.estimators._parameters import parameters
from sklearn.base import clone

from pamid.explained import explained_by, explained_fields


@parameters
class Base(SignalRegressor):
    """A base.

    Parameters
    ----------
    size : float
        Size, m.
    only_below : int
        Number that subclasses take.

    Attributes
    ----------
    found_ : float
        What it found, m.

    See Also
    --------
    MLP : A network.
    """

    reads = ("a", "b")
    _checked = ({}, {"steps": 7})

    size: float = 1.0
    _: KW_ONLY
    steps: int = 3

    def fit(self, X: Any, y: Any, groups: Any = None) -> Base:
        """Fit.

        Parameters
        ----------
        y : array_like, shape (n_samples,)
            Length, m.
        """
        return self

    def simulate(self, X: Any, y: Any) -> Any:
        """Simulate."""


@parameters
class Below(Base):
    """A subclass.

    Parameters
    ----------
    steps : int, default=5
        Its own words.
    """

    _: KW_ONLY
    only_below: int | None = None
    steps: int = 5


def test_positions_first_then_own_keywords_then_those_of_bases():
    signature = inspect.signature(Below)
    assert [*signature.parameters] == ["size", "only_below", "steps", "signals"]
    assert signature.parameters["steps"].default == 5 and signature.parameters["size"].default == 1.0
    assert Below(2.0, steps=7).get_params() == {"size": 2.0, "only_below": None, "steps": 7, "signals": None}
    assert clone(Below(2.0)).size == 2.0
    assert vars(Below()) == {"size": 1.0, "only_below": None, "steps": 5, "signals": None}


def test_a_docstring_takes_from_its_bases_what_it_leaves_out():
    doc = inspect.getdoc(Below)
    assert "size : float, default=1\n    Size, m." in doc
    assert "only_below : int, optional\n    Number that subclasses take." in doc
    assert "steps : int, default=5\n    Its own words." in doc
    assert doc.index("size :") < doc.index("only_below :") < doc.index("steps :") < doc.index("signals :")
    assert doc.index("found_ :") < doc.index("n_features_in_ :")
    fit = inspect.getdoc(Below.fit)
    assert "Length, m." in fit and "X : DataFrame" in fit and "groups : array_like, shape (n_samples,), optional" in fit
    assert fit.endswith("self\n    The fitted estimator.")
    assert doc.endswith("See Also\n--------\nMLP : A network.")


def test_what_a_fit_says_of_its_own_holds_for_the_other_methods():
    doc = inspect.getdoc(Base.simulate)
    assert "Length, m." in doc
    assert "The signals that the fit read" in doc and "    Signals, SI units" not in doc
    assert doc.endswith("Prediction in the unit of y.")


def test_checked_instances_read_one_column_for_all_signals():
    made = Below._checked_instances()
    assert [type(m) for m in made] == [Below, Below] and [m.steps for m in made] == [5, 7]
    assert made[0].signals == {"a": 0, "b": 0}


def test_a_default_is_that_of_the_class():
    assert "hidden : int, default=20" in inspect.getdoc(InverseModel)
    assert '"auto"' not in str(inspect.signature(StaticPIHM).parameters["validation_fraction"].default)


def test_runs_are_requested_by_what_takes_them():
    assert Below()._get_metadata_request().fit.requests == {"groups": True}
    assert PolynomialForce()._get_metadata_request().partial_fit.requests["groups"] is True


def test_a_function_takes_what_others_explain():
    def first(size, speed=1.0):
        """Move.

        Parameters
        ----------
        size : float
            Its size, m.
        speed : float, default=1
            Its speed, m/s.
        """

    @explained_by(first)
    def second(speed=2.0, size=0.5, colour=None):
        """Move again.

        Parameters
        ----------
        size : float
            Its size at rest, m.
        """

    assert second.__doc__.splitlines()[4:] == [
        "speed : float, default=2", "    Its speed, m/s.", "size : float", "    Its size at rest, m."
    ]  # fmt: skip


@explained_fields
@dataclass(frozen=True)
class Stretch:
    """A stretch of time."""

    begins: Annotated[float, "Its ends, s."]
    ends: Annotated[float, "Its ends, s."]
    name: Annotated[str, "What it is called."] = ""
    parts: Annotated[list[float], "Where it is cut, s."] = field(default_factory=list)


@dataclass(frozen=True)
class NamedStretch(Stretch):
    """A stretch with a number."""

    number: int = 0


@explained_fields
class Pair(NamedTuple):
    """Two numbers.

    Parameters
    ----------
    first : float
        Told here.
    """

    first: float
    second: Annotated[float, "Told beside the type."] = 1.0


def test_a_record_explains_its_fields_beside_their_types():
    said = [line for line in inspect.getdoc(Stretch).splitlines() if " : " in line]
    assert said == ["begins, ends : float", 'name : str, default=""', "parts : list[float], optional"]
    assert [line for line in inspect.getdoc(Pair).splitlines() if " : " in line] == [
        "first : float",
        "second : float, default=1",
    ]
    for record in (Stretch, NamedStretch, Pair):
        assert "Annotated" not in str(inspect.signature(record))
    assert all("Annotated" not in str(f.type) for f in fields(NamedStretch))
    assert Pair(2.0) == (2.0, 1.0) and Stretch(0.0, 1.0).parts == []
