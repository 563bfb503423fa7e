"""One run of a log: its rows, what is flown, what was measured, and what is to be said about them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.actuators.actuator import Output
from harness.errors import HarnessError
from harness.files.reader import stem
from harness.files.table import Table
from harness.logs.axes import Axis, check_distance, check_rises, filled
from harness.logs.find import Found, require_rows
from harness.logs.log import CHANNELS, Between, Log, Logger
from harness.logs.spikes import spikes

Array = NDArray[np.float64]

LEAST_RATE = 25.0
"""Rows a second from which a log can be compared."""
GAP = 5.0
"""A gap is more than so many times the usual distance of rows."""
MOSTLY_EMPTY = 0.6
"""Part of its rows up to which a column that has a value in them is one of a slower rate."""
UNIT = ports.VARIABLES[ports.INDEX["command"]].unit
SAME = "the same value in all rows; nothing was measured"


@dataclass(frozen=True)
class Rows:
    """Rows of all runs: `time` [s] and `values` by key in the ports' units, shape (n_rows,), `labels` of runs and groups.

    `axis`: the times as they stand in the file. `of`: key -> which rows are of its own axis, where several are joined; rows
    of one axis have its lines.
    """

    table: Table
    axis: Axis
    time: Array
    values: Mapping[str, Array]
    labels: Mapping[str, Sequence[str]]
    found: Mapping[str, Found]
    remarks: tuple[str, ...]
    of: Mapping[str, NDArray[np.bool_]]

    @property
    def own(self) -> bool:
        """Whether the rows are those of one axis."""
        return not self.of

    def taken(self, key: str, which: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Which of the rows `which` are the column's own, shape (n_rows,): those of its axis, a missing one too, or, of a
        column that is mostly empty there, those with a value."""
        own = self.of[key][which] if key in self.of else np.ones(len(which), dtype=bool)
        there = own & np.isfinite(self.values[key][which])
        return there if 1 < there.sum() <= MOSTLY_EMPTY * own.sum() else own


def log_of(
    rows: Rows,
    which: NDArray[np.intp],
    name: str,
    group: str,
    output: Output,
    path: Path,
    ratio: float,
) -> Log:
    """The run of the rows `which`; HarnessError, with the line, for what cannot be used."""
    where = f"{path}, run {name}" if name else str(path)
    require_rows(where, len(which))
    if rows.own:
        check_rises(
            rows.axis,
            which,
            "" if rows.labels else "; if the file holds several runs, name their column: --column run=COLUMN",
        )
    remarks = list(rows.remarks)
    flown = "position_demand" if "position_demand" in rows.found else "command"
    between = rows.found[flown].spec.between
    which = _commanded(rows, which, flown, between, remarks)
    time = rows.time[which]
    _check_rate(where, time, rows.found)
    _refuse_spikes(rows, which, flown)
    inputs = {"command": filled(time, rows.values[flown][which], between)}
    for key in ("load_torque", "supply_voltage"):
        if key in rows.values and np.isfinite(rows.values[key][which]).any():
            inputs[key] = filled(time, _without_spikes(rows, which, key, remarks), None)
    channels, loggers, taken = _channels(rows, which, inputs["command"], ratio, remarks)
    taken["command"] = rows.taken(flown, which)
    if not channels:
        raise HarnessError(f"{where}: {SAME}")
    others = {key: rows.values[key][which] for key in ("temperature",) if key in rows.values}
    if flown == "position_demand":
        remarks.append("position_demand is flown as the command")
        if "command" in rows.values:
            others["target"] = rows.values["command"][which]
    remarks += _gaps(time) + _open(channels)
    return Log(
        f"{stem(path)} {name}" if name else stem(path),
        path,
        time,
        inputs,
        channels,
        between,
        loggers,
        output,
        group,
        others,
        tuple(remarks),
        {name: own for name, own in taken.items() if not own.all()},
    )


def _commanded(
    rows: Rows, which: NDArray[np.intp], flown: str, between: Between | None, remarks: list[str]
) -> NDArray[np.intp]:
    """The rows from the first to the last with a command; between them it may be missing where it is said what it does."""
    known = np.isfinite(rows.values[flown][which])
    if not known.any():
        raise HarnessError(f"{rows.found[flown].where}: holds no number in this run")
    first, last = int(np.argmax(known)), len(known) - int(np.argmax(known[::-1]))
    if first or last < len(known):
        remarks.append(f"{first + len(known) - last} row(s) before the first or after the last command are left out")
    inner = known[first:last]
    if between is None and not inner.all():
        found = rows.found[flown]
        row = int(which[first + int(np.argmin(inner))])
        place = found.cell(row) if rows.own else found.where
        text = found.spec.text or found.column.called
        raise HarnessError(
            f"{place}: no command in {np.count_nonzero(~inner)} row(s); say what it does there, held or ramped: "
            f"--column '{flown}={text} {'' if '[' in text else f'[{found.unit or UNIT}] '}held'"
        )
    return which[first:last]


