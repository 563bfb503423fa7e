"""FMUs of others' making: one that misbehaves, from `c/bad.c`; and what is left of the processes that tests have started."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy

SOURCE = Path(__file__).parent / "c" / "bad.c"
HEADERS = Path(fmpy.__file__).parent / "c-code"


def library(folder: Path, *options: str) -> Path:
    """`bad.c`, compiled in `folder` (once)."""
    path = folder / f"bad{''.join(options)}.so"
    command = [sys.executable, "-m", "ziglang", "cc", "-target", "x86_64-linux-gnu.2.17", "-shared", "-fPIC", "-O1"]
    if not path.exists():
        subprocess.run([*command, *options, "-I", str(HEADERS), str(SOURCE), "-o", str(path)], check=True)
    return path


def replace_library(fmu: Path, library: Path) -> None:
    """Put a library in the place of the FMU's own."""
    with zipfile.ZipFile(fmu) as old:
        members = {name: old.read(name) for name in old.namelist()}
    members[f"binaries/linux64/{fmu.stem}.so"] = library.read_bytes()
    with zipfile.ZipFile(fmu, "w") as new:
        for name, content in members.items():
            new.writestr(name, content)


def shielded() -> list[int]:
    """Processes that live and descend from one that this test has started for an FMU."""
    test = f"PYTEST_CURRENT_TEST={os.environ['PYTEST_CURRENT_TEST']}".encode()
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        try:
            inherited = (path / "environ").read_bytes().split(b"\0")
            state = (path / "stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            continue
        if test in inherited and any(text.startswith(b"EMA_SHIELD=") for text in inherited) and state != "Z":
            found.append(int(path.name))
    return found
