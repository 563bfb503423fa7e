"""FMU archives: what they say of themselves, and the ports that are needed."""

import io
import zipfile
from pathlib import Path
from typing import Any
from xml.parsers import expat

from fmpy import read_model_description

from ema_fmu_src import ports
from harness.errors import HarnessError
from harness.flight import archive

DESCRIPTION = "modelDescription.xml"
LARGEST_DESCRIPTION = 32 * 2**20
"""Bytes: some 100,000 variables. FMPy takes six times as much memory for it."""


def unpack(path: Path, into: Path) -> None:
    """Unpack the FMU at `path` into the folder `into`; HarnessError for anything but plain files below it."""
    with archive.opened(path) as found:
        found.unpack(into)


def describe(path: Path) -> Any:
    """FMPy's model description of the FMU at `path`; HarnessError unless it is FMI 2.0 co-simulation."""
    if not path.is_file():
        raise HarnessError(f"{path}: no such file; 'ema build' makes the FMUs")
    try:
        with archive.opened(path) as found:
            text = found.read(DESCRIPTION, LARGEST_DESCRIPTION)
    except KeyError:
        raise HarnessError(f"{path}: not an FMU, because it holds no {DESCRIPTION}") from None
    try:
        version = _fmi_version(text)
        description = read_model_description(_alone(text), validate=False) if version == "2.0" else None
    except Exception as error:  # noqa: BLE001 -- FMPy raises plain Exception, lxml and KeyError for a bad modelDescription.xml
        reason = archive.told(str(error).split("\n", 1)[0] or type(error).__name__)
        raise HarnessError(f"{path}: not an FMU: its {DESCRIPTION} cannot be read ({reason})") from None
    if description is None:
        raise HarnessError(f"{path}: FMI {archive.told(version)}, but FMI 2.0 is needed")
    if description.coSimulation is None:
        raise HarnessError(f"{path}: not a co-simulation FMU, but FMI 2.0 co-simulation is needed")
    return description


def _fmi_version(text: bytes) -> str:
    """The version that a model description states; ValueError for one with a document type: FMI has none, and entities of
    one grow without limit or read other files."""
    version = "unknown"

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal version
        version = attributes.get("fmiVersion", version)
        parser.StartElementHandler = None

    def refuse(*_: object) -> None:
        raise ValueError("it declares a document type")

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.StartDoctypeDeclHandler = start, refuse
    parser.Parse(text, True)
    return version


def _alone(text: bytes) -> io.BytesIO:
    """A model description as FMPy reads it: the only member of an archive."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as alone:
        alone.writestr(DESCRIPTION, text)
    packed.seek(0)
    return packed


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
