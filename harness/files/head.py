"""Where in a text or a sheet the header words and units stand, and where the rows of numbers begin."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from harness.files.dialect import Dialect, Kind, kind
from harness.units import is_unit

DEEPEST = 500
"""Rows among which the first of numbers is looked for."""


@dataclass(frozen=True)
class Head:
    """The header words (none if there are none), units of a row of their own, the line of the words, the first row of
    numbers as a place in the rows, and how many rows before the header are left out."""

    words: Sequence[str]
    units: Sequence[str]
    line: int
    start: int
    skipped: int = 0


def find_head(lines: Sequence[str], comments: Sequence[tuple[int, str]], numbers: Sequence[int], dialect: Dialect) -> Head:
    """The head of the lines of a text; words may also stand in the last comment before the numbers."""
    head = head_of([dialect.split(line) for line in lines[:DEEPEST]], numbers, [dialect.split(line) for line in lines[-20:]])
    if head.words or head.start >= len(lines):
        return head
    width = len(dialect.split(lines[head.start]))
    before = [(number, dialect.split(text)) for number, text in comments if number < numbers[head.start]]
    fitting = [(number, words) for number, words in before if len(words) == width and _wholly_text(words)]
    if not fitting:
        return head
    if len(fitting) > 1 and _are_units(fitting[-1][1]):
        return Head(fitting[-2][1], fitting[-1][1], fitting[-2][0], head.start)
    return Head(fitting[-1][1], (), fitting[-1][0], head.start)


def head_of(rows: Sequence[Sequence[str]], numbers: Sequence[int], last: Sequence[Sequence[str]]) -> Head:
    """The head of rows of cells; `numbers`: the line of each; `last`: the last rows of all."""
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
        return Head((), (), 0, start, start)
    at, units = words[-1], tuple[str, ...]()
    for place in (words[-1], words[-1] - 1):
        if place in words and place - 1 in words and _are_units(rows[place]):
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


def _are_units(row: Sequence[str]) -> bool:
    """Whether every cell is a unit, in brackets or not, or empty."""
    bare = [cell.strip("[](){}<> ") for cell in row]
    return any(bare) and all(cell in ("", "-", "1") or is_unit(cell) for cell in bare)
