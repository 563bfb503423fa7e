"""The sources that FMUs are made from, and the hash that names their content."""

import hashlib
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent.parent
RUNTIME = (
    "__init__.py",
    "ports.py",
    "physics/**/*.py",
    "twins/**/*.py",
    "fmu/__init__.py",
    "fmu/description.py",
    "fmu/slave.py",
    "fmu/source.py",
)
"""What the python runtime needs inside the FMU."""


def files(package: Path = PACKAGE) -> list[Path]:
    """All sources of `package`, in a fixed order."""
    return sorted([*package.rglob("*.py"), *package.rglob("*.c")])


def runtime_files(package: Path = PACKAGE) -> list[Path]:
    """Those of `RUNTIME`, in a fixed order."""
    return sorted(path for pattern in RUNTIME for path in package.glob(pattern))


def content_hash(package: Path = PACKAGE) -> str:
    """SHA-256 over names and contents of `files(package)`, as 64 hexadecimal digits."""
    digest = hashlib.sha256()
    for path in files(package):
        digest.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()
