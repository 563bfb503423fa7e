"""What is in a file of columns: words, units, ranges, what each column is taken as or looks like, rate and gaps."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harness.actuators.actuator import Output
from harness.errors import HarnessError
from harness.files.reader import read_table
from harness.files.table import Column
from harness.logs.axes import axis_of
from harness.logs.find import find, find_times
from harness.logs.guess import OPEN, OPEN_MEANS, guesses
from harness.logs.mapping import KEYS, ColumnSpec, parse_specs
from harness.logs.ownrun import OWN_RUN, is_run, with_units
from harness.logs.run import GAP
from harness.logs.stimulus import DENSE

BLOCKS = "▁▂▃▄▅▆▇█"
WIDTH = 24
"""Characters of a curve."""


@dataclass(frozen=True)
class Described:
    """A column: range (None where it holds no number), rows without a value, what it is taken as (`port`) or, where it is
    not taken, looks like (`guess`) with the option that would accept it, and its curve in blocks."""

    number: int
    name: str
    unit: str
    low: float | None
    high: float | None
    missing: int
    rows: int
    port: str
    guess: str
    flag: str
    curve: str


@dataclass(frozen=True)
class Overview:
    """A file: its columns; rows a second and gaps by its column of times (None where none is known); what is remarked."""

    path: Path
    header: int
    columns: tuple[Described, ...]
    rate: float | None
    gaps: int | None
    remarks: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """As it is written to JSON."""
        return {**asdict(self), "path": str(self.path)}


def describe(path: Path, columns: Mapping[str, str] | None = None, output: Output | None = None) -> Overview:
    """What is in the file `path`, of any format; `columns` and `output` as for `read_log`.

    HarnessError if it cannot be read, or if `columns` names what is not there.
    """
    table, specs = with_units(read_table(path)), parse_specs(columns or {})
    own_run = bool(specs) and is_run(table)
    specs = {} if own_run else specs
    taken = {each.column.number: key for key, each in find([table], specs, KEYS).items()}
    times = find_times([table], table, table.columns[0], specs)
    offered = {guess.column.number: guess for guess in guesses(table, linear=output is not None and output.lead is not None)}
    if times is not None:
        taken[times.column.number] = "time"
    used = {*taken.values()}
    described = []
    for column in table.columns:
        guess = offered.get(column.number)
        if column.number in taken or (guess and guess.key in used) or (column.time and guess and guess.key == "time"):
            guess = None
        port = taken.get(column.number, "")
        described.append(
            _described(column, port, guess.key if guess else "", guess.flag if guess and guess.is_readable else "")
        )
    rate, gaps, remark = _pace(table.columns[0] if times is None else times.column, times)
    remarks = (
        *table.remarks,
        *([OWN_RUN] if own_run else []),
        *([remark] if remark else []),
        *_hints(described, specs, rate),
    )
    return Overview(path, table.header, tuple(described), rate, gaps, remarks)


def _hints(described: Sequence[Described], specs: Mapping[str, ColumnSpec], rate: float | None) -> list[str]:
    """What the numbers do not tell, and a user may know."""
    keys = {each.port or each.guess for each in described}
    hints = [OPEN_MEANS] if any(f"[{OPEN}]" in each.flag for each in described) else []
    said = any(spec.between for spec in specs.values())
    if "command" in keys and not said and rate is not None and rate * DENSE < 1.0:
        hints.append(
            f"{1e3 / rate:.3g} ms lie between rows: if you know it, say of the command behind its unit: held or ramped"
        )
    if "equivalent_current" in keys and "equivalent_current_filtered" not in keys and "equivalent_current" not in specs:
        hints.append(
            "a current that the drive has low-passed is equivalent_current_filtered; or say behind its unit: filtered 2 ms"
        )
    return hints


def _described(column: Column, port: str, guess: str, flag: str) -> Described:
    finite = column.values[np.isfinite(column.values)]
    number = finite.size > 0 and not column.labels
    return Described(
        column.number,
        column.name,
        column.unit,
        float(finite.min()) if number else None,
        float(finite.max()) if number else None,
        len(column.values) - finite.size,
        len(column.values),
        port,
        guess,
        flag,
        f"texts: {', '.join(column.labels[:3])}" if column.labels else curve(column.values),
    )


def curve(values: NDArray[np.float64], width: int = WIDTH) -> str:
    """The values, shape (n_rows,), as `width` blocks of eight heights: one row in each part; a blank where there is none."""
    parts = [part[np.isfinite(part)] for part in np.array_split(values, min(width, max(1, len(values))))]
    finite = values[np.isfinite(values)]
    if not finite.size:
        return ""
    low, span = float(finite.min()), float(np.ptp(finite))
    heights = [round(7 * (float(part[len(part) // 2]) - low) / span) if span > 0.0 and part.size else 0 for part in parts]
    return "".join(BLOCKS[height] if part.size else " " for height, part in zip(heights, parts, strict=True))


def _pace(column: Column, times: Any) -> tuple[float | None, int | None, str]:
    """Rows a second, gaps, and a remark if times fall (as they do where a file holds several runs)."""
    if times is None or len(column.values) < 2:
        return None, None, ""
    try:
        time = axis_of(times).time
    except HarnessError as error:
        return None, None, str(error)
    distance = np.diff(time)
    rising = distance[distance > 0.0]
    if not rising.size:
        return None, None, "the times do not rise"
    usual = float(np.median(rising))
    falls = int(np.count_nonzero(distance <= 0.0))
    told = f"the times restart or repeat {falls} time(s): several runs?" if falls else ""
    return 1.0 / usual, int(np.count_nonzero(rising > GAP * usual)), told
