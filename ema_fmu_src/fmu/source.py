"""The sources that go into an FMU, and the hash that names their content."""

import hashlib
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent.parent


def files(package: Path = PACKAGE) -> list[Path]:
    """Python files of `package` that an FMU needs at run time, in a fixed order."""
    return sorted(path for path in package.rglob("*.py") if path.name != "build.py")


def content_hash(package: Path = PACKAGE) -> str:
    """SHA-256 over names and contents of `files(package)`, as 64 hexadecimal digits."""
    digest = hashlib.sha256()
    for path in files(package):
        digest.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()
