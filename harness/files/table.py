"""A table as it stands in a file: columns with the words and units of its header, before anybody says what they mean."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Column:
    """One column: its header word without the unit ("" if the file has no header), its unit as written ("" if none).

    `values`, shape (n_rows,): not a number where a cell is empty. `number`: 1 for the first column.
    `time`: name of its own time axis, where the file holds several rates (MDF4, TDMS); "" if the table has one.
    `labels`: the texts of a column whose cells are not all numbers; its values are places in them, and `odd` is the first
    row that is no number. `epoch`: of a column of dates or times of day, whose values are seconds since the first row:
    seconds from 1970 (or midnight) to that row. `seconds`: times that are in s by the format, whatever anybody states.
    """

    name: str
    unit: str
    values: NDArray[np.float64] = field(repr=False)
    number: int
    time: str = ""
    labels: tuple[str, ...] = ()
    odd: int = 0
    epoch: float | None = None
    seconds: bool = False

    @property
    def called(self) -> str:
        """What messages call it."""
        return self.name or str(self.number)


@dataclass(frozen=True)
class Table:
    """The columns of a file in their order. `lines`, shape (n_rows,): line of each row in a text file; else empty.

    `header`: line of the header words in a text file, 0 if there are none. `remarks`: a line for each thing that was left
    out or turned into something else.
    """

    path: Path
    columns: tuple[Column, ...]
    lines: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64), repr=False)
    header: int = 0
    remarks: tuple[str, ...] = ()

    def where(self, row: int) -> str:
        """The file and the place of a row, for messages."""
        return f"{self.path}, line {self.lines[row]}" if len(self.lines) else f"{self.path}, row {row + 1}"

    @property
    def at_header(self) -> str:
        """The file and the place of its header words, for messages."""
        return f"{self.path}, line {self.header}" if self.header else str(self.path)
