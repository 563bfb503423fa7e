"""Where in a text or a sheet the header words and units stand, and where the rows of numbers begin."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from harness.errors import HarnessError
from harness.files.dialect import Dialect, Kind, kind
from harness.files.header import is_port
from harness.units import is_unit

DEEPEST = 500
"""Rows among which the first of numbers is looked for."""


@dataclass(frozen=True)
class Head:
    """The header words (none if there are none), units of a row of their own, the line of the words, the first row of
    numbers as a place in the rows, and how many rows before the header, or before the numbers, are left out."""

    words: Sequence[str]
    units: Sequence[str]
    line: int
    start: int
    skipped: int = 0

    @property
    def remarks(self) -> tuple[str, ...]:
        """What is to be said about the rows that are left out."""
        before = "the header" if self.words else "the first row of values"
        return (f"{self.skipped} line(s) before {before} are left out",) if self.skipped else ()


def find_head(
    where: str, lines: Sequence[str], comments: Sequence[tuple[int, str]], numbers: Sequence[int], dialect: Dialect
) -> Head:
    """The head of the lines of a text; words may also stand in the last comment before the numbers."""
    first, last = ([dialect.split(line) for line in part] for part in (lines[:DEEPEST], lines[-20:]))
    head = head_of(where, first, numbers, last)
    if head.words or head.start >= len(lines):
        return head
    width = len(dialect.split(lines[head.start]))
    before = [(number, dialect.split(text)) for number, text in comments if number < numbers[head.start]]
    fitting = [(number, words) for number, words in before if len(words) == width and _wholly_text(words)]
    if not fitting:
        return head
    if len(fitting) > 1 and _are_units(fitting[-1][1], fitting[-2][1]):
        return Head(fitting[-2][1], fitting[-1][1], fitting[-2][0], head.start)
    return Head(fitting[-1][1], (), fitting[-1][0], head.start)


def head_of(where: str, rows: Sequence[Sequence[str]], numbers: Sequence[int], last: Sequence[Sequence[str]]) -> Head:
    """The head of rows of cells; `numbers`: the line of each; `last`: the last rows of all.

    HarnessError, beginning with the file `where`, if the first row may be a header of numbers.
    """
    with_numbers = [row for row in (*rows, *last) if not _wholly_text(row)]
    lengths = Counter(len(_trimmed(row)) for row in with_numbers)
    if not lengths:
        return Head(_trimmed(rows[0]), (), numbers[0], len(rows))
    width = max(lengths, key=lambda length: (lengths[length], length))
    pattern = [kind(cell) is Kind.TEXT for cell in last[-1]]
    first = next((n for n, row in enumerate(rows) if len(row) >= width and _is_row(row[:width], pattern)), len(rows))
    words = [n for n in range(min(first, len(rows))) if _wholly_text(rows[n]) and len(_trimmed(rows[n])) >= min(width, 2)]
    if not words:
        start = next(n for n, row in enumerate(rows) if not _wholly_text(row) and len(row) >= min(width, 2))
        start += _are_column_numbers(
            f"{where}, line {numbers[start]}",
            rows[start],
            [row for row in (*rows[start + 1 :], *last) if row != rows[start]],
        )
        return Head((), (), 0, start, start)
    at, units = words[-1], tuple[str, ...]()
    for place in (words[-1], words[-1] - 1):
        if place in words and place - 1 in words and _are_units(rows[place], rows[place - 1]):
            at, units = place - 1, tuple(rows[place])
            break
    return Head(_trimmed(rows[at]), units, numbers[at], words[-1] + 1, at)


def _is_row(row: Sequence[str], pattern: Sequence[bool]) -> bool:
    """Whether every cell is a number, a time or missing, or is text where the last row has text too."""
    texts = [kind(cell) is Kind.TEXT for cell in row]
    return not _wholly_text(row) and (not any(texts) or texts == list(pattern))


def _wholly_text(row: Sequence[str]) -> bool:
    """Whether no cell holds a number or a time."""
    return all(kind(cell) in (Kind.TEXT, Kind.MISSING) for cell in row) and any(kind(cell) is Kind.TEXT for cell in row)


def _trimmed(row: Sequence[str]) -> list[str]:
    """The row without the empty cells at its end."""
    last = max((place for place, cell in enumerate(row) if cell), default=-1)
    return list(row[: last + 1])


def _are_units(row: Sequence[str], above: Sequence[str]) -> bool:
    """Whether the cells below the words `above` are units, in brackets or not: all of them, or most of them where the
    words are none; or some, where words are ports' names and these are none. What is no unit is refused where it is used."""
    cells = [cell for cell in row if cell.strip("[](){}<> ") not in ("", "-", "1")]
    units = sum(map(_is_like_a_unit, cells))
    if units == len(cells):
        return bool(cells)
    if any(map(is_port, cells)):
        return False
    return 2 * units > len(cells) > 2 * sum(map(_is_like_a_unit, above)) or (units > 0 and any(map(is_port, above)))


def _is_like_a_unit(cell: str) -> bool:
    bare = cell.strip("[](){}<> ")
    return is_unit(bare) or (cell[:1] in ("[", "(") and cell[-1:] in ("]", ")"))


def _are_column_numbers(where: str, row: Sequence[str], others: Sequence[Sequence[str]]) -> bool:
    """Whether a first row 0, 1, 2, ... (or from 1 on) numbers the columns, as tables without names are written.

    HarnessError where it may as well hold values: where whole numbers are written that way in other rows too.
    """
    cells = list(row[1:] if row and not row[0] else row)
    counted = [[str(n) for n in range(first, first + len(cells))] for first in (0, 1)]
    if len(cells) < 2 or cells not in counted:
        return False
    written = any(cell.isdigit() for other in others for cell in other[len(row) - len(cells) :])
    if len(cells) < len(row) or (not written and (len(cells) > 2 or _begins_again(row, others))):
        return True
    if written and len(cells) == 2:
        return False
    raise HarnessError(
        f"{where}: '{', '.join(cells)}' may number the columns or be a row of values; take it away, or write words above it"
    )


def _begins_again(row: Sequence[str], others: Sequence[Sequence[str]]) -> bool:
    """Whether the first column does not rise from this row to the next."""
    try:
        return bool(others) and float(others[0][0].replace(",", ".")) <= float(row[0])
    except (ValueError, IndexError):
        return False
