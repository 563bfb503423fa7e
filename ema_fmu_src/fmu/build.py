"""Builds the FMUs: collects the content of each, packs it and validates the result."""

import hashlib
import json
import os
import tempfile
import zipfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from fmpy.validation import validate_fmu

from .. import ports
from ..fidelities import fmu_name
from . import archive, crosscheck, description, documentation, image, licenses, markup, source, ssp
from .native import library, targets
from .variant import DEFAULT, Variant, checked

RUNTIMES = ("native", "python")
NATIVE_CAPABILITIES = {
    "canHandleVariableCommunicationStepSize": True,
    "canInterpolateInputs": True,
    "canGetAndSetFMUstate": True,
    "canSerializeFMUstate": True,
}
SSP = "ema.ssp"
RECORD = "resources/build.json"
"""Archive name of the record of what an FMU was built from."""


def _content(model: str, variant: Variant) -> dict[str, str]:
    """What the FMU of the twin `model` would be built from now: hashes of sources and cross-check results, the actuator."""
    results = hashlib.sha256(b"".join(_crosscheck(model, variant).values())).hexdigest()
    return {"source": source.content_hash(), "reference": results} | variant.record


def built_from(path: Path) -> dict[str, str]:
    """The record in the FMU at `path`: its runtime and the hashes of its content; empty if there is none."""
    try:
        with zipfile.ZipFile(path) as fmu:
            return dict(json.loads(fmu.read(RECORD)))
    except (OSError, KeyError, ValueError, zipfile.BadZipFile):
        return {}


def is_current(path: Path, variant: Variant = DEFAULT) -> bool:
    """Whether the FMU at `path` was built from the present sources for `variant` and runs on this platform, with either
    runtime."""
    model = path.stem.removeprefix("EMA_")
    if model not in ports.MODELS or not path.is_file() or not built_from(path).items() >= _content(model, variant).items():
        return False
    with zipfile.ZipFile(path) as fmu:
        return any(name.startswith(f"binaries/{targets.PLATFORMS[targets.host()].folder}/") for name in fmu.namelist())


def build(
    models: Sequence[str] = ports.MODELS,
    *,
    out: Path,
    runtime: str = "native",
    platforms: Sequence[str] | None = None,
    variant: Variant = DEFAULT,
) -> list[Path]:
    """Write EMA_HF.fmu, EMA_ELF.fmu, EMA_LF.fmu (those in `models`) into the folder `out`; returns their paths.

    HF is accompanied by ema.ssp, a system with HF as its component.

    `runtime` is "native" (shared libraries that need no Python) or "python" (pythonfmu). `platforms` are names in
    targets.PLATFORMS, by default this machine's; native only. `variant` is the actuator whose start values they have; the
    cross-check results, which are the default actuator's, go only with that one. Each file is written completely or not at
    all. ValueError for an unknown model, runtime or platform, or a start value that no port has; OSError if `out` cannot be
    written; RuntimeError if a kernel cannot be emitted, a library cannot be linked, or an FMU does not pass FMPy's
    validation.
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
    checked(variant)
    out.mkdir(parents=True, exist_ok=True)
    chosen = list(platforms or [targets.host()])
    with tempfile.TemporaryDirectory(prefix="ema_build_", dir=out) as scratch:

        def one(model: str) -> Path:
            own = Path(scratch) / model
            own.mkdir()
            members = _native(model, chosen, own, variant) if runtime == "native" else _python(model, own, variant)
            record = _content(model, variant) | {"runtime": runtime}
            members |= {RECORD: (json.dumps(record) + "\n").encode()} | _carried(model, variant)
            archive.write(own / fmu_name(model), members)
            _validate(own / fmu_name(model))
            return own / fmu_name(model)

        # compilers and linkers are processes of their own; pythonfmu's builder must not run twice at once
        with ThreadPoolExecutor(os.cpu_count() if runtime == "native" else 1) as pool:
            finished = list(pool.map(one, models))
        if "HF" in models:
            ssp.write(Path(scratch) / SSP, Path(scratch) / "HF" / fmu_name("HF"), variant)
            (Path(scratch) / SSP).replace(out / SSP)
        return [path.replace(out / path.name) for path in finished]


def _carried(model: str, variant: Variant) -> dict[str, bytes]:
    """What an FMU holds besides its model description and its runtime."""
    return {
        "documentation/index.html": documentation.page(model, variant).encode(),
        "model.png": image.png(model),
        **_crosscheck(model, variant),
    }


def _crosscheck(model: str, variant: Variant) -> dict[str, bytes]:
    """The cross-check results of the default actuator; none of another."""
    return {} if variant.digest else crosscheck.members(model)


def _native(model: str, platforms: Sequence[str], scratch: Path, variant: Variant) -> dict[str, bytes]:
    root = description.model_description(
        model,
        runtime="native",
        source_hash=source.content_hash(),
        capabilities=NATIVE_CAPABILITIES,
        variant=variant,
    )
    binaries = library.libraries(model, str(root.get("guid")), platforms, scratch=scratch, variant=variant)
    return {"modelDescription.xml": markup.document(root)} | binaries | licenses.native(platforms)


def _python(model: str, scratch: Path, variant: Variant) -> dict[str, bytes]:
    from .python import packing  # pythonfmu, which the native runtime does not need

    return packing.members(model, scratch, variant) | licenses.python()


def _validate(path: Path) -> None:
    problems = validate_fmu(str(path))
    with zipfile.ZipFile(path) as fmu:
        if not any(name.startswith("binaries/") for name in fmu.namelist()):
            problems.append("it has no binary: is the installation of pythonfmu complete?")
    if problems:
        raise RuntimeError(f"{path.name} does not validate: {'; '.join(problems)}")
