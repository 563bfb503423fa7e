"""The native runtime's seam: an instance that knows no version of FMI, and an adapter that knows no twin."""

import ctypes
import subprocess
import sys
from pathlib import Path

import fmpy
import pytest
from fmpy.fmi2 import fmi2CallbackFunctions

from ema_fmu_src import ports
from ema_fmu_src.fmu.native import library, targets

NATIVE = Path(library.__file__).parent
STANDARD = Path(fmpy.__file__).parent / "c-code"
CO_SIMULATION = 1
TARGET = targets.PLATFORMS[targets.host()].targets[0]
STEP = 1e-4  # s


def compiled(source: Path, *include: Path, to: Path) -> None:
    """Compiles one C file as the build does, with these folders for its headers."""
    folders = [word for folder in include for word in ("-I", str(folder))]
    command = [sys.executable, "-m", "ziglang", "cc", "-target", TARGET.zig, *library.FLAGS, "-fPIC", "-c"]
    subprocess.run([*command, *folders, str(source), "-o", str(to)], check=True)


def test_the_adapter_needs_no_twin_and_the_rest_no_fmi(tmp_path: Path) -> None:
    """Each file alone, with only those headers to be found that it may know."""
    (tmp_path / "twin.h").write_text(library.header("LF", "{guid}"))
    for name in library.C_FILES:
        known = STANDARD if name == "fmi2.c" else tmp_path
        compiled(NATIVE / name, NATIVE, known, to=tmp_path / f"{name}.o")


def test_slopes_find_their_inputs_wherever_they_are(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """With the inputs scattered among the variables, and kernels that hand their slopes back as outputs."""
    first, *rest = (variable for variable in ports.VARIABLES if variable.causality != "input")
    command, load, supply = ports.INPUTS
    scattered = (first, supply, *rest[:40], load, *rest[40:], command)
    place = {variable.name: reference for reference, variable in enumerate(scattered)}
    monkeypatch.setattr(ports, "VARIABLES", scattered)
    (tmp_path / "twin.h").write_text(library.header("LF", "{guid}"))
    compiled(Path(__file__).parent / "c" / "kernels.c", tmp_path, to=tmp_path / f"LF-{TARGET.triple}.o")
    (tmp_path / "twin.so").write_bytes(library._link("LF", TARGET, tmp_path, "LF"))

    fmu = ctypes.CDLL(str(tmp_path / "twin.so"))
    fmu.fmi2Instantiate.restype = ctypes.c_void_p
    made = fmu.fmi2Instantiate(b"test", CO_SIMULATION, b"{guid}", b"", ctypes.byref(fmi2CallbackFunctions()), 0, 0)
    instance = ctypes.c_void_p(made)
    assert fmu.fmi2EnterInitializationMode(instance) == fmu.fmi2ExitInitializationMode(instance) == 0
    inputs = (ctypes.c_uint * 3)(*(place[variable.name] for variable in ports.INPUTS))
    orders, slopes = (ctypes.c_int * 3)(1, 1, 1), (ctypes.c_double * 3)(2.0, -3.0, 5.0)
    assert fmu.fmi2SetRealInputDerivatives(instance, inputs, ctypes.c_size_t(3), orders, slopes) == 0
    assert fmu.fmi2DoStep(instance, ctypes.c_double(0.0), ctypes.c_double(STEP), 1) == 0
    outputs = (ctypes.c_uint * 3)(*(place[variable.name] for variable in ports.OUTPUTS[:3]))
    values = (ctypes.c_double * 3)()
    assert fmu.fmi2GetReal(instance, outputs, ctypes.c_size_t(3), values) == 0
    assert list(values) == list(slopes)
    fmu.fmi2FreeInstance(instance)
