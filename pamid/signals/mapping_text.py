"""A mapping of columns as a commented TOML file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any


def mapping_text(
    signals: Mapping[str, Mapping[str, Any]],
    settings: Mapping[str, Any],
    comments: Mapping[str, str],
    unused: Sequence[str] = (),
    title: str = "",
) -> str:
    """Return a mapping as text that `pamid.signals.LogMapping.load` reads back.

    Parameters
    ----------
    signals : mapping of str to mapping
        Settings of each signal, as in `SignalMapping`.
    settings : mapping of str to object
        Other settings of `LogMapping`; ``constants`` is a table, ``files`` a list of tables.
    comments : mapping of str to str
        What to say beside a signal.
    unused : sequence of str
        Lines about columns that nothing uses.
    title : str, default=""
        First comment.

    Returns
    -------
    str
        TOML.

    Examples
    --------
    >>> from pamid.signals.mapping_text import mapping_text
    >>> print(mapping_text({"x": {"column": 4, "unit": "mm"}}, {"skip_rows": 2}, {"x": "stroke"}).splitlines()[-1])
    x = { column = 4, unit = "mm" }  # stroke
    """
    lines = [f"# {_plain(title)}"] if title else []
    lines.append("# Names and units of this log; what is left out is as the log has it. All settings: docs/logs.md")
    plain = {k: v for k, v in settings.items() if not isinstance(v, Mapping) and k != "files"}
    lines += [f"{key} = {_value(value)}" for key, value in plain.items()]
    if signals:
        lines += ["", "[signals]"]
    for name, entry in signals.items():
        inside = ", ".join(f"{key} = {_value(value)}" for key, value in entry.items())
        comment = f"  # {_plain(comments[name])}" if comments.get(name) else ""
        lines.append(f"{_key(name)} = {{ {inside} }}{comment}")
    for key, table in settings.items():
        if isinstance(table, Mapping) and table:
            lines += ["", f"[{key}]", *(f"{_key(name)} = {_value(value)}" for name, value in table.items())]
    for entry in settings.get("files", ()):
        inside = ", ".join(f"{_key(name)} = {_value(value)}" for name, value in entry["constants"].items())
        lines += ["", "[[files]]", f"match = {_value(entry['match'])}", f"constants = {{ {inside} }}"]
    if unused:
        lines += ["", "# Not used:", *(f"#   {_plain(text)}" for text in unused)]
    return "\n".join(lines) + "\n"


def _plain(text: str) -> str:
    """Return a text that stays within its comment."""
    return "".join(c if c.isprintable() else " " for c in text)


def _key(name: str) -> str:
    return name if name.isascii() and name.replace("_", "").isalnum() else _value(name)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(v) for v in value)}]"
    return repr(value)
