"""Trainings that survive being killed: state on disk, whole, in a file named after what is being trained."""

import hashlib
import io
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ..errors import CheckpointError, OutputError
from ..files import write_whole

EVERY = 10.0
"""Seconds between two writes; a training that is killed loses no more than that."""

_FORMAT = 1


def fingerprint(*parts: Any) -> str:
    """Return a name for a training: 24 digits that follow from its data, start, settings and random numbers."""
    digest = hashlib.sha256()
    _feed(digest, parts)
    return digest.hexdigest()[:24]


def _feed(digest: Any, part: Any) -> None:
    if isinstance(part, torch.Tensor):
        part = part.detach().cpu().numpy()
    if isinstance(part, np.ndarray):
        digest.update(f"array {part.dtype} {part.shape} ".encode())
        digest.update(np.ascontiguousarray(part).tobytes())
    elif isinstance(part, dict):
        _feed(digest, sorted(part.items()))
    elif isinstance(part, (list, tuple)):
        digest.update(f"{len(part)} parts ".encode())
        for p in part:
            _feed(digest, p)
    elif hasattr(part, "__dataclass_fields__") or (hasattr(part, "__dict__") and not callable(part)):
        digest.update(type(part).__name__.encode())
        _feed(digest, vars(part))
    else:
        digest.update(f"{part!r} ".encode())


class Resumption:
    """State of one training, in a folder that may hold those of many."""

    def __init__(self, folder: str | Path, name: str) -> None:
        self.path = Path(folder) / f"{name}.npz"
        self._written = -np.inf
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(
                f"The folder {folder} cannot be made: {error.strerror or error}.", "a folder", "Choose another path."
            ) from None

    def load(self) -> dict[str, Any] | None:
        """Return the last state that was written; None if there is none."""
        if not self.path.exists():
            return None
        try:
            with np.load(io.BytesIO(self.path.read_bytes()), allow_pickle=False) as found:
                content = json.loads(found["content"].tobytes().decode())
                if content["format"] != _FORMAT:
                    raise ValueError(f"format {content['format']}")
                return _unpacked(content["state"], found)
        except Exception as error:  # a damaged archive fails in many ways
            raise CheckpointError(
                f"{self.path} is not a checkpoint: {str(error)[:80]}.",
                "a file that an interrupted training has left",
                "Delete it to start again.",
            ) from None

    def save(self, state: dict[str, Any], *, at_once: bool = False) -> None:
        """Write the state of an iteration, if the last write is long enough ago."""
        now = time.monotonic()
        if not at_once and now - self._written < EVERY:
            return
        arrays: dict[str, np.ndarray] = {}
        content = {"format": _FORMAT, "state": _packed(state, arrays)}
        archive = io.BytesIO()
        arrays["content"] = np.frombuffer(json.dumps(content).encode(), dtype=np.uint8)
        np.savez(archive, **arrays)  # type: ignore[arg-type]
        write_whole(self.path, archive.getvalue())
        self._written = time.monotonic()


def _packed(value: Any, arrays: dict[str, np.ndarray]) -> Any:
    """Return JSON data in which arrays and tensors are names of `arrays`."""
    if isinstance(value, torch.Tensor):
        return {"tensor": _stored(value.detach().cpu().numpy(), arrays), "device": str(value.device)}
    if isinstance(value, np.ndarray):
        return {"array": _stored(value, arrays)}
    if isinstance(value, dict):
        return {"dict": {k: _packed(v, arrays) for k, v in value.items()}}
    if isinstance(value, (list, tuple)):
        if len(value) > 8 and all(isinstance(v, float) for v in value):
            return {"floats": _stored(np.array(value), arrays)}
        return {"list": [_packed(v, arrays) for v in value]}
    return value


def _stored(value: np.ndarray, arrays: dict[str, np.ndarray]) -> str:
    name = f"a{len(arrays)}"
    arrays[name] = value
    return name


def _unpacked(value: Any, arrays: Any) -> Any:
    if not isinstance(value, dict):
        return value
    if "tensor" in value:
        return torch.as_tensor(arrays[value["tensor"]], device=value["device"])
    if "array" in value:
        return arrays[value["array"]]
    if "floats" in value:
        return arrays[value["floats"]].tolist()
    if "list" in value:
        return [_unpacked(v, arrays) for v in value["list"]]
    return {k: _unpacked(v, arrays) for k, v in value["dict"].items()}
