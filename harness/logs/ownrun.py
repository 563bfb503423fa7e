"""Files that `ema run` has written: no logger's layout holds for them, and a unit stands where it is not the port's."""

from dataclasses import replace

from ema_fmu_src import ports
from harness.files.table import Table

OWN_RUN = "a file of ema run: its columns are taken by their own names, whatever --column or the actuator's [log] says"
MOST_OUTPUTS = 15
"""Columns named like outputs from which a file is one of `ema run`: no logger writes so many of ours."""


def is_run(table: Table) -> bool:
    """Whether a file is what `ema run` writes."""
    names = {column.name for column in table.columns}
    return {"time", "command"} <= names and len(names & {port.name for port in ports.OUTPUTS}) >= MOST_OUTPUTS


def with_units(table: Table) -> Table:
    """The table; of a file of `ema run`, every port's column with its unit, the port's own where none is written.

    So a rotary run is in rad in every format, whatever the output of the actuator under which it is read.
    """
    if not is_run(table):
        return table
    columns = [
        replace(column, unit=ports.VARIABLES[ports.INDEX[column.name]].unit)
        if column.name in ports.INDEX and not column.unit
        else column
        for column in table.columns
    ]
    return replace(table, columns=tuple(columns))
