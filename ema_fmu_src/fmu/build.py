"""Builds the FMUs: gathers what goes into each, packs it and has it checked."""

import json
import os
import tempfile
import zipfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from xml.etree.ElementTree import indent, tostring

from fmpy.validation import validate_fmu

from .. import ports
from . import archive, description, source
from .native import library, targets

RUNTIMES = ("native", "python")
NATIVE_CAPABILITIES = {
    "canHandleVariableCommunicationStepSize": True,
    "canInterpolateInputs": True,
    "canGetAndSetFMUstate": True,
    "canSerializeFMUstate": True,
}
RECORD = "resources/build.json"
"""Archive name of what an FMU was built from."""


def fmu_name(model: str) -> str:
    """File name of the FMU of the twin `model`."""
    return f"EMA_{model}.fmu"


def built_from(path: Path) -> str:
    """Content hash of the sources that the FMU at `path` was built from; empty if it is none of ours."""
    try:
        with zipfile.ZipFile(path) as fmu:
            return str(json.loads(fmu.read(RECORD))["source"])
    except (OSError, KeyError, ValueError, zipfile.BadZipFile):
        return ""


def is_current(path: Path) -> bool:
    """Whether the FMU at `path` was built from the sources as they are now, for this platform too."""
    if not path.is_file() or built_from(path) != source.content_hash():
        return False
    with zipfile.ZipFile(path) as fmu:
        return any(name.startswith(f"binaries/{targets.PLATFORMS[targets.host()].folder}/") for name in fmu.namelist())


def build(
    models: Sequence[str] = ports.MODELS,
    *,
    out: Path,
    runtime: str = "native",
    platforms: Sequence[str] | None = None,
) -> list[Path]:
    """Write EMA_HF.fmu, EMA_ELF.fmu, EMA_LF.fmu (those in `models`) into the folder `out`; returns their paths.

    `runtime`: "native" (shared libraries without Python, for `platforms`, names in targets.PLATFORMS, by default this
    machine's) or "python" (pythonfmu's). Each file is written whole or not at all. Raises ValueError for an unknown
    model, runtime or platform, OSError if `out` cannot be written, RuntimeError if a kernel cannot be emitted, a
    library cannot be linked, or a built FMU does not pass FMPy's validation.
    """
    for kind, given, known in (
        ("twin", models, ports.MODELS),
        ("runtime", [runtime], RUNTIMES),
        ("platform", platforms or [], targets.PLATFORMS),
    ):
        unknown = sorted(set(given) - set(known))
        if unknown:
            raise ValueError(f"no {kind} {', '.join(unknown)}: {', '.join(known)} are known")
    if runtime == "python" and platforms:
        raise ValueError("the python runtime has pythonfmu's binaries, for linux64 and win64: no platform can be chosen")
    out.mkdir(parents=True, exist_ok=True)
    chosen = list(platforms or [targets.host()])
    with tempfile.TemporaryDirectory(prefix="ema_build_", dir=out) as scratch:

        def one(model: str) -> Path:
            own = Path(scratch) / model
            own.mkdir()
            members = _native(model, chosen, own) if runtime == "native" else _python(model, own)
            record = {"source": source.content_hash(), "runtime": runtime}
            members |= {RECORD: (json.dumps(record) + "\n").encode()}
            archive.write(own / fmu_name(model), members)
            _validate(own / fmu_name(model))
            return own / fmu_name(model)

        # compiling and linking are other processes' work; pythonfmu's builder is not to be run twice at once
        with ThreadPoolExecutor(os.cpu_count() if runtime == "native" else 1) as pool:
            finished = list(pool.map(one, models))
        return [path.replace(out / path.name) for path in finished]


def _native(model: str, platforms: Sequence[str], scratch: Path) -> dict[str, bytes]:
    root = description.model_description(
        model, runtime="native", source_hash=source.content_hash(), capabilities=NATIVE_CAPABILITIES
    )
    indent(root)
    text = b'<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="utf-8") + b"\n"
    return {"modelDescription.xml": text} | library.libraries(model, str(root.get("guid")), platforms, scratch=scratch)


def _python(model: str, scratch: Path) -> dict[str, bytes]:
    from . import python  # pythonfmu, which the native runtime does not need

    return python.members(model, scratch)


def _validate(path: Path) -> None:
    problems = validate_fmu(str(path))
    with zipfile.ZipFile(path) as fmu:
        if not any(name.startswith("binaries/") for name in fmu.namelist()):
            problems.append("it has no binary: is pythonfmu's installation whole?")
    if problems:
        raise RuntimeError(f"{path.name} does not validate: {'; '.join(problems)}")
