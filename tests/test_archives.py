"""Archives of others, damaged, hostile or unusual: each is opened as it is meant, or refused in one line, in bounds."""

import os
import shutil
import struct
import time
import tracemalloc
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from harness import provenance
from harness.errors import HarnessError
from harness.flight import archive, fmufile
from harness.flight.twin import Twin
from harness.trials import Trial, trial

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="m" guid="g">{0}<CoSimulation modelIdentifier="m"/>
<ModelVariables><ScalarVariable name="x" valueReference="1" causality="output"><Real/></ScalarVariable></ModelVariables>
<ModelStructure/></fmiModelDescription>
"""
MEMBERS = {
    "modelDescription.xml": DESCRIPTION.format("").encode(),
    "binaries/linux64/m.so": bytes(range(64)) * 4,
    "resources/data.txt": b"data\n",
}


def packed(path: Path, members: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(path, "w", method) as file:
        for name, content in members.items():
            file.writestr(name, content)
    return path


def unpacked(path: Path, into: Path) -> dict[str, bytes]:
    """What is below the folder after unpacking, which is then removed."""
    into.mkdir()
    try:
        fmufile.describe(path)
        fmufile.unpack(path, into)
        return {str(file.relative_to(into)): file.read_bytes() for file in into.rglob("*") if file.is_file()}
    finally:
        shutil.rmtree(into)


def short() -> Trial:
    whole = trial("SIN")
    return Trial("SIN", 0.0, whole.step, {name: series[:20] for name, series in whole.inputs.items()}, "test")


@contextmanager
def within(*, seconds: float, mib: float) -> Iterator[None]:
    """Asserts that the block takes no more time and memory."""
    tracemalloc.start()
    began = time.process_time()
    try:
        yield
        spent, (_, peak) = time.process_time() - began, tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert spent < seconds and peak < mib * 2**20, (spent, peak / 2**20)


def test_every_byte_of_an_archive_may_be_wrong(tmp_path: Path) -> None:
    """Each byte in turn, and many lengths: the same files, or one line."""
    path, into = tmp_path / "m.fmu", tmp_path / "into"
    original = packed(path, MEMBERS).read_bytes()
    whole = unpacked(path, into)
    assert whole == MEMBERS
    rng = np.random.default_rng(18)
    flipped = [(place, int(rng.integers(1, 256))) for place in range(len(original))]
    cut = [(place, 0) for place in range(0, len(original), 20)]
    refusals = []
    for place, change in flipped + cut:
        damaged = bytearray(original)
        damaged[place] ^= change
        path.write_bytes(damaged if change else damaged[:place])
        try:
            found = unpacked(path, into)
        except HarnessError as error:
            refusals.append(str(error))
        else:
            assert found == whole, place
    assert len(refusals) > 0.5 * len(flipped)
    assert all("\n" not in line and line.startswith(str(path)) and len(line) < 3000 for line in refusals)


def test_an_fmu_with_a_wrong_byte_flies_or_is_refused(fmus: dict[str, Path], tmp_path: Path) -> None:
    original, path = fmus["LF"].read_bytes(), tmp_path / "EMA_LF.fmu"
    with Twin(fmus["LF"]) as twin:
        expected = twin.run(short())
    rng = np.random.default_rng(18)
    structure = len(original) - 3000  # the list of members is at the end
    places = [*rng.integers(0, len(original), 15), *rng.integers(structure, len(original), 45)]
    flown, refusals = 0, []
    for place in places:
        damaged = bytearray(original)
        damaged[place] ^= int(rng.integers(1, 256))
        path.write_bytes(damaged)
        try:
            with Twin(path) as twin:
                assert twin.run(short()).equals(expected)
            flown += 1
        except HarnessError as error:
            refusals.append(str(error))
    assert flown and refusals and all("\n" not in line for line in refusals)


def test_names_as_other_tools_write_them_fly(fmus: dict[str, Path], tmp_path: Path) -> None:
    """Backslashes, ./ in front, empty parts: the names are FMI's all the same."""
    with zipfile.ZipFile(fmus["LF"]) as file:
        members = {name: file.read(name) for name in file.namelist() if not name.endswith("/")}
    with Twin(fmus["LF"]) as twin:
        expected = twin.run(short())
    for change in (lambda n: n.replace("/", "\\"), lambda n: f"./{n}", lambda n: n.replace("/", "//"), lambda n: f".\\{n}"):
        path = tmp_path / "EMA_LF.fmu"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
            for name, content in members.items():
                info = zipfile.ZipInfo("x")
                info.filename = change(name)  # else ZipInfo would mend it
                file.writestr(info, content)
        with Twin(path) as twin:
            assert twin.run(short()).equals(expected)


