"""The reference: one page a room of the house, in the order of the house, made from what each room holds."""

from __future__ import annotations

import importlib
import inspect
import os
import pkgutil
import re
from pathlib import Path
from typing import Any

ROOMS = {
    "pamid": "the usual way in",
    "pamid.estimators": "models as scikit-learn estimators",
    "pamid.gap": "where simulator and log disagree, which effect is the cause, how far it closes",
    "pamid.report": "a diagnosis for people",
    "pamid.compare": "estimators on unseen runs",
    "pamid.plots": "pictures",
    "pamid.signals": "logs, units, rates, splits",
    "pamid.equations": "residuals of the bench's equations on a log",
    "pamid.bench": "the simulated bench",
    "pamid.effects": "what the nominal equations leave out",
    "pamid.laws": "force, gas, valve, joint",
    "pamid.volume": "volume models",
    "pamid.fitting": "least squares, Levenberg–Marquardt, free runs",
    "pamid.training": "the network and its trainers",
    "pamid.adapters": "reparametrisations of a trained network",
    "pamid.online": "streams",
    "pamid.export": "C, ONNX, FMU",
    "pamid.persistence": "model files",
    "pamid.checkpoint": "long work in steps",
    "pamid.errors": "what can go wrong",
}
"""Each room with a line on it; the command line has a page of its own."""

_WITHIN = ("pamid.report.sections", "pamid.report.drawings", "pamid.signals.formats")
"""What only its room uses."""

_TOGETHER = ("pamid.effects", "pamid.laws", "pamid.adapters")
"""Rooms of small files, listed in one table."""


def _own(module: Any) -> list[str]:
    """Public classes and functions that a module defines itself."""
    return [
        name
        for name, value in vars(module).items()
        if not name.startswith("_")
        and (inspect.isclass(value) or inspect.isfunction(value))
        and value.__module__ == module.__name__
    ]


def members(room: str) -> tuple[list[str], dict[str, list[str]]]:
    """Return what a room shows at its door, and the rest of it by module, as dotted paths."""
    if room == "pamid.estimators":
        estimators = importlib.import_module(room)
        names = [n for n, _ in estimators.all_estimators()] + ["all_estimators", "checked_instances"]
        return [f"{room}.{n}" for n in names], {}
    module = importlib.import_module(room)
    shown = [n for n in getattr(module, "__all__", []) if not n.startswith("__")]
    values = {n: getattr(module, n) for n in shown}
    shown = [n for n, v in values.items() if inspect.isclass(v) or inspect.isfunction(v)]
    known = {id(values[n]) for n in shown}
    rest: dict[str, list[str]] = {}
    if room == "pamid":  # each is documented where it lives
        return [f"{room}.{module._HOME[n]}.{n}" for n in shown], {}
    if not hasattr(module, "__path__"):
        return [f"{room}.{n}" for n in (shown or _own(module))], {}
    for found in pkgutil.walk_packages(module.__path__, f"{room}."):
        if re.search(r"\._", found.name) or found.name.startswith(_WITHIN) or "templates" in found.name:
            continue
        inner = importlib.import_module(found.name)
        names = [n for n in _own(inner) if id(getattr(inner, n)) not in known]
        if names:
            rest[found.name] = [f"{found.name}.{n}" for n in names]
    return [f"{room}.{n}" for n in shown], rest


def rooms() -> dict[str, str]:
    """Return every room with its line; one that is not in `ROOMS` says what it is itself."""
    pamid = importlib.import_module("pamid")
    found = dict(ROOMS)
    for module in pkgutil.iter_modules(pamid.__path__, "pamid."):
        if module.name not in found and not re.search(r"\._|\.(cli|constants|files)$", module.name):
            found[module.name] = (
                (inspect.getdoc(importlib.import_module(module.name)) or "").partition("\n")[0].rstrip(".")
            )
    return found


def _table(paths: list[str]) -> str:
    return ".. autosummary::\n   :toctree: .\n\n" + "".join(f"   {p}\n" for p in paths) + "\n"


def page(room: str, line: str) -> str:
    """Return the page of a room."""
    door, rest = members(room)
    title = f"``{room}``: {line}"
    parts = [title, "=" * len(title), ""]
    about = (inspect.getdoc(importlib.import_module(room)) or "").strip()
    parts += [about, ""]
    if room == "pamid.errors":
        return "\n".join([*parts, *(f".. autoexception:: {p}\n" for p in door)])
    if door:
        parts += [_table(door)]
    if door and os.environ.get("PAMID_DOCS") == "short":
        return "\n".join(parts)
    if room in _TOGETHER:
        parts += ["Members", "-------", "", _table([p for paths in rest.values() for p in paths])]
        rest = {}
    for module, paths in rest.items():
        parts += [f"``{module}``", "-" * (len(module) + 4), ""]
        about = (inspect.getdoc(importlib.import_module(module)) or "").strip().partition("\n\n")[0]
        parts += [about, "", _table(paths)]
    return "\n".join(parts)


def _write(app: Any, _: Any) -> None:
    folder = Path(app.srcdir) / "api"
    folder.mkdir(exist_ok=True)
    texts = {f"{room}.room.rst": page(room, line) for room, line in rooms().items()}
    texts["commands.rst"] = importlib.import_module("commands").page()
    listed = "".join(f"   {Path(name).stem}\n" for name in texts)
    texts["index.rst"] = (
        "Reference\n=========\n\nThe rooms of the house, from what a user meets first down to the laws. Quantities are "
        "in SI units; ``P`` is absolute pressure, ``p_gauge`` gauge.\n\n.. toctree::\n   :maxdepth: 1\n\n" + listed
    )
    for name, text in texts.items():
        file = folder / name
        if not file.exists() or file.read_text(encoding="utf-8") != text:  # unchanged pages are not read again
            file.write_text(text, encoding="utf-8")


def _skip(app: Any, what: str, name: str, obj: Any, skip: bool, options: Any) -> bool | None:
    """Leave out what scikit-learn writes for metadata routing: it is the same for every estimator."""
    return True if re.fullmatch(r"set_\w+_request", name) else None


def _keep_bars(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Keep the bars of an absolute value from being read as a substitution, outside formulas and examples."""
    formula = None
    for k, line in enumerate(lines):
        indent = len(line) - len(line.lstrip())
        if line.lstrip().startswith(".. math::"):
            formula = indent
        elif formula is not None and line.strip() and indent <= formula:
            formula = None
        if formula is None and not line.lstrip().startswith((">>>", "...", "|")):
            lines[k] = line.replace("|", r"\|")


def setup(app: Any) -> dict[str, bool]:
    """Write the pages before Sphinx looks for pages."""
    app.connect("config-inited", _write)
    app.connect("autodoc-skip-member", _skip)
    app.connect("autodoc-process-docstring", _keep_bars, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
