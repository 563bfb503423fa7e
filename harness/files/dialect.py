"""How a text file separates its columns and writes its numbers, told from all of its rows; what is open is refused."""

import csv
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum

from harness.errors import HarnessError

SEPARATORS = ("\t", ";", "|", ",", " ")
"""In the order in which they are preferred; the last stands for any run of spaces or tabs."""
MISSING = {
    *("", "nan", "-nan", "n/a", "#n/a", "na", "n.a.", "nv", "#nv", "null", "none", "nil", "missing", "<na>"),
    *("-", "--", "---", "?", "1.#qnan", "-1.#ind", "#value!", "#div/0!", "#ref!"),
}
"""Cells, in lower case, that hold no value."""
FIRST = 2000
"""Rows that settle how decimals are written, if they are of one mind."""
SAMPLE = 200
"""Rows from which the separator is told; the numbers of all rows are parsed by it, and refused where they do not fit."""
_NUMBER = re.compile(r"[+-]?(?:\d+[.,]?\d*|[.,]\d+|\d{1,3}(?:([.,'])\d{3})(?:\1\d{3})*(?:[.,]\d+)?)(?:[eE][+-]?\d+)?")
_INFINITE = re.compile(r"[+-]?inf(?:inity)?", re.IGNORECASE)
TIME = re.compile(
    r"\d{4}-\d\d-\d\d(?:[T ]\d\d:\d\d(?::\d\d(?:[.,]\d+)?)?(?: ?(?:Z|UTC|[+-]\d\d:?\d\d))?)?|\d{1,2}:\d\d:\d\d(?:[.,]\d+)?"
)
"""ISO 8601, or a time of day."""
_OPEN = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")
_POINTED = re.compile(r"[+-]?[1-9]\d{0,2}\.\d{3}")
"""A number whose point may stand before thousands."""
_GROUPED = re.compile(r"[+-]?\d{1,3}(?:,\d{3}){2,}|[+-]?\d{1,3}(?:,\d{3})+\.\d*")


class Kind(Enum):
    """What a cell looks like."""

    NUMBER = "number"
    TIME = "time"
    MISSING = "missing"
    TEXT = "text"


@dataclass(frozen=True)
class Dialect:
    """Separator (a blank: any run of blanks), sign of the decimals, and the sign between thousands, if any."""

    separator: str
    decimal: str = "."
    thousands: str | None = None

    def split(self, line: str) -> list[str]:
        """The cells of a line, without blanks or quotes around them."""
        return split(line, self.separator)


def split(line: str, separator: str) -> list[str]:
    """The cells of a line, without blanks or quotes around them."""
    if separator == " ":
        cells = re.findall(r'"[^"]*"|\S+', line) if '"' in line else line.split()
        return [cell.strip('"').strip() for cell in cells]
    if '"' in line:
        return [cell.strip() for cell in next(csv.reader([line.strip("\r\n")], delimiter=separator, skipinitialspace=True))]
    return [cell.strip() for cell in line.split(separator)]


def kind(cell: str) -> Kind:
    """What a cell looks like, before it is known how decimals are written."""
    if cell.lower() in MISSING:
        return Kind.MISSING
    if _NUMBER.fullmatch(cell) or _INFINITE.fullmatch(cell):
        return Kind.NUMBER
    return Kind.TIME if TIME.fullmatch(cell) else Kind.TEXT


def sniff(where: str, lines: Sequence[str]) -> Dialect:
    """The dialect of `lines`, those with content, in their order.

    HarnessError, beginning with `where`, if they can be read in more than one way.
    """
    middle = min(len(lines) // 2, max(0, len(lines) - SAMPLE))
    sample = lines[middle : middle + SAMPLE]
    separator = max(SEPARATORS, key=lambda each: _fitness(sample, each))
    cells = [split(line, separator) for line in sample]
    width = Counter(map(len, cells)).most_common(1)[0][0]
    if width == 1:
        separator = ";"  # there is none, and a comma is a decimal one
    if not any("," in line for line in lines):
        return Dialect(separator)
    if separator == ",":
        return _by_commas(where, lines, width)
    with suppress(HarnessError):
        first = _decimals(where, separator, _with_signs(lines[:FIRST], separator))
        if first.decimal == "," and not first.thousands:
            return first  # a later cell of another kind is no number, and is refused where it is used
    return _decimals(where, separator, _with_signs(lines, separator))


def _with_signs(lines: Sequence[str], separator: str) -> Iterator[str]:
    """The cells that hold a point or a comma."""
    return (cell for line in lines for cell in split(line, separator) if "," in cell or "." in cell)


def _fitness(sample: Sequence[str], separator: str) -> tuple[float, bool, int]:
    """How well a separator makes rows of equal length of what looks like numbers; then whether it separates anything."""
    rows = [split(line, separator) for line in sample]
    width, times = max(Counter(map(len, rows)).items(), key=lambda item: (item[1], item[0]))
    cells = [kind(cell) for row in rows if len(row) == width for cell in row]
    share = sum(each is not Kind.TEXT for each in cells) / len(cells)
    return round(share * times / len(rows) * (1.0 if width > 1 else 0.3), 2), width > 1, -SEPARATORS.index(separator)


def _by_commas(where: str, lines: Sequence[str], width: int) -> Dialect:
    """Commas between the columns: decimal commas can only stand in quotes."""
    quoted = [
        cell for line in lines if '"' in line for cell in split(line, ",") if "," in cell and kind(cell) is Kind.NUMBER
    ]
    if quoted:
        return _decimals(where, ",", (cell for line in lines if '"' in line for cell in split(line, ",")))
    if not any("." in line for line in lines):
        for line in lines:
            for cell in split(line, ","):
                if re.fullmatch(r"0\d+", cell):
                    raise HarnessError(
                        f"{where}: commas stand between its columns, and '{cell}' looks like decimals behind another comma; "
                        "separate the columns by semicolons, or write decimal points"
                    )
    return Dialect(",")


def _decimals(where: str, separator: str, cells: Iterable[str]) -> Dialect:
    """Which of point and comma is the decimal one, by the cells in which it can be nothing else."""
    comma, point, grouped, grouped_point, open_one = "", "", "", "", ""
    for cell in cells:
        if kind(cell) is not Kind.NUMBER:
            continue
        commas, points = cell.count(","), cell.count(".")
        if _GROUPED.fullmatch(cell):
            grouped = cell
        elif commas > 1 or points > 1 or (commas and points):
            if cell.rfind(",") < cell.rfind(".") or commas > 1:
                grouped = cell
            else:
                grouped_point = cell
        elif commas and _OPEN.fullmatch(cell):
            open_one = cell
        elif commas:
            comma = cell
        elif points and not (point and _POINTED.fullmatch(cell)):
            point = cell
    if comma and grouped:
        raise HarnessError(
            f"{where}: in '{comma}' the comma is a decimal one, in '{grouped}' it is not; write decimal points"
        )
    if grouped_point or comma:
        if point and not (grouped_point and _POINTED.fullmatch(point)):
            raise HarnessError(
                f"{where}: decimals are written as in '{comma or grouped_point}' and as in '{point}'; only one can be"
            )
        return Dialect(separator, ",", "." if grouped_point else None)
    if grouped:
        return Dialect(separator, ".", ",")
    if open_one and not point:
        raise HarnessError(
            f"{where}: '{open_one}' may have decimals or thousands behind its comma, and no other number tells; "
            "write decimal points"
        )
    return Dialect(separator, ".", "," if open_one else None)
