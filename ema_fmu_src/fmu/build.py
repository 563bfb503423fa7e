"""Builds the FMUs: pythonfmu packs them, this module makes the archives whole, reproducible and checked."""

import os
import re
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

from fmpy.validation import validate_fmu
from pythonfmu.builder import FmuBuilder

from .. import ports
from . import source

DATE = (2026, 1, 1, 0, 0, 0)
"""Of every member of the archive, so that the same source gives the same bytes."""

SCRIPT = '''"""Entry of the FMU EMA_{model}: takes the sources that it was built from, wherever they are."""

import ctypes
import importlib
import sys
from pathlib import Path

HASH = "{digest}"
BUNDLE = "{bundle}"
FOLDER = str(Path(__file__).parent)

# pythonfmu 0.7.0 runs this file in the module's dictionary at each instantiation and then releases that dictionary
# once too often, which would crash the host after some instances: each run leaves one reference behind.
ctypes.pythonapi.Py_IncRef(ctypes.py_object(globals()))

if FOLDER in sys.path:  # behind the host's own modules, as pythonfmu's builder in a process that also builds
    sys.path.append(sys.path.pop(sys.path.index(FOLDER)))


def _sources():
    """The installed ema_fmu_src if its content is that of this FMU (its kernels are compiled then), else the bundle."""
    try:
        source = importlib.import_module("ema_fmu_src.fmu.source")
        return "ema_fmu_src" if source.content_hash() == HASH else BUNDLE
    except (ImportError, AttributeError, OSError):
        return BUNDLE


class EMA_{model}(importlib.import_module(_sources() + ".fmu.slave").Slave):
    model = "{model}"
    sources = HASH
'''


def fmu_name(model: str) -> str:
    """File name of the FMU of the twin `model`."""
    return f"EMA_{model}.fmu"


def built_from(path: Path) -> str:
    """Content hash of the sources that the FMU at `path` was built from; empty if it is none of ours."""
    try:
        with zipfile.ZipFile(path) as archive:
            for name in archive.namelist():
                if re.fullmatch(r"resources/EMA_[A-Z]+_[0-9a-f]{8}\.py", name):
                    found = re.search(r'^HASH = "([0-9a-f]{64})"$', archive.read(name).decode(), re.MULTILINE)
                    return found.group(1) if found else ""
    except (OSError, zipfile.BadZipFile):
        pass
    return ""


def is_current(path: Path) -> bool:
    """Whether the FMU at `path` was built from the sources as they are now."""
    return path.is_file() and built_from(path) == source.content_hash()


def build(models: Sequence[str] = ports.MODELS, *, out: Path) -> list[Path]:
    """Write EMA_HF.fmu, EMA_ELF.fmu, EMA_LF.fmu (those in `models`) into the folder `out`; returns their paths.

    Each is written whole or not at all. Raises ValueError for an unknown model, OSError if `out` cannot be written,
    RuntimeError if a built FMU has no binary or does not pass FMPy's validation.
    """
    unknown = sorted(set(models) - set(ports.MODELS))
    if unknown:
        raise ValueError(f"no twin {', '.join(unknown)}: the twins are {', '.join(ports.MODELS)}")
    out.mkdir(parents=True, exist_ok=True)
    return [_build_one(model, out) for model in models]


def _build_one(model: str, out: Path) -> Path:
    digest = source.content_hash()
    bundle = f"ema_fmu_src_{digest[:8]}"
    with tempfile.TemporaryDirectory(prefix="ema_build_", dir=out) as scratch:
        module = f"EMA_{model}_{digest[:8]}"
        script = Path(scratch) / f"{module}.py"
        script.write_text(SCRIPT.format(model=model, digest=digest, bundle=bundle))
        copy = Path(scratch) / bundle
        for path in source.files():
            target = copy / path.relative_to(source.PACKAGE)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(path.read_bytes())
        search_path = list(sys.path)
        try:
            packed = FmuBuilder.build_FMU(script, dest=Path(scratch) / "packed", project_files=[copy])
        finally:
            sys.path[:] = search_path
            sys.modules.pop(module, None)
        finished = Path(scratch) / fmu_name(model)
        _repack(Path(packed), finished)
        problems = validate_fmu(str(finished))
        with zipfile.ZipFile(finished) as archive:
            if not any(name.startswith("binaries/") for name in archive.namelist()):
                problems.append("it has no binary: is pythonfmu's installation whole?")
        if problems:
            raise RuntimeError(f"{fmu_name(model)} does not validate: {'; '.join(problems)}")
        os.replace(finished, out / fmu_name(model))
    return out / fmu_name(model)


def _repack(packed: Path, finished: Path) -> None:
    """Copy the archive with fixed dates, order and permissions."""
    with zipfile.ZipFile(packed) as old, zipfile.ZipFile(finished, "w", zipfile.ZIP_DEFLATED) as new:
        for name in sorted(set(old.namelist())):
            member = zipfile.ZipInfo(name, DATE)
            member.external_attr = 0o644 << 16
            member.compress_type = zipfile.ZIP_DEFLATED
            new.writestr(member, old.read(name))
