"""Reads logs: any file, columns by name or as stated, in the ports' names and units; one Log for each run."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.actuators.actuator import Output
from harness.errors import HarnessError
from harness.files.reader import read_table
from harness.files.table import Table
from harness.logs.axes import Axis, axis_of, check_rises, joined
from harness.logs.convert import inside
from harness.logs.find import Found, find, find_times, missing, require_rows
from harness.logs.leftout import left_out
from harness.logs.log import CHANNELS, Log
from harness.logs.mapping import KEYS, ColumnSpec, parse_specs
from harness.logs.ownrun import OWN_RUN, is_run, with_units
from harness.logs.run import Rows, log_of

Array = NDArray[np.float64]


def read_log(
    path: Path,
    columns: Mapping[str, str] | None = None,
    output: Output | None = None,
    parameters: Mapping[str, float] | None = None,
    *,
    with_files: Sequence[Path] = (),
) -> list[Log]:
    """The runs of a log, in the order in which they begin in the file.

    `columns`: port -> `COLUMN [unit] words`, as in an actuator's `[log]`; other columns are taken where they bear a port's
    own name. A file of `ema run` is read by its own names and units alone. `output`: what moves at the user's side;
    without a unit, positions are in its unit. `parameters`: of this actuator, by port name. `with_files`: further files,
    joined by time.
    HarnessError, with line and column, for anything that cannot be used; where columns are missing, with what was found and
    the options that would accept a guess.
    """
    shown = output or Output()
    specs = parse_specs(columns or {})
    tables = [with_units(read_table(each)) for each in (path, *with_files)]
    if specs and is_run(tables[0]):
        specs = {}
        tables[0] = replace(tables[0], remarks=(*tables[0].remarks, OWN_RUN))
    ratio = (parameters or {}).get("gear.ratio", ports.VARIABLES[ports.INDEX["gear.ratio"]].start)
    rows = _rows(tables, specs, shown, ratio)
    return [log_of(rows, which, name, group, shown, path, ratio) for name, group, which in _runs(rows)]


def read_one(
    path: Path,
    columns: Mapping[str, str] | None = None,
    output: Output | None = None,
    parameters: Mapping[str, float] | None = None,
    *,
    with_files: Sequence[Path] = (),
) -> Log:
    """As `read_log`, of a file that holds one run; HarnessError if it holds several."""
    logs = read_log(path, columns, output, parameters, with_files=with_files)
    if len(logs) > 1:
        raise HarnessError(f"{path}: holds {len(logs)} runs ({logs[0].name}, {logs[1].name}, ...); this command takes one")
    return logs[0]


def _rows(tables: Sequence[Table], specs: Mapping[str, ColumnSpec], output: Output, ratio: float) -> Rows:
    first = tables[0]
    linear = output.lead is not None
    found = find(tables, specs, KEYS)
    any_times = find_times(tables, first, first.columns[0], specs) if not first.columns[0].time else True
    remarks = [remark for table in tables for remark in table.remarks]
    remarks += [] if is_run(first) else left_out(first, found)
    _check_enough(first, found, bool(any_times), linear=linear)
    if "position" in found:
        found.pop("position_error", None)
    require_rows(first.path, max(len(each.column.values) for each in found.values()))
    axes: dict[tuple[int, int], Axis] = {}
    of: dict[str, tuple[int, int]] = {}
    for key, each in found.items():
        times = _times_of(tables, each, specs, linear=linear)
        of[key] = (tables.index(each.table), times.column.number)
        axes.setdefault(of[key], axis_of(times))
    remarks += [axis.remark for axis in axes.values() if axis.remark]
    values: dict[str, Array] = {}
    labels: dict[str, Sequence[str]] = {}
    own: dict[str, NDArray[np.bool_]] = {}
    for key, each in found.items():
        if key in ("run", "group"):
            labels[key] = _labels(each)
        else:
            values[key] = inside(each, output, ratio)
    demand = of.get("position_demand", of.get("command"))
    assert demand is not None  # _check_enough
    if len(axes) == 1:
        time = axes[demand].time
    else:
        if "run" in found or "group" in found:
            raise HarnessError(f"{found.get('run', found.get('group')).where}: runs cannot be told apart in several rates")  # type: ignore[union-attr]
        for axis in axes.values():
            check_rises(axis, np.arange(len(axis.time)))
        time, places, remark = joined(list(axes.values()))
        remarks.append(remark)
        for key in values:
            spread, place = np.full(len(time), np.nan), places[list(axes).index(of[key])]
            spread[place] = values[key]
            values[key], own[key] = spread, np.isin(np.arange(len(time)), place)
    return _counted(Rows(first, axes[demand], time, values, labels, found, tuple(remarks), own))


def _counted(rows: Rows) -> Rows:
    """The rows, with a remark on those that are no run's."""
    key = "run" if "run" in rows.labels else "group"
    without = sum(not label for label in rows.labels.get(key, ()))
    line = f"{without} row(s) without a {key} are left out ({rows.found[key].where})" if without else ""
    return replace(rows, remarks=(*rows.remarks, line)) if line else rows


def _times_of(tables: Sequence[Table], found: Found, specs: Mapping[str, ColumnSpec], *, linear: bool) -> Found:
    """The times of a column's rows; HarnessError if there are none, or not as many."""
    times = find_times(tables, found.table, found.column, specs)
    if times is None and found.column.time:
        raise HarnessError(
            f"{found.where}: which times its {len(found.column.values)} rows have is open; name them: --column time=COLUMN"
        )
    if times is None:
        raise missing(found.table, ["time"], linear=linear)
    if len(times.column.values) != len(found.column.values):
        counts = f"{len(found.column.values)} rows, but its times ({times.column.called}) {len(times.column.values)}"
        raise HarnessError(f"{found.where}: has {counts}")
    if times.column.number == found.column.number:
        raise HarnessError(f"{found.where}: is taken as time and as {found.spec.key}; it can be one of them")
    return times


def _check_enough(first: Table, found: Mapping[str, Found], times: bool, *, linear: bool) -> None:
    """HarnessError if there is no time, no command, or nothing that was measured."""
    lacking = [] if times else ["time"]
    if "command" not in found and "position_demand" not in found:
        lacking.append("command")
    measured = {*found} & {*CHANNELS, "position_error"}
    if lacking:
        raise missing(first, lacking[:1], linear=linear)
    if not measured:
        raise missing(first, ["position"], linear=linear)


def _labels(found: Found) -> Sequence[str]:
    column = found.column
    if not column.labels:
        return [_label(value) for value in column.values]
    return [column.labels[int(place)] if np.isfinite(place) else "" for place in column.values]


def _label(value: float) -> str:
    """A run's number, to the last digit: numbers that differ are different runs."""
    if not np.isfinite(value):
        return ""
    return str(int(value)) if value.is_integer() and abs(value) < 2.0**53 else repr(float(value))


def _runs(rows: Rows) -> list[tuple[str, str, NDArray[np.intp]]]:
    """Name, group and rows of each run; rows without a run's label belong to none."""
    if not rows.labels:
        return [("", "", np.arange(len(rows.time)))]
    count = len(rows.time)
    keys = list(zip(rows.labels.get("group", [""] * count), rows.labels.get("run", [""] * count), strict=True))
    names = dict.fromkeys(keys)
    places: dict[tuple[str, str], list[int]] = {key: [] for key in names}
    for row, key in enumerate(keys):
        places[key].append(row)
    labelled = "run" in rows.labels
    return [
        ("-".join(part for part in key if part), key[0], np.array(which))
        for key, which in places.items()
        if (key[1] if labelled else key[0])
    ]
