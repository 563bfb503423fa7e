"""Excel's .xlsx, by openpyxl: the first sheet that holds rows of numbers."""

from datetime import date, datetime, time
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from harness.errors import HarnessError
from harness.files.cells import columns_of
from harness.files.dialect import Kind, kind
from harness.files.head import head_of
from harness.files.table import Table


def read(path: Path, data: bytes) -> Table:
    """The sheet as text files are read: words, units, rows; formulas by the values that Excel has stored."""
    import openpyxl

    book = openpyxl.load_workbook(BytesIO(data), read_only=True, data_only=True)
    for sheet in book.worksheets:
        numbered = [
            (n, row) for n, row in enumerate(sheet.iter_rows(values_only=True), start=1) if any(c is not None for c in row)
        ]
        rows = [[_text(cell) for cell in row] for _, row in numbered]
        if not any(kind(cell) is Kind.NUMBER for row in rows for cell in row):
            continue
        numbers = [n for n, _ in numbered]
        head = head_of(str(path), rows, numbers, rows[-20:])
        width = max(map(len, rows[head.start :]))
        words = [*head.words, *[""] * (width - len(head.words))] if head.words else ()
        body = [[*row, *[""] * (width - len(row))] for row in rows[head.start :]]
        columns, remarks = columns_of(pd.DataFrame(body), words, head.units)
        told = [f"sheet '{sheet.title}' is read; the file has {len(book.worksheets)}"] if len(book.worksheets) > 1 else []
        return Table(
            path, columns, np.array(numbers[head.start :], dtype=np.int64), head.line, (*told, *head.remarks, *remarks)
        )
    raise HarnessError(f"{path}: no sheet holds a number")


def _text(cell: Any) -> str:
    if cell is None:
        return ""
    if isinstance(cell, datetime | date | time):
        return cell.isoformat()
    if isinstance(cell, int) and not isinstance(cell, bool):
        return str(cell)
    return repr(float(cell)) if isinstance(cell, bool | float) else str(cell).strip()
