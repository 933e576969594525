"""The list of slow tests names tests that are there, and the slow ones are run by the checks of a clean checkout."""

import ast
import re
from pathlib import Path

import pytest
from conftest import is_drawn

TESTS = Path(__file__).parent
ROOT = TESTS.parent
NAMES = [line for line in (TESTS / "slow.txt").read_text("utf-8").splitlines() if line and not line.startswith("#")]


def test_the_list_names_tests():
    assert len(set(NAMES)) == len(NAMES)
    known = {}
    for name in NAMES:
        file, _, rest = name.partition("::")
        if file not in known:
            (path,) = TESTS.rglob(file)
            tree = ast.parse(path.read_text("utf-8"))
            known[file] = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
        assert rest.partition("[")[0].split("::")[-1] in known[file], f"{name} is gone: strike it out"


def test_slow_tests_are_left_out_of_the_short_run_alone():
    if not (ROOT / "Makefile").exists():
        pytest.skip("needs the repository")
    makefile = (ROOT / "Makefile").read_text("utf-8")
    rules = {part.split(":")[0]: part for part in makefile.split("\n\n")}
    assert '-m "not slow and not long"' in makefile
    whole = next(rule for name, rule in rules.items() if name.split("\n")[-1] == "pytest-all")
    assert "pytest -n" in whole and "-m" not in whole.split("pytest -n")[1]
    script = (ROOT / ".ci" / "run").read_text("utf-8")
    assert 'QUARTER="--quarter $key"' in script
    assert {"lint", "wheel", "pytest-all"} <= set(re.findall(r"^make ([\w-]+)", script, re.M))


def test_the_marker_follows_the_list(request):
    for item in request.session.items:
        if item.nodeid.rpartition("/")[2] in NAMES and "/" not in item.name:
            assert item.get_closest_marker("slow"), item.nodeid


def test_each_key_draws_another_quarter_of_the_slow_tests():
    names = sorted({name.partition("[")[0] for name in NAMES})
    keys = [f"commit {k}" for k in range(20)]
    quarters = [{name for name in names if is_drawn(name, key)} for key in keys]
    for quarter in quarters:
        assert 0.16 * len(names) < len(quarter) < 0.35 * len(names)
    assert len(set().union(*quarters)) > 0.98 * len(names)
    for name in NAMES:
        assert is_drawn(name, keys[0]) == (name.partition("[")[0] in quarters[0])  # cases of a test stay together
