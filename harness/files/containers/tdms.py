"""National Instruments' TDMS, by npTDMS: each group may have times of its own, or a distance between its samples."""

from io import BytesIO
from pathlib import Path

from harness.errors import HarnessError
from harness.files.containers.arrays import TIMES, Array, table_of
from harness.files.table import Table

LEAD_IN = 28
"""Bytes before the content of a segment, whose length they hold."""


def read(path: Path, data: bytes) -> Table:
    """Every channel of numbers or times; of several groups, by `GROUP.channel`."""
    from nptdms import TdmsFile

    _require_whole(path, data)
    file = TdmsFile.read(BytesIO(data))
    groups = [group for group in file.groups() if group.channels()]
    arrays = []
    for group in groups:
        before = f"{group.name.replace('.', '_')}." if len(groups) > 1 else ""
        channels = [channel for channel in group.channels() if len(channel)]
        own = next((channel.name for channel in channels if channel.name.lower() in TIMES), "")
        if not own and channels and "wf_increment" in channels[0].properties:
            arrays.append(Array(f"{before}time", channels[0].time_track(), "s", f"{before}time"))
            own = "time"
        for channel in channels:
            values = channel[:]
            if values.dtype.kind in "biufM":
                unit = channel.properties.get("unit_string", channel.properties.get("NI_UnitDescription", ""))
                name = channel.name.replace(".", "_")
                arrays.append(Array(f"{before}{name}", values, str(unit), f"{before}{own}" if own else ""))
    return table_of(path, arrays)


def _require_whole(path: Path, data: bytes) -> None:
    """HarnessError if the last segment is incomplete (npTDMS would read what is there of it)."""
    at = 0
    while at < len(data):
        at += LEAD_IN + int.from_bytes(data[at + 12 : at + 20], "little")
    if at != len(data):
        raise HarnessError(f"{path}: begins as a TDMS file, but is cut off or damaged (its last segment is incomplete)")
