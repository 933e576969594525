"""The rules of the house: rooms and what they import, sizes of files, what the package ships."""

from __future__ import annotations

import ast
import importlib
import importlib.metadata
import os
import re
import shutil
import statistics
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import pamid

ROOT = Path(__file__).resolve().parents[1]
if not (ROOT / "pyproject.toml").is_file():
    pytest.skip("needs the repository", allow_module_level=True)

FOLDERS = ("pamid", "estimators", "tests", "benchmarks", "docs")
CODE = sorted(p for f in FOLDERS for p in (ROOT / f).rglob("*.py") if "__pycache__" not in p.parts)
LIBRARY = [p for p in CODE if p.relative_to(ROOT).parts[0] in ("pamid", "estimators")]
PAPERS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "docs").rglob("*.toml")])
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))

MAY_ASK_FOR_ESTIMATORS = {
    "__init__.py",
    "_model_types.py",
    "persistence.py",
    "cli",
    "compare",
    "plots",
    "systems",
    "demo",
}
HEAVY = {
    "numpy", "scipy", "pandas", "sklearn", "torch", "matplotlib", "pysindy", "skops", "h5py", "pyarrow", "filterpy",
}  # fmt: skip


@cache
def tree_of(path: Path) -> ast.Module:
    """What a file says, read once for all that is asked of it."""
    return ast.parse(path.read_text(encoding="utf-8"))


def name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


# --- imports ------------------------------------------------------------------------------------------------
def test_layers_hold(tmp_path: Path) -> None:
    command = shutil.which("lint-imports", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    if command is None:
        pytest.skip("import-linter is not installed")
    shutil.copytree(ROOT / "pamid", tmp_path / "pamid")
    shutil.copytree(ROOT / "estimators", tmp_path / "pamid" / "estimators")  # as it is installed
    done = subprocess.run(
        [command, "--no-cache", "--config", str(ROOT / "pyproject.toml")],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, "COLUMNS": "200"},
    )
    assert done.returncode == 0, done.stdout + done.stderr


