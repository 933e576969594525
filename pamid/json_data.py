"""What JSON knows: plain dicts, lists, text and finite numbers."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any


def json_ready(value: Any) -> Any:
    """Return plain data: dataclasses as dicts, tuples and arrays as lists, numbers that are not finite as None."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: json_ready(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(k): json_ready(v) for k, v in value.items()}
    to_list = getattr(value, "tolist", None)
    if callable(to_list):  # numpy's arrays and numbers
        value = to_list()
    if isinstance(value, list | tuple):
        return [json_ready(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
