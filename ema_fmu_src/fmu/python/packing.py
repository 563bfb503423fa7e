"""What the Python runtime puts into an FMU: pythonfmu's binaries, an entry script and the sources."""

import sys
import tempfile
import zipfile
from pathlib import Path

from pythonfmu.builder import FmuBuilder

from .. import source
from ..variant import DEFAULT, Variant

SCRIPT = '''"""Entry script of the FMU EMA_{model}: runs the sources that the FMU was built from, wherever they are."""

import ctypes
import importlib
import sys
from pathlib import Path

HASH = "{digest}"
BUNDLE = "{bundle}"
FOLDER = str(Path(__file__).parent)

# At each instantiation pythonfmu 0.7.0 runs this file in the module's dictionary and then decrements the reference count of
# that dictionary once too often, which would crash the host after some instances: each run adds one.
ctypes.pythonapi.Py_IncRef(ctypes.py_object(globals()))

if FOLDER in sys.path:  # behind the host's own modules, one of which may be pythonfmu's builder
    sys.path.append(sys.path.pop(sys.path.index(FOLDER)))


def _sources():
    """The installed ema_fmu_src if it has the content of this FMU's sources (its kernels may be compiled), else those."""
    try:
        source = importlib.import_module("ema_fmu_src.fmu.source")
        return "ema_fmu_src" if source.content_hash() == HASH else BUNDLE
    except (ImportError, AttributeError, OSError):
        return BUNDLE


class EMA_{model}(importlib.import_module(_sources() + ".fmu.python.slave").Slave):
    model = "{model}"
    sources = HASH
    actuator = {actuator!r}
'''


def members(model: str, scratch: Path, variant: Variant = DEFAULT) -> dict[str, bytes]:
    """Model description, binaries and resources of the twin `model` ("HF", "ELF" or "LF"), archive name -> content.

    `variant`: the actuator whose start values it has. `scratch` is a folder for temporary files.
    """
    digest = source.content_hash()
    bundle = f"ema_fmu_src_{digest[:8]}"
    module = f"EMA_{model}_{digest[:8]}{variant.digest[:8]}"
    starts = {name: float(value) for name, value in variant.starts.items()}
    actuator = (variant.name, variant.description, starts, dict(variant.about), variant.output)
    with tempfile.TemporaryDirectory(dir=scratch) as folder:
        script = Path(folder) / f"{module}.py"
        script.write_text(SCRIPT.format(model=model, digest=digest, bundle=bundle, actuator=actuator))
        copy = Path(folder) / bundle
        for path in source.runtime_files():
            target = copy / path.relative_to(source.PACKAGE)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(path.read_bytes())
        search_path = list(sys.path)
        try:
            packed = FmuBuilder.build_FMU(script, dest=Path(folder) / "packed", project_files=[copy])
        finally:
            sys.path[:] = search_path
            sys.modules.pop(module, None)
        with zipfile.ZipFile(packed) as archive:
            return {name: archive.read(name) for name in archive.namelist()}
