"""Small FMUs that do one thing, from one library in C, c/small.c: feedthrough, loops, every type, and odd manners."""

import subprocess
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

import fmpy

from ema_fmu_src import ports

SOURCE = Path(__file__).parent / "c" / "small.c"
WARNS, NO_RESET, FALSE_RESET, NEEDS_STOP, REFUSES_INPUT, REFUSES_OUTPUT, EXITS, REFUSES_STEP, EQUAL_STEPS, SLOW = (
    2**bit for bit in range(10)
)
"""Manners, as in c/small.c."""
ITEMS = ("off", "slow", "fast")
MIRROR = (
    ("Integer", "number", "output", 0),
    ("Integer", "number_in", "input", 1),
    ("Integer", "manners", "parameter", 2),
    ("Enumeration", "mode", "output", 3),
    ("Enumeration", "mode_in", "input", 4),
    ("Boolean", "flag", "output", 0),
    ("Boolean", "flag_in", "input", 1),
    ("String", "text", "output", 0),
    ("String", "text_in", "input", 1),
    ("Real", "length", "output", 0),
)
OTHERS = (
    *(("Real", f"y{i}", "output", i) for i in range(2)),
    *(("Real", f"u{i}", "input", 2 + i) for i in range(2)),
    *(("Real", f"a{i}{j}", "parameter", 4 + 2 * i + j) for i in range(2) for j in range(2)),
    *(("Real", f"b{i}", "parameter", 8 + i) for i in range(2)),
    ("Integer", "manners", "parameter", 2),
)
TWIN = (
    *(("Real", port.name, "input", 2 + i) for i, port in enumerate(ports.INPUTS)),
    *((port.kind, port.name, "output", 0) for port in ports.OUTPUTS),
)
"""Our ports; all outputs are the command."""
STARTS = {"Real": "0.0", "Integer": "0", "Enumeration": "1", "Boolean": "false", "String": ""}


def library(folder: Path) -> Path:
    """The library, compiled into `folder`."""
    path = folder / "small.so"
    command = [sys.executable, "-m", "ziglang", "cc", "-target", "x86_64-linux-gnu.2.17", "-shared", "-fPIC", "-O1"]
    headers = str(Path(fmpy.__file__).parent / "c-code")
    subprocess.run([*command, "-I", headers, str(SOURCE), "-o", str(path)], check=True)
    return path


def build(
    library: Path,
    folder: Path,
    kind: str,
    *,
    manners: int = 0,
    depends: dict[str, Sequence[str]] | None = None,
    later: dict[str, Sequence[str]] | None = None,
    variable_steps: bool = True,
) -> Path:
    """The FMU of a `kind` that c/small.c knows, in `folder`.

    `depends`: on which inputs outputs depend at the start, as the FMU declares it, and `later` in steps; nothing is declared
    where None.
    """
    variables = {"mirror": MIRROR, "twin": TWIN}.get(kind, OTHERS)
    place = {name: str(number) for number, (_, name, _, _) in enumerate(variables, 1)}
    lines = []
    for type_, name, causality, reference in variables:
        start = "" if causality == "output" else f" start={quoteattr(STARTS[type_])}"
        declared = ' declaredType="Mode"' if type_ == "Enumeration" else ""
        change = {"parameter": "fixed", "input": "discrete"}.get(causality, "discrete")
        change = "continuous" if type_ == "Real" and causality != "parameter" else change
        lines.append(
            f'<ScalarVariable name="{name}" valueReference="{reference}" causality="{causality}" variability="{change}">'
            f"<{type_}{declared}{start}/></ScalarVariable>"
        )
    outputs = [name for _, name, causality, _ in variables if causality == "output"]

    def unknowns(given: dict[str, Sequence[str]] | None) -> str:
        known = {name: " ".join(place[each] for each in (given or {}).get(name, ())) for name in outputs}
        told = {name: "" if given is None else f' dependencies="{known[name]}"' for name in outputs}
        return "".join(f'<Unknown index="{place[name]}"{told[name]}/>' for name in outputs)

    items = "".join(f'<Item name="{name}" value="{value}"/>' for value, name in enumerate(ITEMS, 1))
    description = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="{kind}" guid="{kind}:{manners}">
<CoSimulation modelIdentifier="small" canHandleVariableCommunicationStepSize="{str(variable_steps).lower()}"/>
<TypeDefinitions><SimpleType name="Mode"><Enumeration>{items}</Enumeration></SimpleType></TypeDefinitions>
<ModelVariables>{"".join(lines)}</ModelVariables>
<ModelStructure><Outputs>{unknowns(later)}</Outputs><InitialUnknowns>{unknowns(depends)}</InitialUnknowns></ModelStructure>
</fmiModelDescription>"""
    path = folder / f"{kind}.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.write(library, "binaries/linux64/small.so")
    return path
