"""Zip archives of FMUs and SSPs: the same members give the same bytes."""

import os
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path

DATE = (2026, 1, 1, 0, 0, 0)
"""Time stamp of every member."""


def write(path: Path, members: Mapping[str, bytes]) -> None:
    """Write `members` (archive name -> content) to the archive `path`, completely or not at all.

    Dates, order and permissions are fixed. OSError if `path` cannot be written.
    """
    with tempfile.TemporaryDirectory(prefix="ema_", dir=path.parent) as scratch:
        finished = Path(scratch) / path.name
        with zipfile.ZipFile(finished, "w", zipfile.ZIP_DEFLATED) as archive:
            for name in sorted(members):
                member = zipfile.ZipInfo(name, DATE)
                member.external_attr = 0o644 << 16
                member.compress_type = zipfile.ZIP_DEFLATED
                archive.writestr(member, members[name])
        os.replace(finished, path)
