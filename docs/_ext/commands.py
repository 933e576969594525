"""The reference of the command line: every command with all its options, as the parsers have them."""

from __future__ import annotations

import argparse

COMMON = ("help", "json", "quiet", "seed", "debug")
"""What every command takes."""


READING = ("columns", "encoding", "nan", "trust")
"""Options of reading a log, which have the same meaning in every command that takes them."""


def subparsers() -> dict[str, argparse.ArgumentParser]:
    """Return the parser of every command by its name."""
    from pamid.cli.app import build_parser

    (group,) = (a for a in build_parser()._actions if hasattr(a, "choices") and isinstance(a.choices, dict))
    return dict(group.choices)


def option(action: argparse.Action) -> tuple[str, str]:
    """Return how an option is written, and what it means."""
    metavar = action.metavar or ("{" + ",".join(map(str, action.choices)) + "}" if action.choices else "")
    flags = ", ".join(action.option_strings)
    return " ".join(part for part in (flags, str(metavar) if action.nargs != 0 else "") if part), action.help or ""


def usage(name: str) -> str:
    """Return a command with its own options on one line, those that may be left out in brackets."""
    parts, actions = [f"pamid {name}"], subparsers()[name]._actions
    shared = COMMON + (READING if any(a.dest == "log" for a in actions) else ())
    for action in (a for a in actions if a.dest not in shared):
        written = option(action)[0].split(", ")[-1]
        optional = not action.required and (action.option_strings or action.nargs in ("?", "*"))
        parts.append((f"[{written}]" if optional else written).replace(" ", "\N{NO-BREAK SPACE}"))
    return " ".join(parts)


def page() -> str:
    """Return the page of all commands, in reStructuredText."""
    parts = ["Commands and options", "====================", "", "As ``pamid COMMAND --help`` prints them.", ""]
    for name, parser in subparsers().items():
        parts += [f"pamid {name}", "-" * (len(name) + 6), "", (parser.description or "").strip().split("\n\n")[0], ""]
        for action in parser._actions:
            written, meaning = option(action)
            parts += [f"``{written}``", f"   {meaning}".replace("*", r"\*").replace("|", r"\|"), ""]
    return "\n".join(parts)
