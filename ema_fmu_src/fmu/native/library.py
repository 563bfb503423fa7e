"""Compiles and links the shared libraries of a native FMU."""

import json
import os
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from importlib.util import find_spec
from itertools import groupby
from pathlib import Path

import fmpy

from ... import ports
from ...twins import CLOCK, NEVER, SLOPES, STALE, TOLERANCE, TWINS, Status
from ..description import CATEGORIES, DEFAULT_TOLERANCE
from ..variant import DEFAULT, Variant
from . import macho
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
    "-g0",
)
"""No contraction: a*b + c, rounded once on one platform and twice on another, would make their results differ."""
LINK = {"linux": ("-Wl,-z,defs", "-Wl,--build-id=none"), "windows": ("-Wl,-Brepro",)}
"""No undefined symbols except those of the C library; nothing that differs from build to build, as a time would."""
C_FILES = ("instance.c", "values.c", "saved.c", "fmi2.c")
"""Compiled as one translation unit: calls between the files would cost 2 to 8 % of a communication step of ELF+ and LF."""


def header(model: str, guid: str, variant: Variant = DEFAULT) -> str:
    """twin.h for the twin `model` ("HF", "ELF" or "LF"): its variables, sizes, clock and messages, and the FMU's GUID.

    The variables start as `variant` says.
    """

    def number(value: float | None, unbounded: str = "") -> str:
        return unbounded if value is None else float(value).hex()

    def table(kind: str, name: str, entries: Iterable[object]) -> str:
        return f"static const {kind} {name}[] = {{{', '.join(map(str, entries))}}};"

    inputs = [variable.name for variable in ports.INPUTS]
    lines = [
        "#include <float.h>",
        f"#define MODEL {json.dumps(f'EMA_{model}')}",
        f"#define GUID {json.dumps(guid)}",
        f"enum {{ N_VARIABLES = {len(ports.VARIABLES)}, N_INPUTS = {len(inputs)} }};",
        f"enum {{ N_STATES = {TWINS[model].n_states}, N_STATUS = {len(Status)} }};",
        f"enum {{ STALE = {STALE}, TOLERANCE = {TOLERANCE} }};",
        f"enum {{ {', '.join(f'STATUS_{status.name} = {status.value}' for status in Status)} }};",
        f"#define DEFAULT_TOLERANCE {number(DEFAULT_TOLERANCE)}",
        *_clock(TWINS[model].tick),
        "enum { REAL, INTEGER, BOOLEAN, STRING };",
        "enum { INPUT, OUTPUT, LOCAL, PARAMETER };",
        "typedef struct { const char *name; int kind, causality, fixed; double minimum, maximum, start; } Variable;",
        table("char *const", "STATUS", (json.dumps(status.message) for status in Status)),
        table("int", "SLOPE_OF", (SLOPES[name] for name in inputs)) + " /* place in x of the slope of each input */",
        "static const Variable VARIABLES[] = {",
    ]
    for variable in ports.VARIABLES:
        low, high = number(variable.minimum, "-DBL_MAX"), number(variable.maximum, "DBL_MAX")
        causality, fixed = variable.causality.upper(), int(variable.variability == "fixed")
        start = number(variant.start(variable, model))
        lines.append(f'    {{"{variable.name}", {_kind(variable)}, {causality}, {fixed}, {low}, {high}, {start}}},')
    kinds = [_kind(variable) for variable in ports.VARIABLES]
    numbers = {name: number for number, name in enumerate(inputs)}
    lines += [
        "};",
        table("unsigned char", "KIND_OF", kinds),
        "/* how many variables of one kind follow one another, by the value reference of the first */",
        table("unsigned short", "RUN_OF", (left for _, run in groupby(kinds) for left in range(len(list(run)), 0, -1))),
        "/* the number of an input among the inputs, by value reference; -1: it is none */",
        table("short", "INPUT_OF", (numbers.get(variable.name, -1) for variable in ports.VARIABLES)),
        table("unsigned", "INPUTS", (ports.INDEX[name] for name in inputs)),
        f"enum {{ {', '.join(CATEGORIES)}, N_CATEGORIES }};",
        table("char *const", "CATEGORIES", map(json.dumps, CATEGORIES)),
    ]
    return "\n".join([*lines, ""])


