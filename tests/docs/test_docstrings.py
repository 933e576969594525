"""Every public object is documented in numpydoc, with units, and its examples run."""

from __future__ import annotations

import doctest
import enum
import importlib
import inspect
import pkgutil
import re
from functools import cache

import pytest
from numpydoc.docscrape import NumpyDocString
from numpydoc.validate import validate
from pamid.estimators import all_estimators

import pamid

# Not asked for, each for a reason:
#   GL01, GL02  where the quotes stand is ruff's matter
#   GL09        there are no deprecations in a first version
#   SS05        its rule (no first word that ends in s) refuses "Pneumatics", "Gas", ...
#   SS06, ES01  a summary may run over two lines and need no second paragraph
#   PR08, RT04  a description may begin with the symbol of its quantity (γ, r, ε₀), which is no capital letter
#   SA01, SA04  links are given where they help
#   EX01        examples are asked of what a user meets, below, and run
CODES = {
    "GL03", "GL05", "GL06", "GL07", "GL08", "GL10",
    "SS01", "SS02", "SS03", "SS04",
    "PR02", "PR03", "PR04", "PR05", "PR06", "PR07", "PR09", "PR10",
    "RT02", "RT03", "RT05",
    "SA02", "SA03",
}  # fmt: skip
# Asked of what a room shows at its door (the names its package exports) and of every estimator; a helper behind the
# door, or a method that a base has explained, may do with one line where names and types are plain.
COMPLETE = {"PR01", "RT01", "YD01"}


@cache
def public_modules() -> list[str]:
    names = [m.name for m in pkgutil.walk_packages(pamid.__path__, "pamid.")]
    if "pamid.estimators" not in names:  # a checkout keeps them beside the package
        names += [
            "pamid.estimators",
            *(m.name for m in pkgutil.walk_packages(pamid.estimators.__path__, "pamid.estimators.")),
        ]
    return ["pamid", *(n for n in names if not re.search(r"\._", n) and not n.endswith("__main__"))]


@cache
def public_objects() -> list[str]:
    found = []
    for module_name in public_modules():
        module = importlib.import_module(module_name)
        for name, value in vars(module).items():
            own = (inspect.isclass(value) or inspect.isfunction(value)) and value.__module__ == module_name
            if own and not name.startswith("_"):
                found.append(f"{module_name}.{name}")
    found += ["pamid.estimators.all_estimators", "pamid.estimators.checked_instances"]
    return sorted(set(found))


def load(path: str) -> object:
    module, _, name = path.rpartition(".")
    return getattr(importlib.import_module(module), name)


def public_methods(path: str) -> list[str]:
    """Methods and properties that a class defines itself, and that no base of ours has documented before."""
    owner = load(path)
    if not inspect.isclass(owner):
        return []
    return [
        name
        for name, value in vars(owner).items()
        if not re.match(r"_|set_\w+_request$", name)  # scikit-learn writes the requests itself
        and (inspect.isroutine(value) or isinstance(value, property | classmethod | staticmethod))
        and not (
            value.__doc__ is None and any(getattr(getattr(b, name, None), "__doc__", None) for b in owner.__mro__[1:])
        )
    ]


def faults(path: str, codes: set[str]) -> list[str]:
    return [f"{path}: {code} {message}" for code, message in validate(path)["errors"] if code in codes]


@cache
def exported() -> set[str]:
    """Paths of what the packages export by name."""
    paths = set()
    for module_name in public_modules():
        module = importlib.import_module(module_name)
        if hasattr(module, "__path__"):
            values = (getattr(module, name) for name in getattr(module, "__all__", ()))
            paths |= {f"{v.__module__}.{v.__name__}" for v in values if inspect.isclass(v) or inspect.isfunction(v)}
    return paths


def complete_codes(path: str) -> set[str]:
    value = load(path)
    if inspect.isclass(value) and (issubclass(value, Exception | enum.Enum) or getattr(value, "_is_protocol", False)):
        return set()  # errors take what PamidError documents; enumerations and protocols are not constructed
    return COMPLETE if is_estimator(path) or path in exported() else set()


def is_estimator(path: str) -> bool:
    return path.startswith("pamid.estimators.") and inspect.isclass(load(path))


def by_room(paths: list[str]) -> dict[str, list[str]]:
    """Sort paths by the room of the package that they are in, a test each: one a name would be thousands."""
    rooms: dict[str, list[str]] = {}
    for path in paths:
        rooms.setdefault(".".join(path.split(".")[:2]), []).append(path)
    return rooms


ROOMS = by_room(public_objects())
each_room = pytest.mark.parametrize("room", ROOMS)


@each_room
def test_numpydoc(room):
    found = []
    for path in ROOMS[room]:
        found += faults(path, CODES | complete_codes(path))
        for method in public_methods(path):
            found += faults(f"{path}.{method}", CODES)
    assert not found, "\n".join(found)


def test_methods_of_estimators():
    """Where a user calls a method himself, every parameter and every result is explained."""
    found = []
    for path in filter(is_estimator, public_objects()):
        for method in public_methods(path):
            if not isinstance(vars(load(path))[method], property):
                found += faults(f"{path}.{method}", COMPLETE)
    assert not found, "\n".join(found)


UNIT = re.compile(r"dimensionless|\b(m|mm|m³|N|Pa|bar|kg/s|kg|s|Hz|rad|K|1/s|Pa/s|m/s|J|unit of|units of)\b")


def test_docstrings_of_estimators():
    """Units, attributes, and an example that runs."""
    found = []
    for name, estimator_class in all_estimators():
        doc = inspect.getdoc(estimator_class)
        sections = NumpyDocString(doc)
        found += [] if UNIT.search(doc) else [f"{name} names no unit"]
        found += [f"{name} has no {section}" for section in ("Attributes", "Examples") if not sections[section]]
    assert found == []


def with_examples() -> list[str]:
    """What a user meets: the names that rooms export, and every effect, law, volume and adapter."""
    rooms = re.compile(r"pamid\.(effects|laws|volume|adapters)\.")
    shown = exported()
    paths = {path for path in public_objects() if path in shown or rooms.match(path)}
    return sorted(p for p in paths if not (inspect.isclass(load(p)) and issubclass(load(p), Exception)))


def has_examples(path: str) -> bool:
    value = load(path)
    methods = [getattr(value, m) for m in public_methods(path)]
    return any(">>>" in (getattr(v, "__doc__", None) or "") for v in (value, *methods))


def test_what_a_user_meets_has_an_example():
    without = [p for p in with_examples() if not re.search(r"^Examples\n-+$", inspect.getdoc(load(p)) or "", re.M)]
    assert not without, f"no example: {without}"


EXAMPLES = by_room(["pamid.estimators", *filter(has_examples, public_objects())])


@pytest.mark.parametrize("room", EXAMPLES)
def test_examples_run(room):
    """The examples of docstrings, and of the methods below them, give what they say."""
    report: list[str] = []
    for path in EXAMPLES[room]:
        value = importlib.import_module(path) if path == "pamid.estimators" else load(path)
        module = inspect.getmodule(value)
        finder = doctest.DocTestFinder(recurse=inspect.isclass(value), exclude_empty=True)
        runner = doctest.DocTestRunner(verbose=False, optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
        for test in finder.find(value, path, module=module, globs=dict(vars(module))):
            runner.run(test, out=report.append)
    assert not report, "".join(report)
