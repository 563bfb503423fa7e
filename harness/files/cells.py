"""Columns of numbers from what a reader delivers: numbers, truths, dates, texts."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from harness.files.dialect import MISSING, TIME, Dialect
from harness.files.header import parse_words
from harness.files.table import Column

NANOSECONDS = 1e17
"""Whole numbers from here on are counts of ns since 1970: as doubles they would lose what lies below 0.1 us."""


def columns_of(
    frame: pd.DataFrame, words: Sequence[str], units: Sequence[str] = (), dialect: Dialect | None = None
) -> tuple[tuple[Column, ...], tuple[str, ...]]:
    """The columns of `frame`, and a remark for each whose dates became seconds.

    `words`: header words (none if there are none); `units`: of a row of their own, before those in the words. A column
    without a word and without a number is left out where others have words.
    """
    named = parse_words(words) if words else [("", "")] * frame.shape[1]
    columns, remarks = [], []
    for place, (name, unit) in enumerate(named):
        series = frame.iloc[:, place]
        if words and not name and series.isna().all():
            continue
        stated = units[place].strip("[](){}<> ") if place < len(units) else ""
        column, remark = column_of(name, stated if stated not in ("", "-") else unit, series.to_numpy(), place + 1, dialect)
        columns.append(column)
        remarks += [remark] if remark else []
    return tuple(columns), tuple(remarks)


def column_of(
    name: str, unit: str, values: NDArray[Any], number: int, dialect: Dialect | None = None, time: str = ""
) -> tuple[Column, str]:
    """A column of `values`, shape (n_rows,), of any kind, and what is to be remarked about it, "" if nothing is."""
    if values.dtype.kind in "iu" and values.size and NANOSECONDS < abs(int(values[0])) < 4e18:
        return _since(
            name, number, time, (values - values[0]).astype(float) * 1e-9, float(values[0]) * 1e-9, "epoch times in ns"
        )
    if values.dtype.kind in "biuf":
        return Column(name, unit, values.astype(np.float64), number, time), ""
    if values.dtype.kind in "mM":
        return _moments(name, number, time, pd.Series(values))
    texts = pd.Series(["" if value is None or value is pd.NA or value != value else str(value).strip() for value in values])
    known = ~texts.str.lower().isin(MISSING)
    numbers = pd.to_numeric(_plain(texts[known], dialect), errors="coerce")
    if numbers.notna().all():
        full = np.full(len(texts), np.nan)
        full[known.to_numpy()] = numbers.to_numpy(dtype=np.float64)
        return Column(name, unit, full, number, time), ""
    if texts[known].str.fullmatch(TIME.pattern).all():
        found = texts.where(known).str.replace(",", ".").str.replace(" UTC", "Z")
        if found[known].str.contains("-").all():
            moments = pd.to_datetime(found, format="ISO8601", utc=True, errors="coerce")
        else:
            moments = pd.to_timedelta(found, errors="coerce")
        if moments[known].notna().all():
            return _moments(name, number, time, moments)
    codes, labels = pd.factorize(texts.where(known), use_na_sentinel=True)
    places = np.where(codes < 0, np.nan, codes.astype(float))
    odd = int(np.flatnonzero(known.to_numpy())[int(np.argmax(numbers.isna().to_numpy()))])
    return Column(name, unit, places, number, time, tuple(map(str, labels)), odd), ""


def _plain(texts: "pd.Series[str]", dialect: Dialect | None) -> "pd.Series[str]":
    """Numbers with decimal points and nothing between thousands."""
    if dialect is None or dialect.decimal == ".":
        return texts
    texts = texts.str.replace(dialect.thousands or ".", "" if dialect.thousands else "?", regex=False)
    return texts.str.replace(dialect.decimal, ".", regex=False)


def _moments(name: str, number: int, time: str, moments: Any) -> tuple[Column, str]:
    """Dates, or times of day, as seconds since the first row."""
    clock = moments.dtype.kind == "m"
    if not clock and getattr(moments.dtype, "tz", None) is not None:
        moments = moments.dt.tz_convert(None)
    known = moments.notna()
    if not known.any():
        return Column(name, "s", np.full(len(moments), np.nan), number, time), ""
    first = moments[known].iloc[0]
    since = ((moments - first) / pd.Timedelta(1, "s")).to_numpy(dtype=np.float64)
    epoch = first.total_seconds() if clock else (first - pd.Timestamp(0)) / pd.Timedelta(1, "s")
    return _since(name, number, time, since, float(epoch), "times of day" if clock else "dates")


def _since(name: str, number: int, time: str, values: NDArray[np.float64], epoch: float, what: str) -> tuple[Column, str]:
    column = Column(name, "s", values, number, time, epoch=epoch)
    return column, f"column {column.called}: {what}, taken as seconds since the first row"
