"""A host in plain C, without Python, on every platform whose binaries can be run here; and what is inside the others.

Truth: the bits that FMPy gets from the same library on this machine.
"""

import os
import shutil
import struct
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path

import fmpy
import numpy as np
import pytest
from elftools.elf.dynamic import DynamicSection
from elftools.elf.elffile import ELFFile
from fmi import OUTPUT_REALS, STEP, Instance
from macholib import mach_o
from macholib.MachO import MachO
from signature import check_ad_hoc

from ema_fmu_src import ports
from ema_fmu_src.fmu.build import build
from ema_fmu_src.fmu.native import macho
from ema_fmu_src.fmu.native.targets import PLATFORMS

HOST = Path(__file__).parent / "c" / "host.c"
STEPS = 400
"""As in host.c."""
MEGABYTE = 1_000_000
FUNCTIONS = {
    "fmi2GetTypesPlatform", "fmi2GetVersion", "fmi2SetDebugLogging", "fmi2Instantiate", "fmi2FreeInstance",
    "fmi2SetupExperiment", "fmi2EnterInitializationMode", "fmi2ExitInitializationMode", "fmi2Terminate", "fmi2Reset",
    "fmi2GetReal", "fmi2GetInteger", "fmi2GetBoolean", "fmi2GetString", "fmi2SetReal", "fmi2SetInteger",
    "fmi2SetBoolean", "fmi2SetString", "fmi2GetFMUstate", "fmi2SetFMUstate", "fmi2FreeFMUstate",
    "fmi2SerializedFMUstateSize", "fmi2SerializeFMUstate", "fmi2DeSerializeFMUstate", "fmi2GetDirectionalDerivative",
    "fmi2SetRealInputDerivatives", "fmi2GetRealOutputDerivatives", "fmi2DoStep", "fmi2CancelStep", "fmi2GetStatus",
    "fmi2GetRealStatus", "fmi2GetIntegerStatus", "fmi2GetBooleanStatus", "fmi2GetStringStatus",
}  # fmt: skip
"""Of FMI 2.0 co-simulation (fmi2Functions.h)."""
WINE = shutil.which("wine") or next((p for p in ("/usr/lib/wine/wine64",) if Path(p).exists()), None)
QEMU = shutil.which("qemu-aarch64-static") if Path("/usr/aarch64-linux-gnu/lib").exists() else None


