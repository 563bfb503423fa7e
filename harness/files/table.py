"""A table as it stands in a file: columns with the words and units of its header, before anybody says what they mean."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Column:
    """One column: its header word without the unit ("" if the file has no header), its unit as written ("" if none).

    `values`, shape (n_rows,): not a number where a cell is empty. `number`: 1 for the first column.
    `time`: path of its own time axis, where the file holds several rates (MDF4, TDMS); "" if the table has one.
    """

    name: str
    unit: str
    values: NDArray[np.float64] = field(repr=False)
    number: int
    time: str = ""


@dataclass(frozen=True)
class Table:
    """The columns of a file in their order. `lines`, shape (n_rows,): line of each row in a text file; else empty."""

    path: Path
    columns: tuple[Column, ...]
    lines: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64), repr=False)

    def where(self, row: int) -> str:
        """The file and the place of a row, for messages."""
        return f"{self.path}, line {self.lines[row]}" if len(self.lines) else f"{self.path}, row {row + 1}"
