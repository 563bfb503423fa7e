"""What a command reads stays: an output that is one of the inputs is refused, before anything is flown.

Truth: the bytes of the input before and after.
"""

import sys
from pathlib import Path

import pytest

from harness.cli import main

TABLE = "time,command,position\n" + "".join(f"{0.01 * row:g},{0.001 * row:g},{0.001 * row:g}\n" for row in range(100))
COMMANDS = (
    ("identify", "own.csv", "--json", "own.csv"),
    ("replay", "own.csv", "--json", "./own.csv"),
    ("replay", "own.csv", "--with", "other.csv", "--json", "other.csv"),
    ("replay", "own.csv", "--json", "link.csv"),
    ("columns", "own.csv", "--json", "own.csv"),
    ("run", "--trial-file", "own.csv", "--json", "own.csv"),
    ("run", "--actuator", "mine.toml", "--json", "mine.toml"),
    ("run", "SIN", "--trial-file", "SIN_LF.csv", "--column", "command=command [rad]", "--fidelity", "LF", "--out", "."),
    ("actuator", "show", "mine.toml", "--json", "mine.toml"),
    ("compare", "fmus/EMA_LF.fmu", "--reference", "fmus/EMA_HF.fmu", "--json", "fmus/EMA_LF.fmu"),
    ("check", "--budgets", "mine.toml", "--page", "mine.toml"),
    ("check", "--fmus", "fmus", "--junit", "fmus/EMA_LF.fmu"),
    ("bench", "SIN", "--fmus", "fmus", "--json", "fmus/EMA_HF.fmu"),
    ("monitor", "runs", "--out", "runs"),
    ("monitor", "runs", "--json", "runs/own.csv"),
    ("monitor", "list.csv", "--json", "runs/own.csv"),
    ("campaign", "plan.toml", "--fmus", "fmus", "--out", "fmus"),
)


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_no_command_writes_over_what_it_reads(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for folder in ("fmus", "runs"):
        Path(folder).mkdir()
    for name in ("own.csv", "other.csv", "SIN_LF.csv", "runs/own.csv"):
        Path(name).write_text(
            TABLE if name != "other.csv" else TABLE.replace("command,position", "motor_speed,motor_position")
        )
    Path("link.csv").symlink_to("own.csv")
    Path("list.csv").write_text("date,file\n2026-01-01,runs/own.csv\n")
    Path("mine.toml").write_text("[SIN.LF]\nposition = 1\n" if "--budgets" in words else "[parameters]\nmotor.R = 1\n")
    Path("plan.toml").write_text("seed = 1\n")
    for model in ("HF", "ELF", "LF"):
        Path(f"fmus/EMA_{model}.fmu").write_text("")
    before = {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}
    monkeypatch.setattr(sys, "argv", ["ema", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    told = capsys.readouterr()
    assert (ended.value.code, told.out, told.err.count("\n")) == (2, "", 1)
    assert "is read by this command, which would write over it" in told.err
    assert {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()} == before


def test_a_file_that_is_read_no_more_may_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The next command in the same process begins anew, and results may go beside what is read."""
    (tmp_path / "own.csv").write_text(TABLE)
    for read, written in (("own.csv", "shown.json"), ("own.csv", "shown.json")):
        monkeypatch.setattr(sys, "argv", ["ema", "columns", str(tmp_path / read), "--json", str(tmp_path / written)])
        with pytest.raises(SystemExit) as ended:
            main()
        assert ended.value.code == 0
    assert (tmp_path / "own.csv").read_text() == TABLE
