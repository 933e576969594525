"""The conda recipe states what pyproject.toml states: version, Python, dependencies, extras, the command."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
RECIPE = ROOT / "packaging" / "conda" / "recipe.yaml"
if not RECIPE.is_file():
    pytest.skip("needs the repository", allow_module_level=True)

OTHER_NAMES = {
    "torch": "pytorch", "matplotlib": "matplotlib-base", "mujoco": "mujoco-python", "dask": "dask-core"
}  # fmt: skip
"""Packages that conda-forge calls by another name."""
EXTRAS = ("export", "mujoco", "control", "robot", "distributed")


@pytest.fixture(scope="module")
def recipe() -> dict[str, Any]:
    yaml = pytest.importorskip("yaml")
    read: dict[str, Any] = yaml.safe_load(RECIPE.read_text(encoding="utf-8"))
    return read


@pytest.fixture(scope="module")
def project() -> dict[str, Any]:
    read: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return read


def as_conda(requirements: list[str]) -> set[str]:
    """Requirements of pip as those of conda: another name for some, a space before the version."""
    found = set()
    for text in requirements:
        name, bound = re.fullmatch(r"([\w.-]+)(.*)", text).groups()  # type: ignore[union-attr]
        found.add(f"{OTHER_NAMES.get(name, name)} {bound}")
    return found


def test_the_version_is_that_of_the_project(recipe: dict[str, Any], project: dict[str, Any]) -> None:
    assert recipe["context"]["version"] == project["project"]["version"]


def test_dependencies_are_those_of_the_project(recipe: dict[str, Any], project: dict[str, Any]) -> None:
    python = f"python {project['project']['requires-python']}"
    assert set(recipe["requirements"]["run"]) == {python} | as_conda(project["project"]["dependencies"])
    assert set(recipe["requirements"]["host"]) == {python, "pip"} | as_conda(project["build-system"]["requires"])


def test_extras_are_constraints(recipe: dict[str, Any], project: dict[str, Any]) -> None:
    extras = [text for name in EXTRAS for text in project["project"]["optional-dependencies"][name]]
    assert set(recipe["requirements"]["run_constraints"]) == as_conda(extras)


def test_the_command_is_installed(recipe: dict[str, Any], project: dict[str, Any]) -> None:
    scripts = [f"{name} = {target}" for name, target in project["project"]["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == scripts
    assert recipe["about"]["license"] == project["project"]["license"]


def test_a_dependency_that_is_missing_would_be_noticed() -> None:
    assert as_conda(["torch>=2.4", "numpy>=2.0"]) == {"pytorch >=2.4", "numpy >=2.0"}
    assert as_conda(["torch>=2.5"]) != as_conda(["torch>=2.4"])
