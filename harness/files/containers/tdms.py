"""National Instruments' TDMS, by npTDMS: a group may have times of its own, or a channel a distance between its samples."""

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from harness.errors import HarnessError
from harness.files.containers.arrays import TIMES, Array, table_of
from harness.files.header import parse_words
from harness.files.table import Table

LEAD_IN = 28
"""Bytes before the content of a segment, whose length they hold."""


def read(path: Path, data: bytes) -> Table:
    """Every channel of numbers or times; of several groups, by `GROUP.channel`."""
    from nptdms import TdmsFile

    _require_whole(path, data)
    file = TdmsFile.read(BytesIO(data))
    groups = [group for group in file.groups() if group.channels()]
    arrays: list[Array] = []
    for group in groups:
        arrays += _of_group(group, f"{group.name.replace('.', '_')}." if len(groups) > 1 else "")
    return table_of(path, arrays)


def _of_group(group: Any, before: str) -> list[Array]:
    """The channels of a group, after the times of its own that they have by their waveforms."""
    channels = [channel for channel in group.channels() if len(channel)]
    words = {channel.name: parse_words([channel.name.replace(".", "_")])[0][0] for channel in channels}
    own = next((channel for channel in channels if words[channel.name].lower() in TIMES), None)
    tracks: dict[tuple[object, ...], Array] = {}
    found = []
    for channel in channels:
        values = channel[:]
        if values.dtype.kind not in "biufM":
            continue
        if own is not None and len(own) == len(channel):
            time = f"{before}{words[own.name]}"
        else:
            time = _track(channel, before, {*words.values()}, tracks)
        unit = channel.properties.get("unit_string", channel.properties.get("NI_UnitDescription", ""))
        found.append(Array(f"{before}{channel.name.replace('.', '_')}", values, str(unit), time))
    return [*tracks.values(), *found]


def _track(channel: Any, before: str, taken: set[str], tracks: dict[tuple[object, ...], Array]) -> str:
    """Name of the times that a waveform's properties give: on the clock if they say when it began; "" if it is none."""
    step, offset, start = (channel.properties.get(f"wf_{name}") for name in ("increment", "start_offset", "start_time"))
    if not step:
        return ""
    key = (step, offset or 0.0, start, len(channel))
    if key not in tracks:
        used = {*taken, *(track.leaf for track in tracks.values())}
        name = next(name for n in range(1, len(used) + 2) if (name := f"time {n}" if n > 1 else "time") not in used)
        since = np.arange(len(channel)) * float(step) + float(offset or 0.0)
        if start is not None and not np.isnat(np.datetime64(start)):
            since = np.datetime64(start, "ns") + np.rint(1e9 * since).astype("timedelta64[ns]")
        tracks[key] = Array(f"{before}{name}", since, "s", f"{before}{name}", seconds=True)
    return tracks[key].path


def _require_whole(path: Path, data: bytes) -> None:
    """HarnessError if the last segment is incomplete (npTDMS would read what is there of it)."""
    at = 0
    while at < len(data):
        at += LEAD_IN + int.from_bytes(data[at + 12 : at + 20], "little")
    if at != len(data):
        raise HarnessError(f"{path}: begins as a TDMS file, but is cut off or damaged (its last segment is incomplete)")
