"""Text files: CSV and its relatives, in whatever dialect loggers and spreadsheets write."""

import csv
import io
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from harness.errors import HarnessError
from harness.files import dialect as dialects
from harness.files.cells import columns_of
from harness.files.dialect import Dialect, Kind, kind
from harness.files.head import Head, find_head
from harness.files.table import Table

COMMENTS = ("#", "%", "//")
MARKS = {
    b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe\0\0": "utf-32", b"\0\0\xfe\xff": "utf-32",
    b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16",
}  # fmt: skip
"""First bytes of a text, and its encoding; the longer ones first."""
_OLD = tuple(int(part) for part in pd.__version__.split(".")[:2]) < (3, 1)
EXACT: dict[str, Any] = {"float_precision": "round_trip"} if _OLD else {}
"""Numbers to the last bit, as Python reads them; pandas does so by itself from 3.1 on, and warns if it is asked to."""


def decode(path: Path, data: bytes) -> str:
    """The text of `data`: UTF-8, UTF-16 or UTF-32, with or without a mark, else Latin-1 as Windows writes it."""
    for mark, encoding in MARKS.items():
        if data.startswith(mark):
            return _decoded(path, data, encoding)
    begin = data[:4000]
    for encoding, zeros in (
        ("utf-32-le", begin[2::4] + begin[3::4]), ("utf-32-be", begin[0::4] + begin[1::4]),
        ("utf-16-le", begin[1::2]), ("utf-16-be", begin[0::2]),
    ):  # fmt: skip
        if len(begin) > 7 and zeros.count(0) > 0.9 * len(zeros):
            return _decoded(path, data, encoding)
    if re.search(rb"[\x00-\x08\x0e-\x1a\x1c-\x1f]", data):
        raise HarnessError(f"{path}: is no text file, and none of the binary formats that can be read")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")


def _decoded(path: Path, data: bytes, encoding: str) -> str:
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        raise HarnessError(f"{path}: is not the {encoding.upper()} text that it begins as ({error.reason})") from None


def read_text(path: Path, data: bytes) -> Table:
    """The table of a text file.

    Lines that are blank are left out, those that begin with #, % or // and are no rows, and what stands before the header
    words. HarnessError, with the line, for rows of unequal length, and for what can be read in more than one way.
    """
    numbers, lines, comments = _content(decode(path, data))
    if not lines:
        raise HarnessError(f"{path}: the file is empty; a header such as 'time,command' and rows of numbers are needed")
    try:
        dialect = dialects.sniff(str(path), lines)
        numbers, lines, comments = _with_marked_rows(numbers, lines, comments, dialect)
        head = find_head(str(path), lines, [(n, text.lstrip("#%/ ")) for n, text in comments], numbers, dialect)
        _check_thousands(path, lines, numbers, head, dialect)
        width = _width(path, lines, numbers, head, dialect)
    except csv.Error as error:
        raise HarnessError(f"{path}: cannot be read as CSV: {error}") from None
    frame = _parsed(path, lines[head.start :], width, dialect)
    places = np.array(numbers[head.start :], dtype=np.int64)
    columns, remarks = columns_of(frame, head.words, head.units, dialect)
    return Table(path, columns, places, head.line, (*head.remarks, *remarks))


def _content(text: str) -> tuple[list[int], list[str], list[tuple[int, str]]]:
    """Number and text of each line with content, and of each comment; a line that ends within quotes goes on in the next."""
    numbers, lines, comments = [], [], []
    rest, begun = "", 0
    for number, line in enumerate(re.split(r"\r\n|\n|\r", text), start=1):
        whole = f"{rest} {line}" if rest else line
        if '"' in whole and whole.count('"') % 2 and number - (begun or number) < 5:
            rest, begun = whole, begun or number
            continue
        bare = whole.strip()
        if bare.startswith(COMMENTS):
            comments.append((begun or number, bare))
        elif bare:
            numbers.append(begun or number)
            lines.append(whole)
        rest, begun = "", 0
    if rest:
        numbers.append(begun)
        lines.append(rest)
    return numbers, lines, comments


