"""The file of designed runs: one TOML table per run, for ``pamid simulate --runs``."""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...bench.references import Trajectory
from ...errors import LogFormatError, ParameterError
from ...toml_files import toml_lines
from .family import DesignedRun, Limits

_LIMIT = 1 << 20


def runs_text(runs: Sequence[Any], names: Sequence[str], header: str = Limits.header) -> str:
    """Return runs as the text of a file."""
    lines = [f"# {header}", ""]
    for run, name in zip(runs, names, strict=True):
        lines += ["[[run]]", *toml_lines({"name": name, **run.as_dict()}), f"# {run.words}", ""]
    return "\n".join(lines)


def read_runs(path: str | Path) -> list[Trajectory]:
    """Read the runs of a file."""
    file = Path(path)
    try:
        if file.stat().st_size > _LIMIT:
            raise ValueError("it is larger than 1 MiB")
        found = tomllib.loads(file.read_text(encoding="utf-8"))
        tables = [dict(t) for t in found["run"]]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise LogFormatError(
            f"{file} cannot be read: {type(error).__name__}: {error}.",
            "a file of runs, as 'pamid next' writes it: tables [[run]] with kind and seconds",
            "Correct it, or let 'pamid next' write it anew.",
        ) from error
    runs = []
    for k, entry in enumerate(tables, start=1):
        name = entry.pop("name", f"run-{k}")
        if not isinstance(name, str):
            raise ParameterError(f"Run {k} of {file.name} has the name {name!r}.", "a text", "Put it in quotes.")
        runs.append(DesignedRun.from_dict(entry).trajectory(name))
    return runs
