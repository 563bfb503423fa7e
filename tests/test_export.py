"""What a user gets without a compiler: the wheel carries the FMUs, `ema export` hands them out."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from ema_fmu_src import __version__
from ema_fmu_src.fmu import source
from harness.cli import main

ROOT = Path(__file__).resolve().parent.parent
WITHOUT_ZIG = (
    "import importlib.util as util, sys\n"
    "found = util.find_spec\n"
    "util.find_spec = lambda name, *rest: None if name == 'ziglang' else found(name, *rest)\n"
    "from harness.cli import main\n"
    "main()\n"
)
"""The command line where the extra [build] is not installed."""


@pytest.fixture(scope="module")
def installed(fmus: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder into which a wheel with the FMUs has been installed."""
    folder = tmp_path_factory.mktemp("wheel")
    copy = folder / "source"
    kept = shutil.ignore_patterns("__pycache__", "*.fmu", "*.ssp")
    for name in ("ema_fmu_src", "harness", "fmus"):
        shutil.copytree(ROOT / name, copy / name, ignore=kept)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, copy)
    for path in fmus.values():
        shutil.copy(path, copy / "fmus")
    subprocess.run([sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)], check=True, cwd=copy)
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def _ema(installed: Path, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(installed)}
    command = [sys.executable, "-c", WITHOUT_ZIG, *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def test_the_wheel_runs_at_once(installed: Path, tmp_path: Path) -> None:
    done = _ema(installed, tmp_path, "run", "STEP-RAMP", "--fidelity", "LF", "--reference", "ELF", "--out", "results")
    assert done.returncode == 0, done.stderr
    assert "built" not in done.stdout
    assert (tmp_path / "results" / "report.html").is_file()


def test_the_wheel_carries_what_a_build_needs_and_its_license(installed: Path) -> None:
    """The C files of the native runtime too: a build from the wheel is a build from the sources."""
    assert source.content_hash(installed / "ema_fmu_src") == source.content_hash()
    assert {path.suffix for path in source.files(installed / "ema_fmu_src")} == {".py", ".c", ".h"}
    for package in ("ema_fmu_src", "harness"):
        assert (installed / package / "py.typed").is_file()
    (about,) = installed.glob("ema_twins-*.dist-info")
    assert about.name == f"ema_twins-{__version__}.dist-info"
    assert (about / "licenses" / "LICENSE").read_text() == (ROOT / "LICENSE").read_text()
    assert "License-Expression: MIT\n" in (about / "METADATA").read_text()


def test_the_wheel_carries_the_library_of_actuators(installed: Path, tmp_path: Path) -> None:
    done = _ema(installed, tmp_path, "actuator", "list")
    assert done.returncode == 0, done.stderr
    assert "maxon-linear-a" in done.stdout and "siemens-1ft6084" in done.stdout


def test_the_wheel_exports_what_it_carries(installed: Path, fmus: dict[str, Path], tmp_path: Path) -> None:
    done = _ema(installed, tmp_path, "export", "there")
    assert done.returncode == 0, done.stderr
    for path in fmus.values():
        assert (tmp_path / "there" / path.name).read_bytes() == path.read_bytes()


def test_without_the_fmus_and_without_zig_a_line_says_what_to_install(installed: Path, tmp_path: Path) -> None:
    done = _ema(installed, tmp_path, "build", "--out", str(tmp_path))
    assert done.returncode == 2
    assert done.stderr.strip() == "ema: building FMUs needs ziglang: pip install -e '.[build]' in the checkout"


def test_export_keeps_what_differs(
    fmus: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("harness.fidelity.FMU_DIR", fmus["HF"].parent)
    mine = tmp_path / "EMA_LF.fmu"
    mine.write_bytes(b"mine")
    for extra, code, kept in (([], 2, True), (["--force"], 0, False)):
        monkeypatch.setattr(sys, "argv", ["ema", "export", str(tmp_path), *extra])
        with pytest.raises(SystemExit) as ended:
            main()
        assert (ended.value.code or 0) == code
        assert (mine.read_bytes() == b"mine") == kept
    assert "EMA_LF.fmu: is there and differs; --force replaces it" in capsys.readouterr().err
