"""ASAM MDF 3 and 4, by asammdf: each group of channels has times of its own."""

import logging
import struct
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harness.errors import HarnessError
from harness.files.containers.arrays import Array, table_of
from harness.files.table import Table

HEADER = 64
"""Where the first block of MDF 4 is."""


def read(path: Path, data: bytes) -> Table:
    """Every channel of numbers, in physical values; of several groups, by `GROUP.channel`."""
    from asammdf import MDF

    logging.getLogger("asammdf").setLevel(logging.CRITICAL)
    _require_whole(path, data)
    arrays: list[Array] = []
    with MDF(BytesIO(data)) as file:
        groups: list[Any] = list(file.groups)
        several = sum(len(group.channels) > 1 for group in groups) > 1
        for place, group in enumerate(groups):
            if len(group.channels) < 2:
                continue
            stated = getattr(getattr(group, "channel_group", None), "acq_name", "") or ""
            name = (str(stated).strip().replace(".", "_") or str(place + 1)) if several else ""
            before = f"{name}." if name else ""
            taken = {array.path for array in arrays}
            if f"{before}time" in taken:
                before = f"{name}_{place + 1}."
            master = file.get_master(place)
            if not len(master):
                continue
            arrays.append(Array(f"{before}time", master, "s", f"{before}time", seconds=True))
            master_index = file.masters_db.get(place)
            for index, channel in enumerate(group.channels):
                if index == master_index:
                    continue
                signal = file.get(group=place, index=index, ignore_invalidation_bits=True)
                if signal.samples.dtype.kind in "biuf" and signal.samples.ndim == 1:
                    word = f"{before}{channel.name.replace('.', '_')}"
                    arrays.append(Array(word, _valid(signal), signal.unit or "", f"{before}time"))
    return table_of(path, arrays)


def _valid(signal: Any) -> NDArray[Any]:
    """The samples, not a number where the file says that they are invalid."""
    invalid = signal.invalidation_bits
    return signal.samples if invalid is None or not np.any(invalid) else np.where(invalid, np.nan, signal.samples)


def _require_whole(path: Path, data: bytes) -> None:
    """HarnessError if a block of a finished MDF 4 file goes on behind its end, or is none (asammdf is loud about it)."""
    if not data.startswith(b"MDF ") or int.from_bytes(data[28:30], "little") < 400:
        return
    waiting, seen = [HEADER], {0}
    while waiting:
        at = waiting.pop()
        if at in seen:
            continue
        seen.add(at)
        kind, head = data[at : at + 4], data[at + 8 : at + 24]
        length, links = struct.unpack("<QQ", head) if len(head) == 16 else (0, 0)
        if not kind.startswith(b"##") or at + length > len(data) or 24 + 8 * links > length:
            place = f"at byte {min(at, len(data))} of {len(data)}"
            raise HarnessError(f"{path}: begins as an MDF file, but is cut off or damaged ({place})")
        waiting += struct.unpack(f"<{links}Q", data[at + 24 : at + 24 + 8 * links])
