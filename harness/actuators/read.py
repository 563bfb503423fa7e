"""An actuator by the name that the library has for it, or from a file."""

from pathlib import Path

from harness.actuators.actuator import DEFAULT, Actuator
from harness.actuators.ssvfile import read_ssv
from harness.actuators.tomlfile import read_actuator_toml
from harness.errors import HarnessError, unknown

LIBRARY = Path(__file__).with_name("library")
"""Folder of the actuators that come with the package."""
READERS = {".toml": read_actuator_toml, ".ssv": read_ssv}


def library() -> list[str]:
    """Names of the actuators that come with the package, the default first."""
    return [DEFAULT.name, *sorted(path.stem for path in LIBRARY.glob("*.toml") if path.stem != DEFAULT.name)]


def read_actuator(name_or_file: str, where: str = "--actuator") -> Actuator:
    """The actuator of that name in the library, or in a .toml file (README.md here) or .ssv file (SSP parameter set).

    HarnessError, beginning with file and key or with `where`, for a name that the library does not have, a file that
    cannot be read, and whatever in it is unknown, in a wrong unit or out of range.
    """
    path = Path(name_or_file)
    if path.suffix.lower() in READERS:
        return READERS[path.suffix.lower()](path)
    if name_or_file in library():
        return read_actuator_toml(LIBRARY / f"{name_or_file}.toml")
    if path.exists():
        raise HarnessError(f"{where} {name_or_file}: a .toml file, or an .ssv file (SSP parameter set), is needed")
    error = unknown("actuator", name_or_file, library())
    raise HarnessError(f"{where}: {error}; or the path of a .toml or .ssv file")
