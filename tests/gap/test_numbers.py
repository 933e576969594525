"""Numbers in the code of the diagnosis: those that decide stand in its settings, and the others become no more."""

import ast
from collections.abc import Iterator
from pathlib import Path

from pamid.gap import settings

GAP = Path(settings.__file__).parent
ROUND_OFF = 1e-4
"""Below it a number guards a computation against rounding; it decides nothing."""
PLAIN = {0, 1, 2}
"""Counts and halves of a range: no threshold."""
NAMED, COMPARED = 163, 73
"""Constants outside of the settings, and numbers within comparisons, that are there today: take some away, and lower
these with them."""


def literals(node: ast.AST) -> Iterator[float]:
    for n in ast.walk(node):
        if isinstance(n, ast.Constant) and isinstance(n.value, int | float) and not isinstance(n.value, bool):
            yield n.value


def named(tree: ast.Module) -> Iterator[str]:
    """Constants of a module that hold a number, tuples and tables as well."""
    for node in tree.body:
        targets = (
            node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        )
        if targets and node.value is not None and any(True for _ in literals(node.value)):
            yield ast.unparse(targets[0])


def compared(tree: ast.Module) -> Iterator[str]:
    """Numbers within comparisons, in whatever expression."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            for value in literals(node):
                if abs(value) not in PLAIN and abs(value) >= ROUND_OFF:
                    yield f"{value:g} in {ast.unparse(node)}"


def found(what) -> list[str]:
    paths = [p for p in sorted(GAP.rglob("*.py")) if p.name != "settings.py"]
    return [f"{p.relative_to(GAP)}: {text}" for p in paths for text in what(ast.parse(p.read_text("utf-8")))]


def test_the_reader_sees_tuples_tables_and_numbers_within_lines():
    tree = ast.parse(
        "FEW, FAR = 3, 0.5\nKIND: int = 4\nWORD = 'x'\ndef f(x):\n    return 0.7 * x < 1e-9 or max(x, 12) > 1\n"
    )
    assert list(named(tree)) == ["(FEW, FAR)", "KIND"]
    assert list(compared(tree)) == ["0.7 in 0.7 * x < 1e-09", "12 in max(x, 12) > 1"]


def test_no_constant_is_added_beside_the_settings():
    assert len(found(named)) <= NAMED, "\n".join(found(named))


def test_no_threshold_is_added_within_a_line():
    assert len(found(compared)) <= COMPARED, "\n".join(found(compared))