def _without_spikes(rows: Rows, which: NDArray[np.intp], key: str, remarks: list[str]) -> Array:
    """What was measured in the rows `which`, not a number where it cannot be, which is remarked."""
    found, series = rows.found[key], rows.values[key][which].copy()
    bad = spikes(series)
    if bad.any():
        line = f", the first in {found.cell(int(which[np.argmax(bad)]))}" if rows.own else f" in {found.where}"
        remarks.append(f"{np.count_nonzero(bad)} isolated spike(s) are masked{line}")
        series[bad] = np.nan
    return series


def _refuse_spikes(rows: Rows, which: NDArray[np.intp], flown: str) -> None:
    """HarnessError, with the line, for a command that cannot have been one: it would be flown."""
    series, found = rows.values[flown][which], rows.found[flown]
    bad = spikes(series)
    if bad.any():
        row = int(np.argmax(bad))
        place = found.cell(int(which[row])) if rows.own else found.where
        written = found.numbers()[which[row]] if rows.own else series[row]
        raise HarnessError(
            f"{place}: {written:g} is far outside all other commands, for one "
            "row; if nothing was commanded there, leave the cell empty and say what the command does: held or ramped"
        )


def _check_rate(where: str, time: Array, found: Mapping[str, Found]) -> None:
    if len(time) > 1:
        check_distance(where, time)
    rate = 1.0 / float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    if rate < LEAST_RATE * 0.98:
        raise HarnessError(
            f"{where}: {rate:.4g} rows a second of its times; at least {LEAST_RATE:g} are needed "
            "(times in another unit? such as --column 'time=COLUMN [ms]')"
        )


def _channels(
    rows: Rows, which: NDArray[np.intp], command: Array, ratio: float, remarks: list[str]
) -> tuple[dict[str, Array], dict[str, Logger], dict[str, NDArray[np.bool_]]]:
    """What was measured, in the order of CHANNELS, with how it was taken and in which rows; spikes masked."""
    channels: dict[str, Array] = {}
    loggers: dict[str, Logger] = {}
    taken: dict[str, NDArray[np.bool_]] = {}
    for key in ("position", *(name for name in CHANNELS if name != "position"), "position_error"):
        found = rows.found.get(key)
        if found is None:
            continue
        missing = np.isnan(rows.values[key][which]).any()
        told = len(remarks)
        series = _without_spikes(rows, which, key, remarks)
        if rows.own and missing and len(remarks) == told:
            remarks.append(
                f"column {found.column.called}: no number in {np.count_nonzero(np.isnan(series))} of {len(series)} rows"
            )
        known = series[np.isfinite(series)]
        if not known.size or np.ptp(known) == 0.0:
            remarks.append(f"column {found.column.called} ({key}): {SAME}")
            continue
        if key == "position_error":
            series = command - series
        place = "position" if key == "position_error" else key
        if found.spec.motor:
            place, series = "motor_position", series * ratio
        if place in channels:
            continue
        channels[place], taken[place] = series, rows.taken(key, which)
        if found.spec.logger:
            loggers[place] = found.spec.logger
    return {name: channels[name] for name in CHANNELS if name in channels}, loggers, taken


def _gaps(time: Array) -> list[str]:
    distance = np.diff(time)
    wide = distance > GAP * np.median(distance)
    if not wide.any():
        return []
    longest = int(np.argmax(distance))
    return [f"{np.count_nonzero(wide)} gap(s) without rows, the longest {distance[longest]:.3g} s at {time[longest]:.4g} s"]


def _open(channels: Mapping[str, Array]) -> list[str]:
    """What cannot be told for want of a column."""
    remarks = []
    if "motor_speed" not in channels:
        remarks.append("no motor_speed: how fast it moves is compared by the position alone")
    if not any("current" in name for name in channels):
        remarks.append("no current: friction and windings show in the position alone, if at all")
    if "position" not in channels and "motor_position" not in channels:
        remarks.append("no position: backlash and the loop's gain show in other columns only, if at all")
    return remarks
