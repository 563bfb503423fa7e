"""Finds the columns that are meant, in one file or in several, and says what is missing and what would do."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from harness.errors import HarnessError, unknown
from harness.files.header import parse_words
from harness.files.table import Column, Table
from harness.logs.guess import ALIASES, OPEN, OPEN_MEANS, guesses, own_key, plain
from harness.logs.mapping import INPUTS, ColumnSpec

Array = NDArray[np.float64]
LISTED, LONGEST = 12, 40
"""Columns that a message lists, and characters of a name."""


@dataclass(frozen=True)
class Found:
    """A column that was found: its table, itself, and what is said of it (by the user, or by its own name)."""

    table: Table
    column: Column
    spec: ColumnSpec

    @property
    def unit(self) -> str:
        """As the user states it, else as the header does; "" for the port's own."""
        unit = self.spec.unit or self.column.unit
        return "" if unit in ("-", "1") and not self.spec.unit else unit

    @property
    def where(self) -> str:
        """The file and the column, for messages."""
        return f"{self.table.path}, column {self.column.called}"

    def cell(self, row: int) -> str:
        """The place of a cell, for messages."""
        return f"{self.table.where(row)}, column {self.column.called}"

    def numbers(self) -> Array:
        """The values, as written; HarnessError for a cell that is text, or for one that is infinite."""
        column = self.column
        if column.labels:
            label = column.labels[int(column.values[column.odd])]
            raise HarnessError(f"{self.cell(column.odd)}: '{label}' is not a number")
        if np.isinf(column.values).any():
            row = int(np.flatnonzero(np.isinf(column.values))[0])
            raise HarnessError(f"{self.cell(row)}: {column.values[row]:g} is not a finite number")
        return column.values


def find(tables: Sequence[Table], specs: Mapping[str, ColumnSpec], keys: Sequence[str]) -> dict[str, Found]:
    """The columns of `specs`, and of the other `keys` those that bear the key's own name, in any case.

    HarnessError for a spec that names no column, or more than one, or one that is taken as something else too; or an own
    name that is there twice.
    """
    found: dict[str, Found] = {}
    for key, spec in specs.items():
        if key in keys and key != "time":
            found[key] = _stated(tables, spec)
    for key in keys:
        if key in found or key == "time":
            continue
        hits = [(table, column) for table in tables for column in _named(table, key)]
        if len(hits) > 1:
            (one, column), (other, _) = hits[:2]
            raise HarnessError(
                f"column '{column.name}' is in {one.path} and in {other.path}; say which is meant: "
                f"--column '{key}={one.path.name}:{column.called}'"
            )
        if hits:
            found[key] = Found(*hits[0], ColumnSpec(key, hits[0][1].name))
    _refuse_shared(found)
    return found


def _refuse_shared(found: Mapping[str, Found]) -> None:
    """HarnessError if one column is taken as two things."""
    taken: dict[tuple[Path, int], Found] = {}
    for key, each in found.items():
        if key in ("run", "group"):
            continue
        other = taken.setdefault((each.table.path, each.column.number), each).spec
        if other.key != key:
            stated = " and ".join(f"{spec.key}='{spec.text}'" for spec in (other, each.spec) if spec.text)
            by = f" ({stated}, by --column or the actuator's [log])" if stated else ""
            raise HarnessError(f"{each.where}: is taken as {other.key} and as {key}{by}; it can be one of them")


def find_times(tables: Sequence[Table], table: Table, column: Column, specs: Mapping[str, ColumnSpec]) -> Found | None:
    """The times of a column: its own axis, or those the user names, or the column named time; None if there is none.

    `table`: one of `tables`. A name that is stated is one of the first, or of that which stands before it (FILE:COLUMN);
    in further files a name that is not there, and a number, give way to the own name, or to the only word of a time with a
    unit. HarnessError for times of a further file that are open.
    """
    spec = specs.get("time")
    file, _, rest = spec.column.partition(":") if spec else ("", "", "")
    among = [each for each in tables if rest and each.path.name == file] or [tables[0]]
    meant = any(each is table for each in among)
    if column.time:
        axis = [each for each in table.columns if each.name == column.time]
        if axis or spec is None:
            unit = spec.unit if spec and meant else ""
            return Found(table, axis[0], ColumnSpec("time", column.time, unit)) if axis else None
    if spec and meant:
        return _stated([table], spec)
    if spec and among[0] is tables[0] and not spec.column.isdigit() and _matches(table, spec.column):
        return _with_its_unit(_stated([table], spec))
    own = _named(table, "time")
    if not own and table is not tables[0]:
        own = _only_times(table)
    return Found(table, own[0], ColumnSpec("time", own[0].name)) if own else None


def _with_its_unit(found: Found) -> Found:
    """The times of a further file, with what is stated of the first; HarnessError if its header states another unit."""
    if found.column.unit and found.spec.unit and found.column.unit != found.spec.unit:
        raise HarnessError(
            f"{found.where}: [{found.spec.unit}] is stated, its header says [{found.column.unit}]; "
            f"say which file is meant: --column 'time=FILE:{found.column.called} [{found.spec.unit}]'"
        )
    return found


