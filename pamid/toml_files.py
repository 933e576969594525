"""Small TOML files that people write, read with care: a page of text, and nothing that hangs or fills the memory."""

import json
import re
import stat
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from .errors import PamidError

MAX_BYTES = 1_000_000
"""Such a file holds a page of text; what is much larger is something else."""

_LONG_KEY = re.compile(r"(?<![\w\"'-])(?:[\w\"'-]+[ \t]*\.[ \t]*){17}")
"""Keys nest two deep in every file of pamid; parsing time grows with the square of the depth."""


class TomlErrors(NamedTuple):
    """Which errors a kind of file raises."""

    missing: type[PamidError]
    oversized: type[PamidError]
    broken: type[PamidError]
    """There is no such file, it is far too large, or it is no TOML."""


def read_toml(path: str | Path, what: str, errors: TomlErrors) -> dict[str, Any]:
    """Read a TOML file of at most a megabyte."""
    text = read_small_text(Path(path), what, errors)
    if _LONG_KEY.search(text):
        raise errors.broken(f"{path} has a key of more than 17 parts.", f"{what} with short keys", "Correct it.")
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # a ValueError also of numbers of thousands of digits
        raise errors.broken(
            f"{path} is not valid TOML: {str(error).split(';')[0]}.", f"{what} with lines name = number", "Correct it."
        ) from None


def read_small_text(path: Path, what: str, errors: TomlErrors) -> str:
    """Read a text in UTF-8 of at most a megabyte."""
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode):
            kind = "a folder" if stat.S_ISDIR(found.st_mode) else "not a regular file"
            raise errors.missing(f"{path} cannot be read: it is {kind}.", what, "Name a file.")
        if found.st_size > MAX_BYTES:
            raise errors.oversized(
                f"{path} holds {found.st_size:,} bytes.", f"at most {MAX_BYTES:,}", f"Name {what}, not a log."
            )
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise errors.broken(f"{path} is not text in UTF-8 (byte {error.start}).", what, "Save it as UTF-8.") from None
    except (OSError, ValueError) as error:
        if isinstance(error, PamidError):
            raise
        said = getattr(error, "strerror", None) or error
        raise errors.missing(f"{path} cannot be read: {said}.", what, "Check the path and its permissions.") from None


def toml_key(name: str) -> str:
    """Return a name as a key: bare where TOML allows it, else in quotes."""
    return name if name.isascii() and name.replace("_", "").isalnum() else toml_value(name)


def toml_value(value: Any) -> str:
    r"""Return a boolean, number, text, or list or table of these on one line as TOML, any characters escaped."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")
    if isinstance(value, list | tuple):
        return f"[{', '.join(toml_value(v) for v in value)}]"
    if isinstance(value, Mapping):
        return f"{{ {', '.join(toml_lines(value))} }}"
    return repr(float(value) if isinstance(value, float) else value)  # without the name of a type of numpy's


def toml_lines(table: Mapping[str, Any]) -> list[str]:
    """Return the lines of a table."""
    return [f"{toml_key(name)} = {toml_value(value)}" for name, value in table.items()]
