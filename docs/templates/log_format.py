"""Text logs that begin with ``MYLOG``. Copy to ``pamid/signals/formats/my_format.py``, change mark and reader."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pamid.errors import TruncatedLogError

from . import Format, RawTable

if TYPE_CHECKING:
    import pandas as pd

    from ..mapping import LogMapping


def read(path: Path, mapping: LogMapping, max_bytes: int) -> tuple[list[RawTable], pd.DataFrame | None]:
    """Read the table below the first line: names, then numbers, with semicolons between them."""
    import pandas as pd

    try:
        frame = pd.read_csv(path, skiprows=1, sep=";")
    except (ValueError, OSError) as error:
        raise TruncatedLogError(
            f"{path.name} holds no table: {error}.", "names and numbers", "Export it again."
        ) from None
    return [RawTable(frame)], None


FORMAT = Format("MYLOG", (".mylog",), lambda head: head.startswith(b"MYLOG"), read)