@pytest.mark.parametrize(
    "members, told",
    [
        ([("modelDescription.xml", b"<a/>"), ("./modelDescription.xml", b"<b/>")], "is there twice"),
        ([("a", b""), ("a/b", b"")], "cannot be unpacked into .*: member 'a/b': "),
        ([("a" * 2000, b"")], "a name of more than 1000 characters"),
        ([("a/" * 400 + "b" * 199, b"")], "cannot be unpacked"),
        ([("resources/\x1b[31m/../../x", b"")], "member 'resources/ .31m/../../x' would land outside"),
    ],
)
@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_members_that_cannot_be_meant(tmp_path: Path, members: list[tuple[str, bytes]], told: str) -> None:
    path = tmp_path / "m.fmu"
    with zipfile.ZipFile(path, "w") as file:
        for name, content in members:
            info = zipfile.ZipInfo("x")
            info.filename = name
            file.writestr(info, content)
    into = tmp_path / "into"
    into.mkdir()
    deep = "a/" * 400 in members[0][0]
    if deep and len(os.fsencode(into)) + 1000 < os.pathconf(into, "PC_PATH_MAX"):
        fmufile.unpack(path, into)  # within the bounds of this system
        return
    with pytest.raises(HarnessError, match=told) as caught:
        fmufile.unpack(path, into)
    assert "\n" not in str(caught.value) and "\x1b" not in str(caught.value)


def test_a_packing_that_fmi_does_not_know_is_refused(tmp_path: Path) -> None:
    for method in (zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA):
        with pytest.raises(HarnessError, match=f"is packed by method {method}; FMI packs by deflate"):
            fmufile.describe(packed(tmp_path / "m.fmu", MEMBERS, method))


def test_a_description_without_bound_is_refused_within_bounds(tmp_path: Path) -> None:
    """350 kB that unpack to 350 MB; and the same with a length that lies."""
    path = tmp_path / "m.fmu"
    blank = b" " * 2**20
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file, file.open("modelDescription.xml", "w") as member:
        for _ in range(350):
            member.write(blank)
    assert path.stat().st_size < 400_000
    with within(seconds=2.0, mib=16), pytest.raises(HarnessError, match=r"modelDescription.xml has 367001600 bytes"):
        fmufile.describe(path)
    lying = bytearray(path.read_bytes())
    at = lying.rindex(b"PK\x01\x02") + 24
    lying[at : at + 4] = struct.pack("<I", 1000)
    path.write_bytes(lying)
    with within(seconds=2.0, mib=16), pytest.raises(HarnessError):
        fmufile.describe(path)


def test_very_many_members_are_refused_within_bounds(tmp_path: Path) -> None:
    path = tmp_path / "m.fmu"
    with zipfile.ZipFile(path, "w") as file:
        for number in range(archive.MOST_MEMBERS + 1):
            file.writestr(str(number), b"")
    with within(seconds=10.0, mib=64), pytest.raises(HarnessError, match="has 20001 members, 20000 are the most"):
        fmufile.describe(path)
    listed = path.read_bytes()[:-22][path.read_bytes().index(b"PK\x01\x02") :]
    many = listed * 5  # five times the list, at an offset of 0
    path.write_bytes(many + struct.pack("<4s4H2LH", b"PK\x05\x06", 0, 0, 65535, 65535, len(many), 0, 0))
    with within(seconds=2.0, mib=16), pytest.raises(HarnessError, match="list of members has more than 4 MiB"):
        fmufile.describe(path)


@pytest.mark.parametrize(
    "text, told",
    [
        ('<!DOCTYPE m [<!ENTITY a "b">]>', "declares a document type"),
        ('<!DOCTYPE m SYSTEM "file:///etc/hostname">', "declares a document type"),
        ("", "no element found"),
        ("<a>" * 5000, "cannot be read"),
        ("\0", "cannot be read"),
    ],
)
def test_descriptions_that_are_none(tmp_path: Path, text: str, told: str) -> None:
    """Entities would grow without limit or read other files; depth and nothing at all."""
    head, _, rest = DESCRIPTION.format("").partition("\n")
    content = f"{head}\n{text}{rest if 'DOCTYPE' in text else ''}"
    path = packed(tmp_path / "m.fmu", MEMBERS | {"modelDescription.xml": content.encode()})
    with pytest.raises(HarnessError, match=told) as caught:
        fmufile.describe(path)
    assert "\n" not in str(caught.value)


def test_a_library_that_cannot_be_loaded_leaves_the_working_directory(
    fmus: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with zipfile.ZipFile(fmus["LF"]) as file:
        members = {name: file.read(name) for name in file.namelist() if not name.endswith("/")}
    name = next(name for name in members if name.endswith("linux64/EMA_LF.so"))
    with pytest.raises(HarnessError, match=r"its library cannot be loaded"):
        Twin(packed(tmp_path / "EMA_LF.fmu", members | {name: b"no library"}))
    assert Path.cwd() == tmp_path


def test_a_disk_that_is_full_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(source: object, target: object) -> None:
        raise OSError(28, os.strerror(28))

    path = packed(tmp_path / "m.fmu", MEMBERS)
    monkeypatch.setattr("harness.flight.archive.shutil.copyfileobj", full)
    with pytest.raises(HarnessError, match=r"cannot be unpacked into .*: No space left on device"):
        fmufile.unpack(path, tmp_path / "into")


def test_a_file_that_may_not_be_read_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "m.fmu"
    packed(path, MEMBERS)
    if os.getuid() != 0:
        path.chmod(0)
        with pytest.raises(HarnessError, match="cannot be read: Permission denied"):
            fmufile.describe(path)
    path.unlink()
    for use in (fmufile.describe, provenance.file_hash):
        with pytest.raises(HarnessError, match=r"m.fmu: (no such file|cannot be read: No such file)"):
            use(path)
