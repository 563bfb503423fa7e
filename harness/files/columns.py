"""Columns of numbers from a CSV file, every complaint with its line and column."""

import csv
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from harness.errors import HarnessError


def read_numbers(path: Path) -> dict[str, NDArray[np.float64]]:
    """Every column of `path` by name, each of shape (n_rows,), n_rows >= 1; HarnessError, with line and column, for
    anything that is not a row of finite numbers."""
    header, rows = _table(path, ("NAME", "..."))
    _refuse_twice(path, header)
    numbers = [[_number(path, line, name, cell) for name, cell in zip(header, row, strict=True)] for line, row in rows]
    if not numbers:
        raise HarnessError(f"{path}: no row of numbers; at least one is needed")
    return dict(zip(header, np.array(numbers).T, strict=True))


def _table(path: Path, example: Sequence[str]) -> tuple[list[str], Iterator[tuple[int, list[str]]]]:
    """The header, and the rows that are not blank with their line numbers, each as long as the header."""
    lines = _lines(path)
    if not lines:
        raise HarnessError(f"{path}: the file is empty; a header '{','.join(example)}' and rows of numbers are needed")
    header = [name.strip() for name in lines[0]]

    def rows() -> Iterator[tuple[int, list[str]]]:
        for number, row in enumerate(lines[1:], start=2):
            if len(row) < 2 and not "".join(row).strip():
                continue
            if len(row) != len(header):
                raise HarnessError(f"{path}, line {number}: {len(row)} values, but the header has {len(header)} columns")
            yield number, row

    return header, rows()


def _refuse_twice(path: Path, names: Sequence[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise HarnessError(f"{path}, line 1: column '{name}' is there twice")


def _lines(path: Path) -> list[list[str]]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not a UTF-8 text file"
        raise HarnessError(f"{path}: cannot be read: {reason}") from None
    try:
        return list(csv.reader(text.splitlines()))
    except csv.Error as error:
        raise HarnessError(f"{path}: cannot be read as CSV: {error}") from None


def _number(path: Path, line: int, column: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise HarnessError(f"{path}, line {line}, column {column}: '{text.strip()}' is not a number") from None
    if not math.isfinite(value):
        raise HarnessError(f"{path}, line {line}, column {column}: {text.strip()} is not a finite number")
    return value
