"""constraints-lowest.txt pins what pyproject.toml names to the lowest version that it admits."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / "constraints-lowest.txt"
if not FILE.is_file():
    pytest.skip("needs the repository", allow_module_level=True)


def bounds() -> dict[str, str]:
    """The lower bound of each dependency and of each one of the extras that tests need."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = ("export", "mujoco", "control", "robot", "distributed", "test")
    named = [*project["dependencies"], *(r for extra in extras for r in project["optional-dependencies"][extra])]
    found = (re.fullmatch(r"([\w.-]+)>=([\d.]+)", r) for r in named if not r.startswith("pamid["))
    return {match[1]: match[2] for match in found if match}


def pins() -> dict[str, str]:
    lines = [line for line in FILE.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return dict(line.split("==") for line in lines)


def same(bound: str, pin: str) -> bool:
    """Return whether two versions are one, zeros at the end aside."""
    return re.sub(r"(\.0)+$", "", bound) == re.sub(r"(\.0)+$", "", pin)


def test_each_pin_is_the_lower_bound() -> None:
    wanted, pinned = bounds(), pins()
    assert set(pinned) == set(wanted)
    assert {name: (wanted[name], pin) for name, pin in pinned.items() if not same(wanted[name], pin)} == {}


def test_a_pin_above_its_bound_would_be_noticed() -> None:
    assert same("1.14", "1.14.0") and same("13", "13.0.0") and same("2026.1", "2026.1.0")
    assert not same("1.6", "1.6.1") and not same("1.1", "1.10")


def test_the_robots_stacks_and_scikit_learn_in_use_are_admitted() -> None:
    found = {name: tuple(map(int, bound.split("."))) for name, bound in bounds().items()}
    assert found["mujoco"] <= (3, 2)
    assert found["scikit-learn"] < (1, 7)
