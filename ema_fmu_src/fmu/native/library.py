"""Compiles and links the shared libraries of a native FMU."""

import json
import math
import os
import struct
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path

import fmpy

from ... import ports
from ...twins import SLOPES, STALE, TOLERANCE, TWINS, Status
from .emit import ENVIRONMENT
from .targets import PLATFORMS, Target

FLAGS = (
    "-std=c11",
    "-O2",
    "-ffp-contract=off",
    "-fvisibility=hidden",
    "-Wall",
    "-Wextra",
    "-Werror",
    "-shared",
    "-s",
    "-g0",
)
"""No contraction: a*b + c rounded once on one platform and twice on another would part the results."""
LINUX_FLAGS = ("-fPIC", "-Wl,-z,defs", "-Wl,--build-id=none")
"""No undefined symbol but the C library's; nothing that differs from build to build."""
FAT_MAGIC, FAT_ALIGN = 0xCAFEBABE, 14
MAC_CPU = {"x86_64": (0x01000007, 3), "arm64": (0x0100000C, 0)}
"""cputype and cpusubtype of Mach-O."""


def header(model: str, guid: str) -> str:
    """twin.h for the twin `model` ("HF", "ELF" or "LF"): its variables, sizes, messages and the GUID."""

    def number(value: float | None, unbounded: str) -> str:
        return unbounded if value is None or math.isinf(value) else float(value).hex()

    def table(kind: str, name: str, entries: Iterable[object]) -> str:
        return f"static const {kind} {name}[] = {{{', '.join(map(str, entries))}}};"

    inputs = [variable.name for variable in ports.INPUTS]
    lines = [
        f"#define MODEL {json.dumps(f'EMA_{model}')}",
        f"#define GUID {json.dumps(guid)}",
        f"enum {{ N_VARIABLES = {len(ports.VARIABLES)}, N_INPUTS = {len(inputs)} }};",
        f"enum {{ N_STATES = {TWINS[model].n_states}, N_STATUS = {len(Status)} }};",
        f"enum {{ STALE = {STALE}, TOLERANCE = {TOLERANCE} }};",
        f"enum {{ {', '.join(f'STATUS_{status.name} = {status.value}' for status in Status)} }};",
        "enum { REAL, INTEGER, BOOLEAN, STRING };",
        "enum { INPUT, OUTPUT, LOCAL, PARAMETER };",
        "typedef struct { const char *name; int kind, causality, fixed; double minimum, maximum, start; } Variable;",
        table("char *const", "STATUS", (json.dumps(status.message) for status in Status)),
        table("int", "SLOPE_OF", (SLOPES[name] for name in inputs)) + " /* place in x of the slope of each input */",
        table("int", "INPUT_OF", (inputs.index(v.name) if v.name in inputs else -1 for v in ports.VARIABLES))
        + " /* number of the input with this value reference */",
        "static const Variable VARIABLES[] = {",
    ]
    for variable in ports.VARIABLES:
        low, high = number(variable.minimum, "-INFINITY"), number(variable.maximum, "INFINITY")
        start = number(variable.start_for(model), "")
        kind, causality, fixed = variable.kind.upper(), variable.causality.upper(), int(variable.variability == "fixed")
        lines.append(f'    {{"{variable.name}", {kind}, {causality}, {fixed}, {low}, {high}, {start}}},')
    kinds = table("unsigned char", "KIND_OF", (variable.kind.upper() for variable in ports.VARIABLES))
    return "\n".join([*lines, "};", kinds, ""])


def _run(command: Sequence[str], *, environment: Mapping[str, str] | None = None) -> None:
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command[:4])} ... failed: {(done.stderr or done.stdout).strip()[-2000:]}")


def _emit(model: str, targets: Sequence[Target], scratch: Path) -> None:
    package = Path(__file__).resolve().parents[3]
    environment = {
        **os.environ,
        **ENVIRONMENT,
        "XDG_CACHE_HOME": str(scratch / "cache"),  # what numba finds in a cache cannot be inspected any more
        "PYTHONPATH": os.pathsep.join([str(package), os.environ.get("PYTHONPATH", "")]),
    }
    program = "ema_fmu_src.fmu.native.emit"
    _run(
        [sys.executable, "-m", program, model, str(scratch), *(target.triple for target in targets)], environment=environment
    )


def _link(model: str, target: Target, scratch: Path, name: str) -> bytes:
    source = Path(__file__).with_name("fmi2.c")
    include = Path(fmpy.__file__).parent / "c-code"  # the standard's own headers
    folder = scratch / target.zig
    folder.mkdir()
    elf = LINUX_FLAGS if "linux" in target.zig else ()
    sources = (str(source), str(scratch / f"{model}-{target.triple}.o"))
    where = ("-I", str(include), "-I", str(scratch), "-o", str(folder / name))
    _run([sys.executable, "-m", "ziglang", "cc", "-target", target.zig, *FLAGS, *elf, *where, *sources])
    return (folder / name).read_bytes()


def _universal(slices: Mapping[str, bytes]) -> bytes:
    """A universal Mach-O binary of one for each processor (the format of mach-o/fat.h)."""
    head = struct.pack(">II", FAT_MAGIC, len(slices))
    body = b""
    offset = 1 << FAT_ALIGN
    for name, content in slices.items():
        padded = content + bytes(-len(content) % (1 << FAT_ALIGN))
        head += struct.pack(">5I", *MAC_CPU[name], offset, len(content), FAT_ALIGN)
        body += padded
        offset += len(padded)
    return head.ljust(1 << FAT_ALIGN, b"\0") + body


def libraries(model: str, guid: str, platforms: Sequence[str], *, scratch: Path) -> dict[str, bytes]:
    """The shared library of the twin `model` for each of `platforms` (names in PLATFORMS): archive name -> content.

    `scratch` is an empty folder for what is made on the way. RuntimeError with the tool's message if a kernel cannot be
    emitted, or if the C part does not compile or link; ModuleNotFoundError without ziglang.
    """
    if find_spec("ziglang") is None:
        raise ModuleNotFoundError("no module named ziglang", name="ziglang")
    chosen = [PLATFORMS[name] for name in platforms]
    (scratch / "twin.h").write_text(header(model, guid))
    _emit(model, [target for platform in chosen for target in platform.targets], scratch)
    found = {}
    for platform in chosen:
        name = f"EMA_{model}{platform.suffix}"
        linked = {target.triple.split("-")[0]: _link(model, target, scratch, name) for target in platform.targets}
        content = _universal(linked) if len(linked) > 1 else next(iter(linked.values()))
        found[f"binaries/{platform.folder}/{name}"] = content
    return found
