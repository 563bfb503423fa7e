"""How the FMUs are packed."""

from pathlib import Path

import pytest

from ema_fmu_src.fmu.build import SSP, build


def test_same_bytes_again(fmus: dict[str, Path], tmp_path: Path) -> None:
    """Of LF; the others are built in the same way, and each takes a minute."""
    (path,) = build(["LF"], out=tmp_path)
    assert path.read_bytes() == fmus["LF"].read_bytes()
    assert {path.name for path in fmus["LF"].parent.iterdir()} >= {"EMA_ELF.fmu", "EMA_HF.fmu", "EMA_LF.fmu", SSP}


def test_unknown_model(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"XF.*HF, ELF, LF"):
        build(["XF"], out=tmp_path)
    assert not list(tmp_path.iterdir())


def test_failed_build_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ema_fmu_src.fmu.build.validate_fmu", lambda _: ["made up"])
    (tmp_path / "EMA_LF.fmu").write_bytes(b"old")
    with pytest.raises(RuntimeError, match="made up"):
        build(["LF"], out=tmp_path)
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [("EMA_LF.fmu", b"old")]