def _with_marked_rows(
    numbers: list[int], lines: list[str], comments: list[tuple[int, str]], dialect: Dialect
) -> tuple[list[int], list[str], list[tuple[int, str]]]:
    """The lines with those comments that are rows: whose first cell is one without a value, such as #N/A, or which have as
    many cells as the rows, and numbers where those have, behind the first line of that width."""
    texts = [kind(cell) is Kind.TEXT for cell in dialect.split(lines[-1])]
    begin = next(number for number, line in zip(numbers, lines, strict=True) if len(dialect.split(line)) == len(texts))

    def is_row(number: int, text: str) -> bool:
        cells = dialect.split(text)
        like = [kind(cell) is Kind.TEXT for cell in cells[1:]] == texts[1:] and not all(texts[1:]) and number > begin
        return len(cells) == len(texts) and (kind(cells[0]) is Kind.MISSING or like)

    marked = [each for each in comments if is_row(*each)]
    if not marked:
        return numbers, lines, comments
    whole = sorted([*zip(numbers, lines, strict=True), *marked])
    return [number for number, _ in whole], [line for _, line in whole], [each for each in comments if each not in marked]


def _check_thousands(path: Path, lines: list[str], numbers: list[int], head: Head, dialect: Dialect) -> None:
    """HarnessError for a number whose signs between thousands stand elsewhere: pandas takes them away wherever they are."""
    sign = dialect.thousands
    if sign is None:
        return
    right = re.compile(rf"[+-]?\d{{1,3}}(?:{re.escape(sign)}\d{{3}})+(?:{re.escape(dialect.decimal)}\d*)?(?:[eE][+-]?\d+)?")
    for place in range(head.start, len(lines)):
        cells = dialect.split(lines[place]) if sign in lines[place] else []
        for column, cell in enumerate(cells):
            if sign in cell and kind(cell.replace(sign, "")) is Kind.NUMBER and not right.fullmatch(cell):
                name = head.words[column] if column < len(head.words) else column + 1
                raise HarnessError(
                    f"{path}, line {numbers[place]}, column {name}: '{cell}': behind a '{sign}' between thousands "
                    "stand three digits; write decimal points, and nothing between thousands"
                )


def _width(path: Path, lines: list[str], numbers: list[int], head: Head, dialect: Dialect) -> int:
    """The columns of each row of numbers; empty cells behind the last column are cut off in `lines`."""
    separator = dialect.separator
    rows = lines[head.start :]
    if separator == " ":
        counts = [len(dialect.split(line)) for line in rows]
    else:
        counts = [len(dialect.split(line)) if '"' in line else line.count(separator) + 1 for line in rows]
    if not counts:
        return len(head.words)
    width = len(head.words) or Counter(counts).most_common(1)[0][0]
    for place, count in enumerate(counts, start=head.start):
        if count == width:
            continue
        cells = dialect.split(lines[place])
        if count < width or any(cells[width:]):
            than = "but the header has" if head.words else "where other rows have"
            raise HarnessError(f"{path}, line {numbers[place]}: {count} values, {than} {width} columns")
        lines[place] = (" " if separator == " " else separator).join(
            f'"{cell}"' if separator in cell else cell for cell in cells[:width]
        )
    return width


def _parsed(path: Path, rows: Sequence[str], width: int, dialect: Dialect) -> pd.DataFrame:
    """The rows as pandas parses them, a column of text where a cell is neither a number nor missing."""
    if not rows:
        return pd.DataFrame({place: np.empty(0) for place in range(width)})
    text = "\n".join(rows)
    text = text.replace("−", "-")
    missing = sorted({*dialects.MISSING, *(word.upper() for word in dialects.MISSING), "NaN", "None", "Nan", "Null"})
    try:
        return pd.read_csv(
            io.StringIO(text if width > 1 or text.strip() else text + "\n"),
            sep=r"\s+" if dialect.separator == " " else dialect.separator,
            header=None,
            names=list(range(width)),
            index_col=False,
            decimal=dialect.decimal,
            thousands=dialect.thousands,
            na_values=missing,
            skipinitialspace=True,
            skip_blank_lines=False,
            **EXACT,
            low_memory=False,
        )
    except (pd.errors.ParserError, ValueError, OverflowError) as error:
        raise HarnessError(f"{path}: cannot be read as text of columns: {str(error).splitlines()[0]}") from None
