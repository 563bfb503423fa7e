"""Opens FMU archives safely: checks them, unpacks nothing outside its folder."""

import hashlib
import stat
import zipfile
import zlib
from pathlib import Path, PurePosixPath
from typing import Any
from xml.etree import ElementTree

from fmpy import read_model_description

from ema_fmu_src import ports
from harness.errors import HarnessError

LARGEST = 512 * 2**20
"""Most bytes that an FMU may unpack to."""


def content_hash(path: Path) -> str:
    """SHA-256 of the file, 64 hexadecimal digits."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def unpack(path: Path, into: Path) -> None:
    """Unpack the FMU at `path` into the folder `into`; HarnessError for anything but plain files below it."""
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            if sum(member.file_size for member in members) > LARGEST:
                raise HarnessError(f"{path}: unpacks to more than {LARGEST // 2**20} MiB")
            for member in members:
                name = PurePosixPath(member.filename.replace("\\", "/"))
                if name.is_absolute() or ".." in name.parts or ":" in member.filename:
                    raise HarnessError(f"{path}: member '{member.filename}' would land outside its folder")
                if stat.S_ISLNK(member.external_attr >> 16):
                    raise HarnessError(f"{path}: member '{member.filename}' is a link")
            archive.extractall(into)
    except OSError as error:
        raise HarnessError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (
        zipfile.BadZipFile,
        zlib.error,
        RuntimeError,
    ) as error:  # RuntimeError: encrypted, or packed in a way not known
        raise HarnessError(f"{path}: cannot be unpacked: {error}") from None


def _fmi_version(path: Path) -> str:
    try:
        with zipfile.ZipFile(path) as archive, archive.open("modelDescription.xml") as file:
            _, root = next(ElementTree.iterparse(file, events=("start",)))
    except KeyError:
        raise HarnessError(f"{path}: not an FMU, because it holds no modelDescription.xml") from None
    except (OSError, zipfile.BadZipFile, zlib.error, RuntimeError, ElementTree.ParseError) as error:
        raise HarnessError(f"{path}: not an FMU: its modelDescription.xml cannot be read ({error})") from None
    return root.get("fmiVersion", "unknown")


def describe(path: Path) -> Any:
    """FMPy's model description of the FMU at `path`; HarnessError unless it is FMI 2.0 co-simulation."""
    if not path.is_file():
        raise HarnessError(f"{path}: no such file; 'ema build' makes the FMUs")
    if not zipfile.is_zipfile(path):
        raise HarnessError(f"{path}: not an FMU, because it is not a zip archive")
    version = _fmi_version(path)
    if version != "2.0":
        raise HarnessError(f"{path}: FMI {version}, but FMI 2.0 is needed")
    try:
        description = read_model_description(str(path), validate=False)
    except Exception as error:  # noqa: BLE001 -- FMPy raises plain Exception, lxml and KeyError for a bad modelDescription.xml
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise HarnessError(f"{path}: not an FMU: its modelDescription.xml cannot be read ({reason})") from None
    if description.coSimulation is None:
        raise HarnessError(f"{path}: not a co-simulation FMU, but FMI 2.0 co-simulation is needed")
    return description


def require_ports(path: Path, description: Any) -> None:
    """HarnessError unless the FMU at `path` has the ports of the twins."""
    found = {variable.name: variable for variable in description.modelVariables}
    wrong = [
        port.name
        for port in (*ports.INPUTS, *ports.OUTPUTS)
        if port.name not in found or found[port.name].causality != port.causality or found[port.name].type != port.kind
    ]
    if wrong:
        raise HarnessError(f"{path}: not an EMA twin, these ports are missing or of another kind: {', '.join(wrong)}")
