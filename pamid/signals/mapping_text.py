"""A mapping of columns as a commented TOML file."""

from collections.abc import Mapping, Sequence
from typing import Any

from ..toml_files import toml_key, toml_lines, toml_value


def mapping_text(
    signals: Mapping[str, Mapping[str, Any]],
    settings: Mapping[str, Any],
    comments: Mapping[str, str],
    unused: Sequence[str] = (),
    title: str = "",
) -> str:
    """Return a mapping as text that `pamid.signals.LogMapping.load` reads back."""
    lines = [f"# {_plain(title)}"] if title else []
    lines.append("# Names and units of this log; what is left out is as the log has it. All settings: docs/logs.md")
    plain = {k: v for k, v in settings.items() if not isinstance(v, Mapping) and k != "files"}
    lines += toml_lines(plain)
    if signals:
        lines += ["", "[signals]"]
    for name, entry in signals.items():
        comment = f"  # {_plain(comments[name])}" if comments.get(name) else ""
        lines.append(f"{toml_key(name)} = {toml_value(entry)}{comment}")
    for key, table in settings.items():
        if isinstance(table, Mapping) and table:
            lines += ["", f"[{key}]", *toml_lines(table)]
    for entry in settings.get("files", ()):
        lines += ["", "[[files]]", *toml_lines({key: entry[key] for key in ("match", "constants")})]
    if unused:
        lines += ["", "# Not used:", *(f"#   {_plain(text)}" for text in unused)]
    return "\n".join(lines) + "\n"


def _plain(text: str) -> str:
    """Return a text that stays within its comment."""
    return "".join(c if c.isprintable() else " " for c in text)
