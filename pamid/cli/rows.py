"""Which rows of a table count, by conditions such as ``F > 5``: the option ``--where`` of all commands that have it."""

from __future__ import annotations

import argparse
import operator
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..errors import ColumnTypeError, EmptyLogError, MissingColumnError, ParameterError

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

_CONDITION = re.compile(r"\s*(?P<column>[A-Za-z_]\w*)\s*(?P<sign><=|>=|<|>)\s*(?P<number>[-+.\deE]+)\s*")
_SIGNS = {"<": operator.lt, ">": operator.gt, "<=": operator.le, ">=": operator.ge}


def add_where(parser: argparse.ArgumentParser) -> None:
    """Add the option ``--where``."""
    parser.add_argument(
        "--where",
        metavar="'COLUMN > NUMBER'",
        action="append",
        default=[],
        help="use only rows that meet this condition, such as 'F > 5' to leave out a slack muscle; repeatable",
    )


def rows_where(table: pd.DataFrame, conditions: Sequence[str]) -> np.ndarray | None:
    """Return which rows of a table meet all conditions; None without conditions."""
    import numpy as np

    rows: np.ndarray | None = None
    for text in conditions:
        found = _CONDITION.fullmatch(text)
        try:
            limit = float(found["number"]) if found else float("nan")
        except ValueError:
            limit = float("nan")
        if found is None or not np.isfinite(limit):
            raise ParameterError(f"--where got {text!r}.", "COLUMN > NUMBER", "Write for instance --where 'F > 5'.")
        if found["column"] not in table.columns:
            raise MissingColumnError(
                f"--where names {found['column']}, but the table has {', '.join(map(str, table.columns[:20]))}.",
                "one of its columns",
                "Correct the name.",
            )
        try:
            values = table[found["column"]].to_numpy(dtype=float)
        except ValueError:
            raise ColumnTypeError(
                f"--where names {found['column']}, which holds text.", "a column of numbers", "Correct the name."
            ) from None
        meets = np.asarray(_SIGNS[found["sign"]](values, limit))
        rows = meets if rows is None else rows & meets
    if rows is not None and not rows.any():
        raise EmptyLogError(
            f"No row meets {' and '.join(repr(text) for text in conditions)}.",
            "at least one row",
            "Correct the numbers; they are in SI units.",
        )
    return rows
