"""Parquet logs."""

from pathlib import Path
from typing import Any

import pandas as pd

from pamid.errors import HostileLogError

from ..mapping import LogMapping
from . import Format, RawTable, flat_columns
from ._foreign import whole_file
from ._lists import unfolded


def read(path: Path, mapping: LogMapping, max_bytes: int) -> tuple[list[RawTable], pd.DataFrame | None]:
    """Read a parquet file as one table."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    errors = (pa.ArrowException, OSError, ValueError)
    with (
        whole_file(path, errors, "a complete parquet file", "Export or copy the log again."),
        pq.ParquetFile(path, page_checksum_verification=True) as file,
    ):
        schema, rows = file.schema_arrow, file.metadata.num_rows
        declared = rows * max(len(schema), 1) * 8
        if declared > max_bytes:
            raise HostileLogError(
                f"{path.name} declares {rows} rows of {len(schema)} columns ({declared / 2**30:.3g} GiB).",
                f"at most {max_bytes / 2**30:.3g} GiB",
                "Split the log, or raise max_bytes if the file can be trusted.",
            )
        frame = frame_of(file.read(columns=flat_columns(schema, mapping)), path)
    return [RawTable(frame)], None


def frame_of(table: Any, path: Path) -> pd.DataFrame:
    """Return rows of a parquet file as a table of numbers and names of runs."""
    from ..robots import places_of

    lists = any(str(field.type).startswith(("list", "fixed_size_list", "large_list")) for field in table.schema)
    frame = table.replace_schema_metadata(None).to_pandas()
    return unfolded(frame, places_of(path)) if lists else frame


FORMAT = Format("parquet", (".parquet", ".pq"), lambda head: head[:4] == b"PAR1", read)
