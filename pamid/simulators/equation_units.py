"""Units of states that a log lacks, from the equations that they stand in."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping

from .dimensions import unit_text
from .equation_model import tree_of


def completed(units: Mapping[str, str], rates: Mapping[str, str], others: Iterable[str]) -> dict[str, str]:
    """Return units by name, those of states made up where empty: a rate is one per second, and a sum has one unit."""
    found = {name: unit for name, unit in units.items() if unit or name in rates}
    before: dict[str, str] = {}
    while before != found:
        before = dict(found)
        for text in (*rates.values(), *others):
            for node in ast.walk(tree_of(text)):
                _of(node, found)
        for name, text in rates.items():
            body = tree_of(text).body
            if found.get(name):
                _give(body, unit_text([(found[name], 1), ("s", -1)]), found)
            elif unit := _of(body, found):
                found[name] = unit_text([(unit, 1), ("s", 1)])
    return {**units, **found}


def _of(node: ast.AST, units: dict[str, str]) -> str:
    """Return the unit of a name, or of a sum of names, which gives it to all of them; empty where it is not known."""
    if isinstance(node, ast.Name):
        return units.get(node.id, "")
    if isinstance(node, ast.UnaryOp):
        return _of(node.operand, units)
    if not isinstance(node, ast.BinOp) or not isinstance(node.op, ast.Add | ast.Sub):
        return ""
    unit = _of(node.left, units) or _of(node.right, units)
    if unit:
        _give(node, unit, units)
    return unit


def _give(node: ast.AST, unit: str, units: dict[str, str]) -> None:
    """Give a unit to a name, or to the names of a sum, that have none."""
    if isinstance(node, ast.Name) and units.get(node.id) == "":
        units[node.id] = unit
    elif isinstance(node, ast.UnaryOp):
        _give(node.operand, unit, units)
    elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
        _give(node.left, unit, units)
        _give(node.right, unit, units)