def _only_times(table: Table) -> list[Column]:
    """The one column of a further file whose word is that of a time and has a unit; HarnessError if it is open which is."""
    likely = [column for column in table.columns if ALIASES.get(plain(column.name)) == "time"]
    if len(likely) == 1 and (likely[0].unit or likely[0].epoch is not None):
        return likely
    if not likely:
        return []
    offered = [f"--column 'time={table.path.name}:{column.called} [{column.unit or 'UNIT'}]'" for column in likely]
    raise HarnessError(f"{table.at_header}: which are its times, and in what unit, is open: {' or '.join(offered)}")


def _named(table: Table, key: str) -> list[Column]:
    """The column that bears the key's own name, in any case; HarnessError if there are two that are not the same."""
    named = [column for column in table.columns if own_key(column.name) == key]
    leaves = [column for column in table.columns if own_key(column.name.rpartition(".")[2]) == key and _may_be(column, key)]
    named = named or (leaves if len(leaves) == 1 else [])
    named.sort(key=lambda column: column.name != key)
    for other in named[1:]:
        if other.name == named[0].name or not np.array_equal(other.values, named[0].values, equal_nan=True):
            also = f", as '{other.name}'" if other.name != named[0].name else ""
            raise HarnessError(
                f"{table.at_header}: column '{named[0].name}' is there twice{also}; name one: --column {key}=..."
            )
    return named[:1]


def _may_be(column: Column, key: str) -> bool:
    """Whether the groups that a column lies in may hold a key: what lies in `target` is no measured position."""
    path = column.name.rpartition(".")[0]
    said = [ALIASES.get(plain(part)) for part in (*path.split("."), path, column.name)]
    return not any(other in (*INPUTS, "position_error", "position_demand") and other != key for other in said)


def _stated(tables: Sequence[Table], spec: ColumnSpec) -> Found:
    """The one column that a user names."""
    file, _, rest = spec.column.partition(":")
    among = [table for table in tables if table.path.name == file]
    tables, name = (among, rest.strip()) if among and rest else (tables, spec.column)
    hits = [Found(table, column, spec) for table in tables for column in _matches(table, name)]
    if name.isdigit() and len(hits) > 1 and not among:
        hits = hits[:1]  # a number alone is one of the first file
    if len(hits) == 1:
        return hits[0]
    first = tables[0]
    if hits:
        if hits[0].table is hits[1].table:
            raise HarnessError(
                f"{first.at_header}: column '{name}' is there twice; give its number, such as {hits[0].column.number}"
            )
        raise HarnessError(f"column '{name}' is in {hits[0].table.path} and in {hits[1].table.path}; write FILE:COLUMN")
    if name.isdigit():
        raise HarnessError(f"{first.path}: there is no column {name} for {spec.key}; it has {len(first.columns)}")
    names = [column.name for table in tables for column in table.columns if column.name]
    if not names:
        raise HarnessError(f"{first.path}: has no header words; give the number of the column for {spec.key}, not '{name}'")
    raise unknown(f"column for {spec.key} in {first.path}:", name, names)


def _matches(table: Table, name: str) -> list[Column]:
    """Columns of that name: as it stands, in any case, with its unit, as the end of a dotted path, or by number."""
    bare = parse_words([name])[0][0]
    for test in (
        lambda column: column.name == name,
        lambda column: column.name.lower() == name.lower(),
        lambda column: column.name.lower() == bare.lower(),
        lambda column: column.name.lower().endswith(f".{name.lower()}"),
        lambda column: name.isdigit() and column.number == int(name),
    ):
        hits = [column for column in table.columns if (column.name and test(column)) or (not column.name and test(column))]
        if hits:
            return hits
    return []


def missing(table: Table, keys: Sequence[str], *, linear: bool = False) -> HarnessError:
    """The error where none of the columns can be `keys`: what was found, and the options that would accept the guesses."""
    found = ", ".join(_listed(column) for column in table.columns[:LISTED])
    more = f" and {len(table.columns) - LISTED} more" if len(table.columns) > LISTED else ""
    offered = [guess.flag for guess in guesses(table, linear=linear)]
    hint = f"; what looks like it: {' '.join(offered)}" if offered else "; name them by --column PORT=COLUMN"
    hint += f" ({OPEN_MEANS})" if f"[{OPEN}]" in hint else ""
    wanted = "' or '".join(keys)
    return HarnessError(f"{table.at_header}: no column '{wanted}', found: {found}{more}{hint} ('ema columns' shows them)")


def require_rows(where: Path | str, rows: int) -> None:
    """HarnessError if there are fewer than two rows."""
    if rows < 2:
        raise HarnessError(f"{where}: {rows} row(s) of numbers; at least two are needed")


def _listed(column: Column) -> str:
    if column.name:
        name = column.name if len(column.name) <= LONGEST else f"{column.name[:LONGEST]}..."
        return f"{name} [{column.unit}]" if column.unit else name
    finite = column.values[np.isfinite(column.values)]
    return f"{column.number} ({finite.min():g} to {finite.max():g})" if finite.size else f"{column.number} (empty)"
