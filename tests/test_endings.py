"""How commands end where disks, streams, names and the environment are not as they should be: a clear line, exit code 2.

Truths: POSIX's errors (ENOSPC of /dev/full, EPIPE), shells' 128 + 13 of a process that SIGPIPE ended, and what a file or
table has to hold.
"""

import errno
import logging
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numba
import pytest
from numba.core.caching import FunctionCache

from harness import compiled
from harness.cli import ending, main, streams, terminal
from harness.errors import HarnessError
from harness.files import results
from harness.files.toml import read_toml
from harness.ready import _reason

PORTS = [sys.executable, "-c", "import sys; from harness.cli import main; sys.argv = ['ema', 'ports', '--markdown']; main()"]


def test_a_full_standard_output_is_one_line_and_2() -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run(PORTS, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr) == (2, "ema: standard output: cannot be written: No space left on device\n")


def test_a_reader_that_has_gone_ends_it_without_a_word_as_sigpipe_would() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(PORTS, stdout=writer, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert (done.returncode, done.stderr) == (141, "")


def test_closed_standard_streams_are_no_reason_to_fail() -> None:
    done = subprocess.run(["sh", "-c", '"$@" >&- 2>&- <&-', "sh", *PORTS], check=False)
    assert done.returncode == 0


@pytest.mark.parametrize(
    ("raised", "told"),
    [
        (OSError(errno.ENOSPC, "No space left on device", "a.csv"), "ema: a.csv: No space left on device\n"),
        (FileNotFoundError(errno.ENOENT, "No usable temporary directory"), "ema: No usable temporary directory\n"),
        (MemoryError(), "ema: not enough memory"),
        (UnicodeEncodeError("utf-8", "a\udcff", 1, 2, "surrogates not allowed"), r"ema: 'a\udcff': utf-8 cannot hold"),
        (KeyError("x"), "ema: this is a fault of the program, please report it: KeyError: 'x'"),
        (HarnessError("a: b"), "ema: a: b\n"),
    ],
)
def test_whatever_is_raised_ends_in_one_line(raised: Exception, told: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end, ending.clear():
        raise raised
    error = capsys.readouterr().err
    assert end.value.code == 2
    assert error.startswith(told) and error.count("\n") == 1


@pytest.mark.parametrize(("stated", "left"), [("0", None), ("-3", None), ("wide", None), ("1", None), ("120", "120")])
def test_a_width_that_no_table_has_is_not_taken(stated: str, left: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", stated)
    streams.prepare()
    assert os.environ.get("COLUMNS") == left


def test_brackets_in_captions_heads_and_cells_are_letters(capsys: pytest.CaptureFixture[str]) -> None:
    terminal.show("[b]own.csv", ("[u]Word", "Unit"), [("[red]position", "[rad]")])
    told = capsys.readouterr().out
    assert all(text in told for text in ("[b]own.csv", "[u]Word", "[red]position", "[rad]"))


def test_a_name_that_is_no_text_leaves_pages_and_tables_that_are(tmp_path: Path) -> None:
    name = os.fsdecode(b"a\xff")
    results.write(tmp_path / f"{name}.html", f"<p>{name}</p>")
    assert (tmp_path / f"{name}.html").read_text(encoding="utf-8") == "<p>a\ufffd</p>"


@pytest.mark.parametrize(
    "text",
    ["a=" + "[" * 20000 + "]" * 20000, "[" + ".".join(["a"] * 5000) + "]\nx=1\n", "a=" + "{b=" * 900 + "1" + "}" * 900],
)
def test_deep_toml_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "deep.toml").write_text(text)
    with pytest.raises(HarnessError, match=r"deep.toml.*: more than 32 tables or lists in each other"):
        read_toml(tmp_path / "deep.toml")


def _doubled(x: float) -> float:
    return 2.0 * x


def _refuse(*_: Any) -> None:
    raise RuntimeError("cannot cache function: no locator available")


def _full(*_: Any) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


def _torn(*_: Any) -> None:
    raise EOFError("Ran out of input")


@pytest.mark.parametrize(("method", "failing"), [("__init__", _refuse), ("save_overload", _full), ("load_overload", _torn)])
def test_loops_are_compiled_where_nothing_can_be_kept(method: str, failing: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(FunctionCache, method, failing)
    function = compiled.compiled()(_doubled)
    assert function(2.0) == 4.0 and function.signatures


def test_loops_that_call_fmus_are_compiled_though_numba_is_told_not_to(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "DISABLE_JIT", 1)
    assert compiled.compiled()(_doubled).signatures == []  # a dispatcher, not the plain function
    assert numba.config.DISABLE_JIT == 1


def test_folders_that_a_failure_leaves_empty_are_taken_away(tmp_path: Path) -> None:
    (tmp_path / "before").mkdir()

    def fail() -> None:
        with results.tidy():
            results.prepare(tmp_path / "before")
            results.prepare_file(tmp_path / "new" / "below" / "a.csv")
            results.prepare(tmp_path / "filled" / "below")
            results.write(tmp_path / "filled" / "a.csv", "a\n")
            raise HarnessError("no")

    with pytest.raises(HarnessError):
        fail()
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["a.csv", "before", "filled"]


def test_a_long_report_of_a_compiler_is_told_by_the_line_that_says_why() -> None:
    assert _reason("zig cc ... failed: a.c:1:2: error: no x\n int y\n^") == "zig cc ... failed: a.c:1:2: error: no x"
    assert _reason("emit LF failed:\n  File a\nOSError: disk full") == "emit LF failed: OSError: disk full"


def test_a_command_that_is_mistyped_is_guessed(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["ema", "rnu"])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    assert "Did you mean 'run'" in capsys.readouterr().err


def test_verbose_tells_what_is_written_and_where_it_failed(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logging.getLogger("harness"), "level", logging.NOTSET)
    monkeypatch.setattr(sys, "argv", ["ema", "-v", "actuator", "new", str(tmp_path / "own.toml")])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 0
    with pytest.raises(SystemExit), ending.clear():
        raise KeyError("x")
    assert [record.getMessage() for record in caplog.records] == [f"wrote {tmp_path / 'own.toml'}", "where it failed"]
    assert caplog.records[1].exc_info
