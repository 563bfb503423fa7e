"""The sources that the FMUs are built from, and the hash of their content."""

import hashlib
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent.parent
RUNTIME = (
    "__init__.py",
    "fidelities.py",
    "ports.py",
    "variable.py",
    "physics/**/*.py",
    "twins/**/*.py",
    "fmu/__init__.py",
    "fmu/description.py",
    "fmu/markup.py",
    "fmu/python/__init__.py",
    "fmu/python/checks.py",
    "fmu/python/slave.py",
    "fmu/source.py",
    "fmu/units.py",
    "fmu/variant.py",
)
"""What the Python runtime needs inside an FMU."""


def files(package: Path = PACKAGE) -> list[Path]:
    """All source files of `package`, in a fixed order."""
    return sorted([*package.rglob("*.py"), *package.rglob("*.c"), *package.rglob("*.h")])


def runtime_files(package: Path = PACKAGE) -> list[Path]:
    """The files of `RUNTIME`, in a fixed order."""
    return sorted(path for pattern in RUNTIME for path in package.glob(pattern))


def content_hash(package: Path = PACKAGE) -> str:
    """SHA-256 of the names and contents of `files(package)`, as 64 hexadecimal digits."""
    digest = hashlib.sha256()
    for path in files(package):
        digest.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()
