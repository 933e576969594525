"""Parameters of estimators as annotated fields, and docstrings that say what is shared once.

``@parameters`` makes a class a dataclass whose fields are the parameters of its constructor. A parameter, a fitted
attribute, or an argument of a method that its own docstring leaves out is explained by the nearest base that has an
entry for it, those of common methods by `Methods`; ``default=`` follows from the signature. ``help()`` and the site
show the whole.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar, dataclass_transform

ORDER = (
    "Parameters", "Attributes", "Methods", "Returns", "Yields", "Raises", "Warns", "Warnings", "See Also", "Notes",
    "References", "Examples",
)  # fmt: skip
"""Sections of a docstring, as numpydoc orders them."""

T = TypeVar("T")


class Methods:
    """What methods of the same name have in common; never made."""

    def fit(self, X: Any, y: Any, sample_weight: Any, groups: Any) -> Any:
        """Fit.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            Signals, SI units, absolute pressure.
        y : array_like, shape (n_samples,)
            Target, SI units.
        sample_weight : array_like, shape (n_samples,)
            Weights; a weight of 2 is the same row twice.
        groups : array_like, shape (n_samples,)
            Run of each row; a column ``trajectory`` of a DataFrame serves too.

        Returns
        -------
        self
            The fitted estimator.
        """

    partial_fit = fit

    def predict(self, X: Any, groups: Any) -> Any:
        """Predict.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            The signals that the fit read, SI units, absolute pressure.
        groups : array_like, shape (n_samples,)
            Run of each row; a column ``trajectory`` of a DataFrame serves too.

        Returns
        -------
        ndarray, shape (n_samples,)
            Prediction in the unit of y.
        """

    transform = assess = simulate = volume = predict_interval = predict

    def formulas(self, signals: Any) -> Any:
        """Return formulas.

        Parameters
        ----------
        signals : mapping of str to array or symbol
            Each signal that the model reads, SI units.

        Returns
        -------
        dict of str to (str, array or symbol)
            Unit and value of each output.
        """


@dataclass_transform(eq_default=False, field_specifiers=(field,))
def parameters(cls: type[T]) -> type[T]:
    """Make the annotated fields of a class and of its bases the parameters of its constructor, and explain them.

    Keyword parameters that the class itself adds come before those of its bases.
    """
    made: type[T] = dataclass(eq=False, repr=False)(cls)
    owner = {name: depth for depth, base in enumerate(made.__mro__) for name in _own_fields(base)}
    start: Any = made.__init__
    signature = inspect.signature(start)
    order = sorted(signature.parameters.values(), key=lambda p: (p.kind, owner[p.name] if p.kind > 1 else 0))
    start.__signature__ = signature.replace(parameters=order)
    explain(made)
    return made


def explain(cls: type) -> None:
    """Complete the docstring of a class from those of its bases."""
    doc, bases = _Docstring(cls.__doc__), [_Docstring(base.__doc__) for base in _bases(cls)]
    doc.take("Parameters", bases, list(inspect.signature(cls).parameters.values()))
    doc.take("Attributes", bases)
    cls.__doc__ = str(doc)


def explain_methods(cls: type) -> None:
    """Complete the docstrings of the methods of a class from those of its bases and of its fit."""
    for name, method in vars(cls).items():
        if name.startswith("_") or not inspect.isfunction(method) or method.__doc__ is None:
            continue
        same = [_Docstring(vars(c)[name].__doc__) for c in (*_bases(cls), Methods) if name in vars(c)]
        fits = [_Docstring(c.fit.__doc__) for c in (cls, Methods) if hasattr(c, "fit")]
        doc = _Docstring(method.__doc__)
        doc.take("Parameters", [*same, *fits], list(inspect.signature(method).parameters.values())[1:])
        if "Returns" not in doc.sections and (told := [d.sections["Returns"] for d in same if "Returns" in d.sections]):
            doc.sections["Returns"] = told[0]
        method.__doc__ = str(doc)


def _bases(cls: type) -> list[type]:
    """Return the bases of a class, those of other libraries left out."""
    return [base for base in cls.__mro__[1:] if base.__module__.partition(".")[0] not in ("sklearn", "builtins")]


def _own_fields(cls: type) -> Iterable[str]:
    """Return the parameters that a class declares itself."""
    known = cls.__dict__.get("__dataclass_fields__", {})
    return [name for name in inspect.get_annotations(cls) if name in known and known[name].init]


class _Docstring:
    """A docstring as its sections, and the entries of these."""

    def __init__(self, text: str | None) -> None:
        self.head, *parts = re.split(r"\n\n(?=[A-Z][\w ]+\n-{3,}\n)", inspect.cleandoc(text or ""))
        self.sections = {title: body for title, _, body in (part.split("\n", 2) for part in parts)}

    def __str__(self) -> str:
        titles = sorted(self.sections, key=ORDER.index)
        parts = [f"{title}\n{'-' * len(title)}\n{self.sections[title]}" for title in titles]
        return "\n\n".join([self.head, *parts])

    def entries(self, section: str) -> list[str]:
        """Return the entries of a section, each with the lines below it."""
        return re.split(r"\n(?=\S)", self.sections[section]) if section in self.sections else []

    def take(
        self, section: str, others: Sequence[_Docstring], wanted: Sequence[inspect.Parameter] | None = None
    ) -> None:
        """Add entries of others for what has none here: for the parameters wanted in their order, or for all."""
        own = {name: entry for entry in self.entries(section) for name in _names(entry)}
        known = dict(own)
        for entry in (entry for other in others for entry in other.entries(section)):
            known |= {name: entry for name in _names(entry) if name not in known}
        if wanted is not None:
            told = {p.name: _with_default(known[p.name], p) for p in wanted if p.name in known}
            # Those of its own stand as they are; what explains the parameters of subclasses alone comes last.
            known = {name: own.get(name, entry) for name, entry in told.items()} | own
        if known:
            self.sections[section] = "\n".join(dict.fromkeys(known.values()))


def _names(entry: str) -> list[str]:
    return [name.strip() for name in entry.partition("\n")[0].partition(" : ")[0].split(",")]


def _with_default(entry: str, parameter: inspect.Parameter) -> str:
    """Return an entry of a base with the default that its parameter has here."""
    head, _, text = entry.partition("\n")
    if " : " not in head or "optional" in head or parameter.default is parameter.empty:
        return entry
    value, head = parameter.default, re.sub(", default=.*", "", head)
    shown = f"{value:.10g}".replace("e-0", "e-") if isinstance(value, float) else repr(value).replace("'", '"')
    return f"{head}, {'optional' if value is None else f'default={shown}'}\n{text}"
