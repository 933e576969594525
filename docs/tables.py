"""Write what follows from the code: ``python docs/tables.py`` (``--check`` only compares).

A table of a page stands between ``<!-- table: name -->`` and ``<!-- end of table -->``; `TABLES` says what each
name renders. Packages whose names are imported when first asked for get a stub, ``__init__.pyi``, for type checkers.
"""

from __future__ import annotations

import argparse
import dataclasses
import importlib
import inspect
import re
import sys
import textwrap
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

DOCS = Path(__file__).resolve().parent
PAGES = sorted([DOCS.parent / "README.md", *DOCS.glob("*.md"), DOCS.parent / "benchmarks" / "figures.md"])
MARKS = re.compile(r"(<!-- table: ([\w:]+) -->\n).*?(<!-- end of table -->)", re.DOTALL)


def rows(header: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table; a bar within a cell would end it and is escaped."""
    lines = [header, ["---"] * len(header), *body]
    return "\n".join("| " + " | ".join(str(cell).replace("|", "\\|") for cell in line) + " |" for line in lines)


def items(body: Sequence[tuple[str, str]]) -> str:
    """Return a Markdown list, one name and what it means a line."""
    return "\n".join([*(f"- {name}: {meaning}" for name, meaning in body), ""])


def summary(thing: object) -> str:
    """Return the first paragraph of a docstring on one line, without the marks of reStructuredText."""
    text = " ".join((inspect.getdoc(thing) or "").split("\n\n")[0].split())
    return re.sub(r"`{1,2}([^`]+)`{1,2}", r"`\1`", text)


def formula(thing: object) -> str:
    """Return the first formula of a docstring for a Markdown cell; empty if there is none."""
    found = re.search(r"\.\. math::(.*?)(?:\n\s*\n|\Z)", inspect.getdoc(thing) or "", re.DOTALL)
    if found is None:
        return ""
    tex = " ".join(found[1].split())
    tex = re.sub(r"\\begin\{(?:aligned|cases)\}|\\end\{(?:aligned|cases)\}", "", tex).replace("&", "")
    return f"${tex.replace('|', chr(92) + 'vert ')}$"


# --- the simulator ------------------------------------------------------------------------------------------
_SYMBOLS = {
    "rest_length": "L₀", "rest_diameter": "D₀", "braid_angle": "θ₀", "initial_contraction": "ε₀",
    "heat_capacity_ratio": "γ", "gas_constant": "R", "temperature": "T", "atmospheric_pressure": "P_atm",
    "supply_pressure": "P_s", "sonic_conductance": "C", "critical_pressure_ratio": "b_c", "reference_density": "ρ₀",
    "pulley_radius": "r", "inertia": "J", "viscous_damping": "b_q",
}  # fmt: skip
"""The symbol of each number of a simulator file in the equations of the pages."""
_CONVERTS = re.compile(r"[a-z ]*\d+ (?:mm|%|°C|kg cm²) ")
"""Hints that only convert to a number's unit, which has a column of its own."""


def simulator_file() -> str:
    """Every number of a simulator file."""
    from pamid.bench.parameters import TABLES

    body = []
    for table, cls in TABLES.items():
        for f in dataclasses.fields(cls):
            m = f.metadata
            if "unit" not in m:
                body.append([f"`{table}.{f.name}`", "", "text", "", ""])
                continue
            hint = re.sub(r"^[\w ]+ (?:is|are) [\w, ²/]+: ", "", m["hint"])  # the unit has a column of its own
            told = [m["comment"], "" if _CONVERTS.match(hint) or hint.endswith(f" in {m['unit']}.") else hint]
            note, upper = "; ".join(part for part in told if part), float(f"{m['upper']:.3g}")
            span = f"{m['lower']:g} … {upper:g}"
            body.append([f"`{table}.{f.name}`", _SYMBOLS[f.name], m["unit"], span, note])
    return rows(["key", "symbol", "unit", "accepted", "notes"], body)


def data_sets() -> str:
    """The data sets of the study with their true counts."""
    from pamid.bench import datasets

    body = []
    sets = [(name, muscle, trajectories()) for name, (muscle, trajectories) in datasets._SETS.items()]
    sets += [(name, "A, B, C", trajectories("B")) for name, trajectories in datasets._PAPER_LIKE.items()]
    for name, muscle, runs in sets:
        kind = re.split(r"[-_]", runs[0].name)[0]
        samples = sum(len(run.q_ref) - run.lead for run in runs)
        body.append([f"`{name}`", muscle, f"{len(runs)} × {kind}", f"{samples:,}"])
    return rows(["name", "muscle", "runs", "rows"], body)


def effects() -> str:
    """Every effect of the library."""
    from pamid.effects import all_effects

    lines, family = [], ""
    for name, cls in sorted(all_effects().items(), key=lambda item: (item[1].family, item[0])):
        if not cls.__module__.startswith("pamid."):
            continue
        if cls.family != family:
            family = cls.family
            lines += ["", f"**{family.capitalize()}**", ""]
        shown = [p for p in cls.parameters if not p.before]  # the others are for logs alone
        numbers = ", ".join(f"`{p.name}` {p.nominal:g}{f' {p.unit}' if p.unit != '-' else ''}" for p in shown)
        file = f"../pamid/effects/{cls.__module__.rpartition('.')[2]}.py"
        other = "" if "bench" in cls.kinds else "*"
        lines.append(f"- [`{name}`]({file}) ({', '.join(cls.equations)}){other}: {summary(cls)} {numbers}")
    return "\n".join([*lines[1:], ""])


# --- models -------------------------------------------------------------------------------------------------
def volumes() -> str:
    """Every classical volume model."""
    from pamid.volume import all_volumes

    body = []
    for name, cls in all_volumes().items():
        numbers = ", ".join(f"`{p.name}`" for p in cls.parameters)
        body.append([f"`{name}`", formula(cls), numbers or "coefficients (V is linear in them)"])
    return rows(["name", "formula", "parameters"], body)


# --- logs ---------------------------------------------------------------------------------------------------
def units() -> str:
    """Every unit that a mapping may name."""
    from pamid.signals.units import SI_UNITS, UNITS_OF

    body = [[d, f"`{SI_UNITS[d]}`", ", ".join(f"`{u}`" for u in names)] for d, names in UNITS_OF.items()]
    return rows(["dimension", "SI", "units"], body)


# --- the command line ---------------------------------------------------------------------------------------
sys.path.insert(0, str(DOCS / "_ext"))
commands_ = importlib.import_module("commands")


def command(name: str) -> str:
    """Usage of one command; what each option means stands in the site's reference, as ``--help`` prints it."""
    lines = textwrap.wrap(commands_.usage(name), 120, break_on_hyphens=False, break_long_words=False)
    return "\n".join(["```text", *(line.replace("\N{NO-BREAK SPACE}", " ") for line in lines), "```"])


def common_options() -> str:
    """Options of every command."""
    parser = next(iter(commands_.subparsers().values()))
    actions = [a for a in parser._actions if a.dest in commands_.COMMON]
    return items([(f"`{', '.join(a.option_strings)}`", a.help or "") for a in actions])


def log_options() -> str:
    """Options of every command that reads a log; each with the same words wherever it stands."""
    found: dict[str, tuple[str, str]] = {}
    for name, parser in commands_.subparsers().items():
        actions = {a.dest: a for a in parser._actions}
        for dest in (d for d in ("log", *commands_.READING) if "log" in actions and d in actions):
            said = commands_.option(actions[dest])
            if found.setdefault(dest, said) != said:
                raise ValueError(f"pamid {name} says of {dest}: {said}. Expected, as elsewhere: {found[dest]}.")
    return items([(f"`{written}`", meaning) for written, meaning in found.values()])


def commands() -> str:
    """One line a command."""
    from pamid.cli.app import build_parser

    (group,) = (a for a in build_parser()._actions if hasattr(a, "choices") and isinstance(a.choices, dict))
    return items([(f"`pamid {c.dest}`", c.help or "") for c in group._choices_actions])


# --- benchmarks ---------------------------------------------------------------------------------------------
def benchmarks() -> str:
    """One line a script or package."""
    body = []
    for file in sorted((DOCS.parent / "benchmarks").rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        package = file.name == "__main__.py"  # run by its folder
        if (file.name.startswith("_") and not package) or '__name__ == "__main__"' not in text:
            continue
        name = (file.parent if package else file).relative_to(DOCS.parent).as_posix()
        said = re.match(r'[rR]?"""(.*?)(?:\n\s*\n|""")', text, re.DOTALL)
        text = " ".join(said[1].split()) if said else ""
        body.append([f"`python {name}`", re.sub(r":? ``python [^`]*``", "", text).replace("``", "`")])
    return rows(["command", "what it measures"], body)


# --- estimators and warnings --------------------------------------------------------------------------------
PURPOSE = {
    "force": "force", "flow": "flow", "inverse": "pressure", "dynamic": "free run", "cylinder": "cylinder",
    "drive": "joint",
}  # fmt: skip
"""What an estimator of an equation is for."""
OTHER_PURPOSE = {
    "ConformalRegressor": "intervals", "GapDiagnoser": "diagnosis", "LawRegressor": "pipeline",
    "OnlineAdapter": "stream", "RateTransformer": "rates", "SINDyModel": "free run",
}  # fmt: skip
"""The same for those without an equation of their own; adapters have "adaptation"."""
PARTIAL_FIT = {
    "GapDiagnoser": "logs", "OnlineAdapter": "recent", "LawRegressor": "none", "LinearTerms": "exact",
    "PolynomialLibraryMixin": "exact", "AdaptedModel": "source", "SequenceStreaming": "runs", "Streaming": "rows",
}  # fmt: skip
"""The guarantee of `partial_fit` by the class, or the first base, that gives it; docs/streaming.md explains each."""


def guarantee(cls: type) -> str:
    """Return what `partial_fit` of an estimator promises, in a word."""
    bases = {base.__name__ for base in cls.__mro__}
    return next(word for name, word in PARTIAL_FIT.items() if name in bases)


def estimators() -> str:
    """What each estimator is for, takes and offers, from its signature, bases and methods."""
    from pamid.estimators import all_estimators

    body = []
    for name, cls in all_estimators():
        taken, bases = inspect.signature(cls.fit).parameters, {base.__name__ for base in cls.__mro__}
        purpose = ", ".join(PURPOSE[e] for e in getattr(cls, "equations", ())) or OTHER_PURPOSE.get(name, "")
        hybrid = bool(bases & {"HybridModel", "AdaptedModel", "OnlineAdapter"})
        flags = (
            "one_trajectory" in inspect.signature(cls).parameters or "SequenceStreaming" in bases,
            "sample_weight" in taken,
            "groups" in taken,
            "TakesFrames" in bases,
            hasattr(cls, "set_fit_request"),
        )
        export = "C, ONNX, FMU" if hybrid else "C, ONNX" if hasattr(cls, "formulas") else ""
        body.append([f"`{name}`", purpose or "adaptation", *("✓" if f else "" for f in flags), guarantee(cls), export])
    header = ["", "purpose", "sequence", "`sample_weight`", "`groups`", "pandas, polars", "routing", "`partial_fit`"]
    return rows([*header, "export"], body)


WHAT_TO_DO = {
    "PamidWarning": "Lower the threshold of the regression, or check that its output varies. Update or uninstall an "
    "extension that fails to load.",
    "UnitWarning": "Give the unit of the column in the mapping, and say whether a pressure is gauge or absolute.",
    "ReadingWarning": "Inspect the rows that the warning names; repair the sensor, or leave these rows out.",
    "ExcitationWarning": "Record more runs, vary the signal or port that the warning names, or leave that signal out.",
    "ExtrapolationWarning": "Do not rely on this prediction. Record data there and fit again, or stay in the range.",
    "UnstableRunWarning": "Shorten the free run or fit to more runs; `held` in `simulate`'s result marks the rows.",
    "AdaptationWarning": "Check signs, units and diameter; use a source more like the target, or fit without one.",
    "EffectsWarning": "Use the corrected simulator, which includes the cause, instead of this model.",
    "SimulatorWarning": "Use the same seed, keep no state between calls, or correct the column.",
    "StreamChangeWarning": "Check the sensors; if the muscle has changed, fit again to the rows after the change.",
    "VolumeWarning": "Check units, signs and lengths; record runs that change the pressure faster.",
    "InterruptedFitWarning": "Nothing, if you stopped the fit; otherwise fit again.",
    "SamplingWarning": 'Resample with `pamid.signals.resample`, or pass `sampling="raise"` to refuse such logs.',
}
"""What a user does about each warning of `pamid.errors`; a class without an entry fails the tests of the pages."""


def warnings_() -> str:
    """Every warning of the package, what it means and what to do."""
    from pamid import errors

    found = [c for c in vars(errors).values() if isinstance(c, type) and issubclass(c, errors.PamidWarning)]
    body = [[f"`{c.__name__}`", summary(c), WHAT_TO_DO[c.__name__]] for c in found]
    return rows(["warning", "meaning", "what to do"], body)


TABLES: dict[str, Callable[[], str]] = {
    "estimators": estimators,
    "warnings": warnings_,
    "simulator_file": simulator_file,
    "data_sets": data_sets,
    "effects": effects,
    "volumes": volumes,
    "units": units,
    "commands": commands,
    "common_options": common_options,
    "log_options": log_options,
    "benchmarks": benchmarks,
}


def render(name: str) -> str:
    """Return the table of this name; ``command:fit`` is the options of ``pamid fit``."""
    kind, _, which = name.partition(":")
    return command(which) if kind == "command" else TABLES[kind]()


def updated(text: str) -> str:
    """Return a page with its tables made anew."""
    return MARKS.sub(lambda found: f"{found[1]}{render(found[2])}\n{found[3]}", text)


# --- stubs --------------------------------------------------------------------------------------------------
def stubs() -> dict[Path, str]:
    """Return the stub of every package that imports its names when they are first asked for."""
    from pamid.estimators._registry import class_locations

    found = {}
    for file in sorted((DOCS.parent / "pamid").rglob("__init__.py")):
        name = ".".join(file.parent.relative_to(DOCS.parent).parts)
        home = getattr(importlib.import_module(name), "_HOME", None)
        if home is not None:
            rooms = getattr(importlib.import_module(name), "_ROOMS", ())
            found[file.with_suffix(".pyi")] = stub({**home, **{room: "" for room in rooms}}, version=name == "pamid")
    tools = {"all_estimators": "_registry", "checked_instances": "_registry"}
    found[DOCS.parent / "estimators" / "__init__.pyi"] = stub({**tools, **class_locations()})
    return found


def stub(home: Mapping[str, str], version: bool = False) -> str:
    """Return the text of a stub from the module in which each name lives."""
    lines = ["# Written by python docs/tables.py.", ""]
    for module in sorted({*home.values()}):
        names = sorted(name for name, where in home.items() if where == module)
        lines += [f"from .{module} import {name} as {name}" for name in names]
    public = [*(["__version__"] if version else []), *(name for name, where in home.items() if where)]
    public.sort(key=lambda name: (not name.isupper(), not name[0].isupper(), name))
    lines += ["", *(["__version__: str", ""] if version else [])]
    return "\n".join([*lines, "__all__ = [", *(f'    "{name}",' for name in public), "]", ""])


def main() -> int:
    """Write or compare every page and stub."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="change nothing; exit with 1 if a page is out of date")
    check = parser.parse_args().check
    texts = {page: updated(page.read_text(encoding="utf-8")) for page in PAGES} | stubs()
    stale = [file for file, text in texts.items() if not file.exists() or file.read_text(encoding="utf-8") != text]
    for file in stale:
        if not check:
            file.write_text(texts[file], encoding="utf-8")
        print(f"{'out of date' if check else 'written'}: {file.relative_to(DOCS.parent)}")
    return int(check and bool(stale))


if __name__ == "__main__":
    sys.exit(main())
