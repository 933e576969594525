"""Long work in steps that survive being killed: each finished step is on disk, whole, before the next begins."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .errors import CheckpointError
from .files import write_whole

_FORMAT = 1


class Checkpoint:
    """Results of steps by name, in a file that is replaced as a whole after each step.

    Parameters
    ----------
    path : path-like
        The file; read if it exists.
    settings : dict, optional
        What the results depend on, as JSON. A file of other settings is refused rather than mixed in.

    Raises
    ------
    CheckpointError
        The file is no checkpoint, or one of other settings.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from pamid.checkpoint import Checkpoint
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "work.json"
    >>> Checkpoint(file).step("sum", lambda: 1 + 1)
    2
    >>> Checkpoint(file).step("sum", lambda: 1 / 0)  # done before, so not done again
    2
    """

    def __init__(self, path: str | Path, settings: dict[str, Any] | None = None) -> None:
        self.path = Path(path)
        self.settings = json.loads(json.dumps(settings or {}))
        self.results: dict[str, Any] = {}
        if self.path.exists():
            self.results = self._read()

    def step(self, name: str, compute: Callable[[], Any]) -> Any:
        """Return the result of a step: from the file if it is there, else computed and kept."""
        if name not in self.results:
            result = json.loads(json.dumps(compute()))
            self.results[name] = result
            whole = {"pamid_checkpoint": _FORMAT, "settings": self.settings, "results": self.results}
            write_whole(self.path, json.dumps(whole))
        return self.results[name]

    def _read(self) -> dict[str, Any]:
        try:
            found = json.loads(self.path.read_text(encoding="utf-8"))
            results, settings, version = found["results"], found["settings"], found["pamid_checkpoint"]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise CheckpointError(
                f"{self.path} is not a checkpoint: {str(error)[:80]}.",
                "a file that an interrupted run has left",
                "Choose another file, or delete this one to start again.",
            ) from None
        if version != _FORMAT or settings != self.settings or not isinstance(results, dict):
            raise CheckpointError(
                f"{self.path} is the checkpoint of another run, with {json.dumps(settings)[:120]}.",
                f"one with {json.dumps(self.settings)[:120]}",
                "Choose another file, or delete this one to start again.",
            )
        return results
