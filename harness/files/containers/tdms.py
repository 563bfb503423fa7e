"""National Instruments' TDMS, by npTDMS: each group may have times of its own, or a distance between its samples."""

from io import BytesIO
from pathlib import Path

from harness.files.containers.arrays import TIMES, Array, table_of
from harness.files.table import Table


def read(path: Path, data: bytes) -> Table:
    """Every channel of numbers or times; of several groups, by `GROUP.channel`."""
    from nptdms import TdmsFile

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
