"""Files that `ema run` writes: seen as such, and read by their own names and units."""

from dataclasses import replace

from ema_fmu_src import ports
from harness.files.table import Table

OWN_RUN = "a file of ema run: its columns are taken by their own names, whatever --column or the actuator's [log] says"
MOST_OUTPUTS = 15
"""Columns named like outputs from which a file is one of `ema run`: no logger writes so many of ours."""


def is_run(table: Table) -> bool:
    """Whether a file is what `ema run` writes: a logger's layout does not hold for it."""
    names = {column.name for column in table.columns}
    return {"time", "command"} <= names and len(names & {port.name for port in ports.OUTPUTS}) >= MOST_OUTPUTS


def with_own_units(table: Table) -> Table:
    """The table; of a file of `ema run`, columns without a unit in their ports' units, whatever moves at the user's side:
    CSV states those units alone that are others."""
    if not is_run(table):
        return table
    units = {name: ports.VARIABLES[place].unit for name, place in ports.INDEX.items()}
    return replace(table, columns=tuple(replace(each, unit=each.unit or units.get(each.name, "")) for each in table.columns))
