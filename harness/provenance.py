"""Where a result comes from: the one record that every JSON file, page and dataset carries, as `provenance`.

It is made before the flights, so that its hashes are those of what is flown and read.
"""

import hashlib
import json
import os
import platform
import shlex
import sys
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from ema_fmu_src import __version__
from harness.errors import HarnessError

PACKAGES = ("fmpy", "numba", "numpy", "pandas", "plotly", "scipy", "xarray")
"""Packages that numbers depend on, and that are in every install."""


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """How a result was made.

    `command`: the command line, or the call, that makes it again. `versions`: of the twins, of Python and of packages, by
    name. `fmus`, `inputs`: SHA-256, 64 hexadecimal digits, of each FMU flown and each file read, by its path as given.
    `actuator`: `name` and `sha256` of its resolved parameters; empty where none is. `machine`: `system`, `architecture`,
    `processor`, `cores`. `time`: when it was begun, UTC, as ISO 8601.
    """

    command: str
    versions: Mapping[str, str]
    fmus: Mapping[str, str]
    actuator: Mapping[str, str]
    inputs: Mapping[str, str]
    machine: Mapping[str, str | int]
    time: str

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def as_text(self) -> str:
        """As JSON, for formats whose attributes are texts."""
        return json.dumps(self.as_dict())

    @property
    def digest(self) -> str:
        """8 hexadecimal digits of what is asked of which bytes: the same on another day, machine or version."""
        content = [self.command, list(self.fmus.values()), self.actuator.get("sha256"), list(self.inputs.values())]
        return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:8]


def provenance(
    *,
    command: str | None = None,
    fmus: Iterable[Path] = (),
    inputs: Iterable[Path] = (),
    actuator: Mapping[str, str] | None = None,
) -> Provenance:
    """The record of what begins now.

    `command`: by default the command line of this process. `inputs`: files, and folders, which stand for the files in them.
    `actuator`: its `identity`. HarnessError for a file that cannot be read.
    """
    read = [file for path in inputs for file in (sorted(path.iterdir()) if path.is_dir() else [path])]
    return Provenance(
        command=shlex.join(["ema", *sys.argv[1:]]) if command is None else command,
        versions=_versions(),
        fmus={str(path): file_hash(path) for path in fmus},
        actuator=dict(actuator or {}),
        inputs={str(path): file_hash(path) for path in read if not path.is_dir()},
        machine=_machine(),
        time=datetime.now(UTC).isoformat(timespec="seconds").replace("+00:00", "Z"),
    )


def file_hash(path: Path) -> str:
    """SHA-256 of the file, 64 hexadecimal digits; HarnessError if it cannot be read."""
    try:
        return sha256(path)
    except OSError as error:
        raise HarnessError(f"{path}: cannot be read: {error.strerror or error}") from None


def sha256(path: Path) -> str:
    """As `file_hash`, but OSError if the file cannot be read."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _versions() -> dict[str, str]:
    found = {"ema-twins": __version__, "python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:  # vendored or frozen: known to be there, its version is not
            found[name] = "unknown"
    return found


def _machine() -> dict[str, str | int]:
    return {
        "system": f"{platform.system()} {platform.release()}",
        "architecture": platform.machine(),
        "processor": _processor(),
        "cores": os.cpu_count() or 1,
    }


def _processor() -> str:
    """Its name: Linux has it in a file, other systems tell Python."""
    try:
        lines = Path("/proc/cpuinfo").read_text(errors="replace").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or "unknown"
