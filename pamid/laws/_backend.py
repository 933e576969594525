"""Pick the array library of the inputs, so that one formula serves numpy arrays and torch tensors.

The laws use only functions that both libraries name alike (``sqrt``, ``exp``, ``where``, ``cos`` ...);
torch is looked up, never imported: it can only be among the inputs if the caller has loaded it.
"""

import sys
from types import ModuleType
from typing import Any

import numpy as np


def namespace(*arrays: Any) -> ModuleType:
    """Return ``torch`` if any input is a torch tensor, else ``numpy``."""
    torch = sys.modules.get("torch")
    if torch is not None and any(isinstance(a, torch.Tensor) for a in arrays):
        return torch
    return np