@cache
def imports(path: Path) -> list[tuple[str, bool]]:
    """Every module that a file imports, and whether it does so as soon as it is loaded itself."""

    def visit(node: ast.AST, loaded: bool) -> Iterator[tuple[str, bool]]:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.Import):
                yield from ((alias.name, loaded) for alias in child.names)
            elif isinstance(child, ast.ImportFrom):
                yield from ((target, loaded) for target in _targets(path, child))
            elif isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
                yield from visit(child, False)
            elif isinstance(child, ast.If) and ast.unparse(child.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING"):
                yield from visit(ast.Module(child.orelse, []), loaded)
            else:
                yield from visit(child, loaded)

    return list(visit(tree_of(path), True))


def _targets(path: Path, node: ast.ImportFrom) -> list[str]:
    base = node.module or ""
    if node.level:
        parts = list(path.relative_to(ROOT).with_suffix("").parts)
        parts = ["pamid", *parts] if parts[0] == "estimators" else parts
        base = ".".join([*parts[: len(parts) - node.level], *([base] if base else [])])
    return [f"{base}.{alias.name}" for alias in node.names]


def test_the_reader_of_imports_tells_lazy_ones(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules[__name__], "ROOT", tmp_path)
    (tmp_path / "pamid").mkdir()
    file = tmp_path / "pamid" / "room.py"
    file.write_text(
        "import numpy\nfrom typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import torch\n"
        "def f():\n    from .estimators import MLP\nclass A:\n    from . import estimators\n"
    )
    assert imports(file) == [
        ("numpy", True),
        ("typing.TYPE_CHECKING", True),
        ("pamid.estimators.MLP", False),
        ("pamid.estimators", True),
    ]


def _imported(path: Path, modules: dict[str, Path]) -> Iterator[str]:
    """Modules of the package that a file imports, be it within a function or for types alone."""
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.ImportFrom):
            inside = path if path.name != "__init__.py" else path / "_"
            for target in _targets(inside, node):
                yield target if target in modules else target.rpartition(".")[0]
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def _module(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    parts = ("pamid", *parts) if parts[0] == "estimators" else parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def circles(files: list[Path]) -> list[list[str]]:
    """Files that import each other, in whatever roundabout way."""
    modules = {_module(p): p for p in files}
    left = {m: {t for t in _imported(p, modules) if t in modules and t != m} for m, p in modules.items()}
    while ends := {m for m, to in left.items() if not to & left.keys()}:
        left = {m: to for m, to in left.items() if m not in ends}
    while starts := left.keys() - {t for to in left.values() for t in to}:
        left = {m: to for m, to in left.items() if m not in starts}
    return [[m, *sorted(to & left.keys())] for m, to in sorted(left.items())]


def test_files_import_each_other_one_way() -> None:
    assert circles(LIBRARY) == []


def test_the_search_for_circles_sees_functions_and_types(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules[__name__], "ROOT", tmp_path)
    (tmp_path / "pamid").mkdir()
    contents = {
        "above": "from .one import f",
        "one": "def f():\n    from .two import g",
        "two": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from . import one\nfrom .below import h",
        "below": "h = 1",
    }
    for name_, text in contents.items():
        (tmp_path / "pamid" / f"{name_}.py").write_text(text)
    found = circles(sorted((tmp_path / "pamid").glob("*.py")))
    assert found == [["pamid.one", "pamid.two"], ["pamid.two", "pamid.one"]]


def test_the_package_asks_for_estimators_only_when_it_needs_them() -> None:
    for path in (p for p in LIBRARY if name(p).startswith("pamid/")):
        modules = [(m + ".", loaded) for m, loaded in imports(path)]
        asked = [loaded for module, loaded in modules if module.startswith(("pamid.estimators.", "estimators."))]
        assert not any(asked), f"{name(path)} imports estimators as soon as it is loaded"
        assert not asked or path.relative_to(ROOT).parts[1] in MAY_ASK_FOR_ESTIMATORS, name(path)


def test_importing_the_package_loads_nothing_heavy() -> None:
    code = "import sys, pamid, pamid.cli; print(*{m.partition('.')[0] for m in sys.modules})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert not HEAVY & set(done.stdout.split())


def test_the_face_of_the_package() -> None:
    assert {*pamid.__all__, "estimators"} <= set(dir(pamid))
    assert all(callable(getattr(pamid, n)) for n in pamid.__all__ if n != "__version__")
    with pytest.raises(AttributeError, match="no attribute 'sofa'"):
        pamid.sofa  # noqa: B018


def test_a_star_brings_every_estimator() -> None:
    names: dict[str, object] = {}
    exec("from pamid.estimators import *", names)
    assert {name for name, _ in pamid.estimators.all_estimators()} < set(names)


def test_the_checkout_is_whole_without_an_installation() -> None:
    """Python that starts in the checkout sees the checkout, whole, whatever pamid is installed, and loads no torch."""
    code = (
        "import pamid.estimators as e; print(e.__file__); e.GeometricForce; e.RateTransformer; "
        "print(*{m.partition('.')[0] for m in sys.modules})"
    )
    clean = "import sys; sys.meta_path[:] = [f for f in sys.meta_path if 'editable' not in repr(f).lower()]; "
    done = subprocess.run([sys.executable, "-c", clean + code], cwd=ROOT, capture_output=True, text=True, check=True)
    file, modules = done.stdout.splitlines()
    assert Path(file).samefile(ROOT / "estimators" / "__init__.py")
    assert not {"torch", "pysindy", "matplotlib"} & set(modules.split())


# --- what is private, and what is declared --------------------------------------------------------------------
NAMED_TUPLE = {"_fields", "_replace", "_asdict"}
OTHERS_PRIVATE = {
    "estimators/_progress.py: _init_callback_context",  # scikit-learn's callbacks have no public way yet
    "estimators/_streaming.py: _read",  # of the estimator itself, which a mixin does not know
    "pamid/cli/commands/completion.py: _SubParsersAction",  # argparse does not show its options
    "pamid/cli/commands/completion.py: _actions",
    "pamid/cli/commands/completion.py: _choices_actions",
}
PROBED = {
    "shape", "columns", "to_numpy", "iloc",  # tables of numpy and pandas
    "detach", "new_tensor",  # torch's tensors
    "get_params", "fit", "predict", "feature_names_in_",  # estimators of somebody else's
    "_asdict", "_fields", "__dataclass_fields__", "__dict__", "__slots__",  # Python's own records
    "input_labels", "get_source",  # python-control, importlib
    "rest_diameter",  # a muscle's diameter, in `pamid compare`
}  # fmt: skip
"""What objects of other packages are asked whether they have it; those of pamid say what they can do."""


def _private_from_outside(path: Path) -> Iterator[str]:
    """Private names that a file reads of others: not of self, and neither defined nor set in it."""
    tree = list(ast.walk(tree_of(path)))
    own = {n.name for n in tree if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)}
    own |= {n.attr for n in tree if isinstance(n, ast.Attribute) and isinstance(n.ctx, ast.Store)}
    own |= {n.id for n in tree if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
    for node in tree:
        if isinstance(node, ast.Attribute) and node.attr.startswith("_") and node.attr not in own:
            if ast.unparse(node.value) not in ("self", "cls", "super()"):
                yield node.attr
        elif isinstance(node, ast.ImportFrom) and node.module and (node.level or node.module.startswith("pamid")):
            yield from (alias.name for alias in node.names)


def test_private_names_stay_in_their_file() -> None:
    found = {(name(path), n) for path in LIBRARY for n in _private_from_outside(path) if re.match("_(?!_)", n)}
    assert {f"{file}: {n}" for file, n in found if n not in NAMED_TUPLE} <= OTHERS_PRIVATE


def test_abilities_are_declared_and_not_tried() -> None:
    for path in LIBRARY:
        for call in (n for n in ast.walk(tree_of(path)) if isinstance(n, ast.Call)):
            where = f"{name(path)}:{call.lineno}"
            if isinstance(call.func, ast.Name) and call.func.id == "hasattr" and ast.unparse(call.args[0]) != "self":
                assert ast.literal_eval(call.args[1]) in PROBED, where
            written = isinstance(call.func, ast.Attribute) and call.func.attr in ("update", "pop", "setdefault")
            assert not (written and ".__dict__" in ast.unparse(call.func)), where


# --- sizes and words ----------------------------------------------------------------------------------------
def lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").splitlines()


def test_a_file_says_one_thing() -> None:
    assert [name(path) for path in CODE if len(lines(path)) > 500] == []


def test_files_are_short_in_the_middle() -> None:
    assert statistics.median(len(lines(p)) for p in LIBRARY) <= 200


def test_nothing_is_left_for_later_and_nothing_names_a_machine() -> None:
    # The words are put together here so that this file does not hold them itself.
    later = r"\b(TO" + r"DO|FIX" + r"ME|XX" + r"X)\b"
    machine = r"(?<![\w.])/(wo" + r"rk|ho" + r"me|ro" + r"ot|Us" + r"ers)/|\.\./sha" + r"red"
    for path in [*CODE, *PAPERS, ROOT / "pyproject.toml"]:
        for number, line in enumerate(lines(path), 1):
            assert not re.search(f"{later}|{machine}", line), f"{name(path)}:{number}: {line.strip()}"


def test_no_phrase_reads_as_translated() -> None:
    """Phrases that a native reader reads twice: say in turn, compared with, the remainder, is invalid."""
    found = "|".join(
        (
            r"\bby tur" + "ns",
            "held aga" + "inst",
            "what is left o" + r"f\b",
            "one behind the oth" + "er",
            "is none o" + "f",
            "stands in the wa" + "y",
            "left its sens" + "es",
            '"""Le' + "t ",
            '"""Say wha' + "t ",
            '"""Tell wheth' + "er",
        )
    )
    for path in [*CODE, *PAPERS]:
        for number, line in enumerate(lines(path), 1):
            assert not re.search(found, line), f"{name(path)}:{number}: {line.strip()}"


# --- what is shipped ----------------------------------------------------------------------------------------
def test_every_package_on_disk_is_shipped_and_nothing_else() -> None:
    where = PROJECT["tool"]["setuptools"]["package-dir"]
    found = {
        ".".join([package, *p.parent.relative_to(ROOT / folder).parts])
        for package, folder in where.items()
        for p in (ROOT / folder).rglob("__init__.py")
    }
    assert found == set(PROJECT["tool"]["setuptools"]["packages"])


def test_data_files_are_shipped() -> None:
    data = PROJECT["tool"]["setuptools"]["package-data"]
    folders = PROJECT["tool"]["setuptools"]["package-dir"]
    shipped = {p for package, patterns in data.items() for g in patterns for p in (ROOT / folders[package]).glob(g)}
    for folder in ("pamid", "estimators"):
        others = {p for p in (ROOT / folder).rglob("*") if p.is_file() and p.suffix not in (".py", ".pyc", ".so")}
        assert others <= shipped, f"not shipped: {[name(p) for p in others - shipped]}"
        assert (ROOT / folder / "py.typed").is_file()


def test_metadata() -> None:
    installed = importlib.metadata.metadata("pamid")
    project = PROJECT["project"]
    assert project["version"] == pamid.__version__ == installed["Version"]
    assert project["requires-python"] == installed["Requires-Python"] == ">=3.11"
    assert installed["License-Expression"] == "BSD-3-Clause"
    assert "Redistribution and use" in (ROOT / "LICENSE").read_text(encoding="utf-8")
    classifiers = project["classifiers"]
    assert [f"Programming Language :: Python :: 3.{minor}" in classifiers for minor in range(11, 15)] == [True] * 4
    (script,) = importlib.metadata.entry_points(group="console_scripts", name="pamid")
    assert script.load() is pamid.cli.main


def test_every_import_is_declared() -> None:
    declared = {re.split(r"[<>=!\[ ]", d)[0].lower() for d in PROJECT["project"]["dependencies"]}
    declared = {{"scikit-learn": "sklearn"}.get(d, d) for d in declared}
    optional = PROJECT["project"]["optional-dependencies"]
    extras = {
        re.split(r"[<>=!\[ ]", d)[0].lower()
        for n in ("export", "distributed", "mujoco", "control", "robot")
        for d in optional[n]
    }
    extras |= {"mcap_ros2", "yaml"}  # of mcap-ros2-support and pyyaml
    used = {m.partition(".")[0] for p in LIBRARY for m, _ in imports(p)}
    foreign = used - set(sys.stdlib_module_names) - {"pamid", "estimators"}
    brought_along = {"joblib"}  # by scikit-learn
    assert foreign - brought_along <= declared | extras, "not declared"
    assert declared - foreign <= {"pyarrow"}, "declared and not used"  # pandas reads and writes parquet by it


def test_papers_agree_on_name_and_version() -> None:
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"version: {pamid.__version__}" in citation
    assert "license: BSD-3-Clause" in citation
    assert "## Unreleased" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert (ROOT / PROJECT["project"]["readme"]).stat().st_size > 2000


# --- words ----------------------------------------------------------------------------------------------------
def test_a_name_means_one_class() -> None:
    found: dict[str, list[str]] = {}
    for path in LIBRARY:
        for node in tree_of(path).body:
            if isinstance(node, ast.ClassDef):
                found.setdefault(node.name, []).append(str(path.relative_to(ROOT)))
    assert {name: files for name, files in found.items() if len(files) > 1} == {}


@pytest.mark.parametrize(
    ("package", "old", "new"),
    [
        ("pamid.effects", "Step", "FlowTerm"),
        ("pamid.volume", "Parameter", "FitParameter"),
        ("pamid.training", "Problem", "TrainingProblem"),
        ("pamid.compare", "Candidate", "CandidateModel"),
        ("pamid.estimators", "Interval", "PredictionInterval"),
    ],
)
def test_an_old_name_warns_and_serves_one_version(package: str, old: str, new: str) -> None:
    module = importlib.import_module(package)
    with pytest.warns(FutureWarning, match=new):
        assert getattr(module, old) is getattr(module, new)
    assert old not in dir(module)
    with pytest.raises(AttributeError):
        _ = module.no_such_name
