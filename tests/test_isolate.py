"""An FMU in a process of its own: whatever it does, it takes nothing with it, and nothing of it stays."""

import os
import shutil
import signal
import subprocess
import sys
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from bad import library, replace_library, shielded

from harness import scratch
from harness.errors import HarnessError
from harness.flight.couple import Connection, System
from harness.flight.couple import fly as fly_system
from harness.flight.isolate import Isolated, couple
from harness.flight.shield.wire import PREFIX, Forged, Reader, encode
from harness.flight.twin import Twin
from harness.trials import Trial, trial


@pytest.fixture(scope="module")
def bad(fmus: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """EMA_LF.fmu with the library that misbehaves."""
    folder = tmp_path_factory.mktemp("bad")
    fmu = folder / "EMA_LF.fmu"
    shutil.copy(fmus["LF"], fmu)
    replace_library(fmu, library(folder))
    return fmu


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An own folder for temporary files."""
    folder = tmp_path / "tmp"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    return folder


def test_it_is_the_run_of_the_twin_bit_by_bit_and_leaves_nothing(fmus: dict[str, Path], temporary: Path) -> None:
    with Twin(fmus["LF"]) as twin:
        expected = twin.run(trial("SIN"), {"fault.friction": 2.0})
    done: list[int] = []
    with Isolated(fmus["LF"]) as isolated:
        run = isolated.run(trial("SIN"), {"fault.friction": 2.0}, on_progress=done.append)
        assert run.identical(expected.assign_attrs(wall_s=run.attrs["wall_s"]))
        assert [run[name].dtype for name in run] == [expected[name].dtype for name in expected]
        assert 0.0 < run.attrs["wall_s"] and sum(done) <= len(run.time) - 1
        with pytest.raises(HarnessError, match=r"fault.N_a = 7 .*maximum 1"):
            isolated.run(trial("SIN"), {"fault.N_a": 7.0})
        assert len(shielded()) == 1 and list(temporary.iterdir())
        assert isolated.run(trial("SIN"), {"fault.friction": 2.0}).equals(run)
    assert not shielded() and not list(temporary.iterdir())


def test_what_it_starts_prints_and_takes_is_bounded(bad: Path, temporary: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A grandchild that has left the group and holds every pipe; 60 MB printed; memory until there is none."""
    monkeypatch.setenv("BAD", "FORK,PRINT,ALLOCATE")
    with Isolated(bad, memory_limit=2**29) as isolated:
        began = time.monotonic()
        run = isolated.run(trial("SIN"))
        assert time.monotonic() - began < 60.0 and run.sizes["time"] == 25001
        assert len(isolated._process._words) <= 4096
        assert len(shielded()) == 2
    assert not shielded() and not list(temporary.iterdir())


def test_a_process_that_it_ends_is_told(bad: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BAD", "PRINT,EXIT")
    with Isolated(bad) as isolated, pytest.raises(HarnessError) as caught:
        isolated.run(trial("SIN"))
    assert str(caught.value).startswith("EMA_LF.fmu, trial SIN: ended its process with exit code 0")
    assert not shielded()


def test_nothing_that_it_sends_is_executed(bad: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A pickled call of a command, written into every open file."""
    monkeypatch.setenv("BAD", "FORGE")
    monkeypatch.setenv("BAD_TOUCHES", str(tmp_path / "touched"))
    with Isolated(bad) as isolated, pytest.raises(HarnessError, match="was ended: it sent what is no message: mark b'cos"):
        isolated.run(trial("SIN"))
    assert not (tmp_path / "touched").exists() and not shielded()


def test_one_that_does_not_return_can_be_stopped(bad: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BAD", "HANG")
    began = time.monotonic()
    with Isolated(bad) as isolated, pytest.raises(HarnessError, match="was ended: it did not stop within 5 s"):
        isolated.run(trial("SIN"), on_progress=lambda points: time.monotonic() > began + 1.0)
    assert not shielded()


PARENT = """
import sys
from pathlib import Path
from harness.flight.isolate import Isolated
from harness.trials import trial
isolated = Isolated(Path(sys.argv[1]))
def told(points):
    print(isolated._process._process.pid, flush=True)
isolated.run(trial("SIN"), on_progress=told)
"""


def test_it_ends_with_its_parent_and_the_next_start_cleans_up(
    bad: Path, temporary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A parent that is killed while the FMU does not return."""
    monkeypatch.setenv("BAD", "HANG")
    environment = os.environ | {"TMPDIR": str(temporary)}
    with subprocess.Popen([sys.executable, "-c", PARENT, str(bad)], stdout=subprocess.PIPE, env=environment) as parent:
        assert parent.stdout
        number = int(parent.stdout.readline())
        time.sleep(0.2)
        parent.kill()
    deadline = time.monotonic() + 10.0
    while Path(f"/proc/{number}").exists() and "Z" not in _state(number) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert _state(number) in ("Z", "")
    (left,) = temporary.iterdir()
    assert left.name.startswith(f"ema_shield_{parent.pid}_")
    assert scratch.sweep(temporary) == [left] and not list(temporary.iterdir())


def _state(number: int) -> str:
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return ""


def test_an_interrupt_ends_it_at_once(fmus: dict[str, Path]) -> None:
    with Isolated(fmus["LF"]) as isolated:
        began = time.monotonic()

        def interrupt(points: int) -> None:
            if points or time.monotonic() > began + 0.2:
                signal.raise_signal(signal.SIGINT)

        with pytest.raises(KeyboardInterrupt):
            isolated.run(trial("SIN"), on_progress=interrupt)
        assert not shielded()


STUCK = """
import sys
from pathlib import Path
from harness.flight.interrupt import deferred, insisted
from harness.flight.twin import Twin
from harness.trials import trial
with insisted(), deferred(), Twin(Path(sys.argv[1])) as twin:
    twin.run(trial("SIN"))
"""


def test_the_third_interrupt_ends_one_that_does_not_return(
    bad: Path, temporary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In this process, without isolation: an FMU never gives Python back a say."""
    monkeypatch.setenv("BAD", "HANG")
    environment = os.environ | {"TMPDIR": str(temporary)}
    command = [sys.executable, "-c", STUCK, str(bad)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, env=environment, text=True) as process:
        assert process.stderr and process.stderr.readline() == "hangs\n"
        for _ in range(2):
            process.send_signal(signal.SIGINT)
            time.sleep(0.3)  # signals that wait become one
        assert process.poll() is None and len(list(temporary.iterdir())) == 1
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=30) == 130
        assert "Ctrl-C once more ends the process at once" in process.stderr.read()
    assert not list(temporary.iterdir())


def test_a_system_flies_in_one_process(fmus: dict[str, Path]) -> None:
    system = System(
        {"one": fmus["LF"], "two": fmus["LF"]}, [Connection("one.position", "two.command")], {"two.fault.friction": 2.0}
    )
    options = {
        "stop": 0.02,
        "step": 1e-3,
        "inputs": {"one.command": np.full(20, 0.1)},
        "record": ["two.position", "two.command"],
    }
    assert couple(system, **options).equals(fly_system(system, **options))
    assert not shielded()


FAKE = """
import json, os, socket, sys, time
sys.path[:] = json.loads(sys.argv[1])
import numpy as np
from harness.flight.shield.wire import Reader, encode
connection = socket.socket(fileno=int(sys.argv[2]))
connection.sendall(encode({"kind": "ready"}))
reader = Reader(2**30)
while (job := reader.next()) is None:
    reader.feed(connection.recv(2**20))
run = {"kind": "answer", "number": job[0]["number"], "rows": 20, "wall": 0.1, "stopped": False}
table = np.zeros((20, len(job[0]["outputs"])))
"""


def faked(monkeypatch: pytest.MonkeyPatch, program: str) -> Isolated:
    """One whose process does `program`, once it has a job of 20 points."""
    monkeypatch.setattr("harness.flight.shield.process.PROGRAM", FAKE + program + "\ntime.sleep(60)\n")
    return Isolated(Path(__file__), time_limit=10.0)


def twenty() -> Trial:
    whole = trial("SIN")
    return Trial("SIN", 0.0, whole.step, {name: series[:20] for name, series in whole.inputs.items()}, "test")


@pytest.mark.parametrize(
    "program, told",
    [
        ("connection.sendall(encode({**run, 'number': 7}, table))", "sent what is no answer"),
        ("connection.sendall(encode({**run, 'rows': 19}, table))", "sent what is no run"),
        ("connection.sendall(encode({**run, 'rows': 19}, table[:19]))", "sent what is no run"),
        ("connection.sendall(encode({**run, 'rows': True}, table))", "sent what is no run"),
        ("connection.sendall(encode({**run, 'wall': 'x'}, table))", "sent what is no run"),
        ("connection.sendall(encode({**run, 'stopped': 0}, table))", "sent what is no run"),
        ("connection.sendall(encode(run, np.zeros((21, table.shape[1]))))", "sent what is no message"),
        ("connection.sendall(encode({'kind': 'notice', 'points': -1}))", "sent what is no answer"),
        ("connection.sendall(encode({'kind': 'notice', 'points': 1e9}))", "sent what is no answer"),
        ("connection.sendall(encode(run)[:9]); connection.close(); os._exit(3)", "ended its process with exit code 3"),
        (
            "connection.sendall(encode({'kind': 'refused', 'line': 'a\\nb\\x1b[2J'})); connection.recv(1); os._exit(0)",
            r"^a b \[2J$",
        ),
        (
            "connection.sendall(encode({'kind': 'refused', 'line': 'x' * 90000})); connection.recv(1); os._exit(0)",
            r"^x{1997}\.\.\.$",
        ),
        (
            "print('one', flush=True); print('two \\x1b[2J', flush=True); os.abort()",
            r"crashed \(SIGABRT\); its last words: two \[2J",
        ),
        ("os.kill(os.getpid(), 40)", r"crashed \(signal 40\)"),
    ],
)
def test_an_answer_that_is_none_ends_the_process(monkeypatch: pytest.MonkeyPatch, program: str, told: str) -> None:
    began = time.monotonic()
    with faked(monkeypatch, program) as isolated, pytest.raises(HarnessError, match=told) as caught:
        isolated.run(twenty())
    assert "\n" not in str(caught.value) and not shielded() and time.monotonic() - began < 60.0


def test_after_an_end_the_next_run_has_a_new_process(monkeypatch: pytest.MonkeyPatch) -> None:
    with faked(monkeypatch, "connection.sendall(encode(run, table)); connection.recv(1); os._exit(3)") as isolated:
        for _ in range(2):
            run = isolated.run(twenty())
            assert run.sizes["time"] == 20 and not run.position.any()
            with pytest.raises(HarnessError, match="ended its process with exit code 3"):
                isolated.run(twenty())
    assert not shielded()


@pytest.mark.parametrize(
    "program",
    [
        "while True: connection.sendall(encode({'kind': 'notice', 'points': 0}))",
        "while True: os.write(1, bytes(2**16))",
        "connection.close()",
    ],
)
def test_a_flood_is_bounded_in_time_and_memory(monkeypatch: pytest.MonkeyPatch, program: str) -> None:
    """Messages, output, or nothing at all, without end."""
    with faked(monkeypatch, program) as isolated:
        isolated._process.time_limit = 1.0
        tracemalloc.start()
        with pytest.raises(HarnessError, match=r"has not finished within 1 s"):
            isolated.run(twenty())
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert peak < 32 * 2**20 and not shielded()


def good() -> bytes:
    return encode({"kind": "answer", "rows": 2}, np.array([[1.0, np.nan], [-0.0, 1e308]]))


def test_a_message_comes_as_it_was_sent_in_whatever_pieces() -> None:
    reader = Reader(32)
    for byte in good() + good()[:20]:
        reader.feed(bytes([byte]))
    head, body = reader.next() or ({}, np.empty(0))
    assert head == {"kind": "answer", "rows": 2} and reader.next() is None
    np.testing.assert_array_equal(body, [1.0, np.nan, -0.0, 1e308])
    assert np.signbit(body[2])


@pytest.mark.parametrize(
    "sent",
    [
        b"cos\nsystem\n(S'true'\ntR." * 2,
        PREFIX.pack(b"EMA1", 2**31, 0),
        PREFIX.pack(b"EMA1", 2, 40) + b"{}",
        PREFIX.pack(b"EMA1", 2, 2**63) + b"{}",
        PREFIX.pack(b"EMA1", 2, 7) + b"{}" + bytes(7),
        PREFIX.pack(b"EMA1", 2, 0) + b"\xff\xff",
        PREFIX.pack(b"EMA1", 2, 0) + b"[]",
        PREFIX.pack(b"EMA1", 100_000, 0) + b"[" * 100_000,
        PREFIX.pack(b"EMA1", 100_000, 0) + b"9" * 100_000,
    ],
)
def test_what_is_no_message_is_refused(sent: bytes) -> None:
    """Longer than asked for, no whole numbers, no JSON, no object, as deep as no parser goes."""
    reader = Reader(32)
    reader.feed(sent)
    with pytest.raises(Forged, match="no message"):
        reader.next()


def test_a_message_with_a_bit_flipped_is_refused_or_another() -> None:
    """Every bit of the prefix and the head: nothing but Forged, or a message within the bounds."""
    whole = good()
    for place in range(8 * (len(whole) - 32)):
        flipped = bytearray(whole)
        flipped[place // 8] ^= 1 << place % 8
        reader = Reader(32)
        reader.feed(bytes(flipped))
        try:
            found = reader.next()
        except Forged:
            continue
        assert found is None or (isinstance(found[0], dict) and found[1].size <= 4)