@pytest.fixture(scope="session")
def everywhere(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The FMUs with the binaries of all platforms."""
    paths = build(out=tmp_path_factory.mktemp("everywhere"), platforms=list(PLATFORMS))
    return dict(zip(ports.MODELS, paths, strict=True))


def library(fmu: Path, platform: str, folder: Path) -> Path:
    """The FMU's library for a platform, taken out into `folder`."""
    chosen = PLATFORMS[platform]
    name = f"binaries/{chosen.folder}/{fmu.stem}{chosen.suffix}"
    with zipfile.ZipFile(fmu) as archive:
        return Path(archive.extract(name, folder))


def host(platform: str, folder: Path) -> Path:
    """The C host, compiled for a platform by zig."""
    program = folder / ("host.exe" if platform == "win64" else "host")
    command = ["cc", "-target", PLATFORMS[platform].targets[0].zig, "-O1", "-Wall", "-Wextra", "-Werror"]
    include = Path(fmpy.__file__).parent / "c-code"
    references = {"COMMAND": "command", "LOAD_TORQUE": "load_torque", "N_A": "fault.N_a", "RESISTANCE": "motor.R"}
    command += [f"-D{macro}={ports.INDEX[name]}" for macro, name in references.items()]
    command += [f"-DOUTPUTS={','.join(map(str, OUTPUT_REALS))}"]
    command += ["-I", str(include), str(HOST), "-o", str(program), *([] if platform == "win64" else ["-ldl"])]
    subprocess.run([sys.executable, "-m", "ziglang", *command], check=True)
    return program


def bits(command: Sequence[str], fmu: Path, environment: dict[str, str] | None = None) -> list[list[str]]:
    guid = fmpy.read_model_description(str(fmu)).guid
    done = subprocess.run(
        [*command, guid], capture_output=True, text=True, check=False, env=os.environ | (environment or {})
    )
    assert done.returncode == 0, done.stderr
    return [line.split() for line in done.stdout.splitlines()]


def fmpys_bits(fmu: Path, folder: Path) -> list[list[str]]:
    """What the host prints, by FMPy: instances `one` and `other` under the commands of host.c."""
    columns = []
    for amplitude, n_a in ((0.2, 1.0), (-0.3, 0.8)):
        instance = Instance(fmu, folder / str(n_a))
        instance.set("fault.N_a", n_a)
        instance.start(command=0.0)
        rows = []
        for k in range(STEPS):
            phase = (k % 200) / 200.0
            instance.set("command", amplitude * (phase if phase < 0.5 else 1.0 - phase))
            instance.set("load_torque", 3.0 if k > 200 else 0.0)
            instance.step(k * STEP)
            rows += instance.fmu.getReal(OUTPUT_REALS)
        instance.close()
        columns.append([struct.pack(">d", value).hex() for value in rows])
    return [list(pair) for pair in zip(*columns, strict=True)]


@pytest.mark.parametrize("model", ports.MODELS)
def test_without_python_the_same_bits(fmus: dict[str, Path], tmp_path: Path, model: str) -> None:
    command = [str(host("linux64", tmp_path)), str(library(fmus[model], "linux64", tmp_path))]
    found = bits(command, fmus[model])
    assert len(found) == STEPS * len(OUTPUT_REALS) and np.unique(found).size > STEPS
    assert found == fmpys_bits(fmus[model], tmp_path)


@pytest.mark.skipif(WINE is None, reason="Wine is not installed")
@pytest.mark.parametrize("model", ports.MODELS)
def test_the_same_bits_under_wine(everywhere: dict[str, Path], tmp_path: Path, wine_prefix: Path, model: str) -> None:
    command = [str(WINE), str(host("win64", tmp_path)), str(library(everywhere[model], "win64", tmp_path))]
    environment = {"WINEPREFIX": str(wine_prefix), "WINEDEBUG": "-all", "WINEARCH": "win64", "DISPLAY": ""}
    assert bits(command, everywhere[model], environment) == fmpys_bits(everywhere[model], tmp_path)


@pytest.fixture(scope="session")
def wine_prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("wine")


@pytest.mark.skipif(QEMU is None, reason="qemu-user-static and libc6-arm64-cross are not installed")
@pytest.mark.parametrize("model", ports.MODELS)
def test_the_same_bits_on_arm64(everywhere: dict[str, Path], tmp_path: Path, model: str) -> None:
    program, binary = host("linux-arm64", tmp_path), library(everywhere[model], "linux-arm64", tmp_path)
    command = [str(QEMU), "-L", "/usr/aarch64-linux-gnu", str(program), str(binary)]
    assert bits(command, everywhere[model]) == fmpys_bits(everywhere[model], tmp_path)


@pytest.mark.parametrize("model", ports.MODELS)
@pytest.mark.parametrize("platform", ["linux64", "linux-arm64"])
def test_linux_binaries_need_the_c_library_only(
    everywhere: dict[str, Path], tmp_path: Path, platform: str, model: str
) -> None:
    with library(everywhere[model], platform, tmp_path).open("rb") as file:
        elf = ELFFile(file)
        (dynamic,) = (section for section in elf.iter_sections() if isinstance(section, DynamicSection))
        assert [tag.needed for tag in dynamic.iter_tags("DT_NEEDED")] == ["libc.so.6"]
        symbols = [symbol for symbol in elf.get_section_by_name(".dynsym").iter_symbols() if symbol.name]
        missing = {symbol.name for symbol in symbols if symbol["st_shndx"] == "SHN_UNDEF"}
        assert missing <= {"calloc", "free", "memcpy", "memset", "bcmp", "strcmp", "strlen", "strncmp", "vsnprintf"}
        assert {symbol.name for symbol in symbols} - missing == FUNCTIONS


@pytest.mark.parametrize("model", ports.MODELS)
def test_the_mac_binary_is_universal_and_whole(everywhere: dict[str, Path], tmp_path: Path, model: str) -> None:
    """Its structure only: nothing here can run it."""
    path = library(everywhere[model], "darwin64", tmp_path)
    binary, content = MachO(str(path)), path.read_bytes()
    assert {header.header.cputype for header in binary.headers} == {cpu for cpu, _ in macho.CPU.values()}
    for header in binary.headers:
        assert header.filetype == "dylib"
        assert [name for _, _, name in header.walkRelocatables()] == ["/usr/lib/libSystem.B.dylib"]
        names = [data.rstrip(b"\0") for load, _, data in header.commands if load.cmd == mach_o.LC_ID_DYLIB]
        assert names == [f"@rpath/{path.name}".encode()]
        (signature,) = (command for load, command, _ in header.commands if load.cmd == mach_o.LC_CODE_SIGNATURE)
        part = content[header.offset : header.offset + header.size]
        check_ad_hoc(part, signature.dataoff, signature.datasize)
    assert str(tmp_path.parent.parent).encode() not in content and b"ema_build_" not in content


@pytest.mark.parametrize("model", ports.MODELS)
def test_the_mac_binary_for_apples_processors_is_there_alone_too(everywhere: dict[str, Path], model: str) -> None:
    with zipfile.ZipFile(everywhere[model]) as archive:
        alone = archive.read(f"binaries/aarch64-darwin/{everywhere[model].stem}.dylib")
        both = archive.read(f"binaries/darwin64/{everywhere[model].stem}.dylib")
    cpu, _, offset, size, _ = struct.unpack_from(">5I", both, 28)  # the second of the two, after the head of 8 bytes
    assert cpu == macho.CPU["arm64"][0] and both[offset : offset + size] == alone


@pytest.mark.parametrize("model", ports.MODELS)
def test_an_fmu_for_all_platforms_is_small(everywhere: dict[str, Path], model: str) -> None:
    assert everywhere[model].stat().st_size < MEGABYTE
    with zipfile.ZipFile(everywhere[model]) as archive:
        folders = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
    assert folders == {folder for platform in PLATFORMS.values() for folder in (platform.folder, *platform.beside)}


def test_the_windows_binary_brings_the_licenses_of_what_starts_it(everywhere: dict[str, Path]) -> None:
    with zipfile.ZipFile(everywhere["LF"]) as archive:
        names = {name.rpartition("/")[2] for name in archive.namelist() if name.startswith("documentation/licenses/")}
        own = archive.read("documentation/licenses/license.txt").decode()
        assert names == {"license.txt", "mingw-w64.txt", "zig.txt"}
        assert "Zope Public License" in archive.read("documentation/licenses/mingw-w64.txt").decode()
    assert "mingw-w64.txt, zig.txt" in own


@pytest.mark.long
def test_a_binary_does_not_depend_on_its_company_nor_on_the_time(everywhere: dict[str, Path], tmp_path: Path) -> None:
    for platform in PLATFORMS:
        (fmu,) = build(["LF"], out=tmp_path, platforms=[platform])
        alone = library(fmu, platform, tmp_path / "alone").read_bytes()
        assert alone == library(everywhere["LF"], platform, tmp_path / "company").read_bytes(), platform
