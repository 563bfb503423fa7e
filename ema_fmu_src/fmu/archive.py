"""FMUs and SSPs as archives: the same members give the same bytes."""

import os
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path

DATE = (2026, 1, 1, 0, 0, 0)
"""Of every member."""


def write(path: Path, members: Mapping[str, bytes]) -> None:
    """Write the archive `path` whole or not at all, with fixed dates, order and permissions."""
    with tempfile.TemporaryDirectory(prefix="ema_", dir=path.parent) as scratch:
        finished = Path(scratch) / path.name
        with zipfile.ZipFile(finished, "w", zipfile.ZIP_DEFLATED) as archive:
            for name in sorted(members):
                member = zipfile.ZipInfo(name, DATE)
                member.external_attr = 0o644 << 16
                member.compress_type = zipfile.ZIP_DEFLATED
                archive.writestr(member, members[name])
        os.replace(finished, path)