def _kind(variable: ports.Variable) -> str:
    """The type in C: FMI 2.0 gets and sets an Enumeration as an Integer."""
    return "INTEGER" if variable.kind == "Enumeration" else variable.kind.upper()


def _clock(tick: str) -> list[str]:
    """Where the twin's clock lies in a State, and how long a tick of it is: as the port `tick`, if one is given."""
    places = ", ".join(f"CLOCK_{name.upper()} = {place}" for name, place in CLOCK.items())
    length = f"v[{ports.INDEX[tick]}]" if tick else "x[CLOCK_STEP]"
    never = f"#define NEVER {float(NEVER).hex()}"
    return [f"enum {{ {places} }};", f"#define TICK_LENGTH(state) ((state)->{length})", never]


def _run(command: Sequence[str], *, environment: Mapping[str, str] | None = None) -> None:
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command[:4])} ... failed: {(done.stderr or done.stdout).strip()[-2000:]}")


def _emit(model: str, targets: Sequence[Target], scratch: Path) -> None:
    package = Path(__file__).resolve().parents[3]
    environment = {
        **os.environ,
        **ENVIRONMENT,
        "XDG_CACHE_HOME": str(scratch / "cache"),  # numba cannot show the LLVM code of what it finds in a cache
        "PYTHONPATH": os.pathsep.join([str(package), os.environ.get("PYTHONPATH", "")]),
    }
    program = "ema_fmu_src.fmu.native.emit"
    _run(
        [sys.executable, "-m", program, model, str(scratch), *(target.triple for target in targets)], environment=environment
    )


def _zig(*words: str) -> None:
    _run([sys.executable, "-m", "ziglang", *words])


def _link(model: str, target: Target, scratch: Path, name: str) -> bytes:
    folder = scratch / target.zig
    folder.mkdir()
    whole, compiled, linked = folder / "whole.c", folder / "whole.o", folder / name
    whole.write_text("".join(f'#include "{file}"\n' for file in C_FILES))
    standard = Path(fmpy.__file__).parent / "c-code"  # FMI's own headers
    include = [word for path in (Path(__file__).parent, standard, scratch) for word in ("-I", str(path))]
    system = target.zig.split("-")[1].partition(".")[0]
    position = () if system == "windows" else ("-fPIC",)
    _zig("cc", "-target", target.zig, *FLAGS, *position, *include, "-c", str(whole), "-o", str(compiled))
    objects = (str(compiled), str(scratch / f"{model}-{target.triple}.o"))
    if system == "macos":
        _zig(*macho.link(target, name, folder), *objects)
    else:
        _zig("cc", "-target", target.zig, "-shared", "-s", *LINK[system], *objects, "-o", str(linked))
    return linked.read_bytes()


def libraries(
    model: str, guid: str, platforms: Sequence[str], *, scratch: Path, variant: Variant = DEFAULT
) -> dict[str, bytes]:
    """The shared library of the twin `model` for each of `platforms` (names in PLATFORMS), archive name -> content.

    `variant`: the actuator whose start values it has. `scratch` is an empty folder for temporary files. RuntimeError with
    the tool's message if a kernel cannot be emitted or the C part does not compile or link; ModuleNotFoundError without
    ziglang.
    """
    if find_spec("ziglang") is None:
        raise ModuleNotFoundError("no module named ziglang", name="ziglang")
    chosen = [PLATFORMS[name] for name in platforms]
    (scratch / "twin.h").write_text(header(model, guid, variant))
    _emit(model, [target for platform in chosen for target in platform.targets], scratch)
    found = {}
    for platform in chosen:
        name = f"EMA_{model}{platform.suffix}"
        linked = {target: _link(model, target, scratch, name) for target in platform.targets}
        slices = {target.triple.split("-")[0]: content for target, content in linked.items()}
        content = macho.universal(slices) if len(slices) > 1 else next(iter(slices.values()))
        found[f"binaries/{platform.folder}/{name}"] = content
        found |= {f"binaries/{folder}/{name}": linked[target] for folder, target in platform.beside.items()}
    return found
