"""Parquet, by pyarrow: a column's unit stands in its metadata."""

from io import BytesIO
from pathlib import Path

from harness.files.cells import columns_of
from harness.files.table import Table


def read(path: Path, data: bytes) -> Table:
    """Every column by its name; what pandas has kept as its index is a column too."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    found = pq.read_table(BytesIO(data))
    nested = [field.name for field in found.schema if pa.types.is_nested(field.type)]
    found = found.drop_columns(nested)
    units = []
    for field in found.schema:
        metadata = field.metadata or {}
        units.append(next((metadata[key].decode() for key in (b"units", b"unit") if key in metadata), ""))
    columns, remarks = columns_of(found.to_pandas(ignore_metadata=True), [str(name) for name in found.column_names], units)
    told = [f"column {name} is left out: its cells are lists or structs" for name in nested]
    return Table(path, columns, remarks=(*told, *remarks))
