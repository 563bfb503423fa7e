"""Temporary folders: gone at the end, and after a kill at the next start; nobody else's are touched."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from harness import scratch
from harness.errors import HarnessError

OWNER = """
import sys, time
from harness import scratch
print(scratch.make("test"), flush=True)
if sys.argv[1] == "wait":
    time.sleep(60)
"""


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    return tmp_path


def test_it_goes_with_its_block_and_twice_does_no_harm(place: Path) -> None:
    with scratch.folder("test") as made:
        (made / "file").write_text("x")
        assert made.parent == place and f"_{os.getpid()}_" in made.name
        scratch.remove(made)
        assert not made.exists()
    made = scratch.make("test")
    scratch.remove(made)
    assert not list(place.iterdir())


def test_it_goes_at_the_end_of_its_process(place: Path) -> None:
    done = subprocess.run([sys.executable, "-c", OWNER, "end"], capture_output=True, text=True, check=True)
    assert Path(done.stdout.strip()).parent == place and not list(place.iterdir())


def test_only_what_a_dead_owner_left_is_removed(place: Path) -> None:
    owner = subprocess.Popen([sys.executable, "-c", OWNER, "wait"], stdout=subprocess.PIPE, text=True)
    assert owner.stdout
    theirs = Path(owner.stdout.readline().strip())
    mine = scratch.make("test")
    dead = f"ema_test_{2**22 + 1}_"  # no process has it: Linux gives none above 2**22
    others = [place / "ema_fmu_of_mine", place / f"{dead}file", place / f"{dead}link"]
    others[0].mkdir()
    others[1].write_text("a file")
    others[2].symlink_to(mine)
    left = place / f"{dead}left"
    (left / "deep").mkdir(parents=True)
    assert scratch.sweep(place) == [left]
    assert theirs.exists() and mine.exists() and all(each.is_symlink() or each.exists() for each in others)
    owner.kill()
    owner.wait()
    owner.stdout.close()
    assert scratch.sweep(place) == [theirs]
    scratch.remove(mine)


def test_a_lock_keeps_what_looks_dead(place: Path) -> None:
    """The owner's process id is counted in another container; the lock is held all the same."""
    left = place / f"ema_test_{2**22 + 1}_left"
    left.mkdir()
    descriptor = scratch._lock(left)
    assert not scratch.sweep(place) and left.exists()
    os.close(descriptor)
    assert scratch.sweep(place) == [left]


def test_the_first_start_sweeps(place: Path) -> None:
    (place / f"ema_fmu_{2**22 + 1}_left").mkdir()
    subprocess.run([sys.executable, "-c", OWNER, "end"], check=True, capture_output=True)
    assert not list(place.iterdir())


def test_no_place_for_it_is_one_line(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(place / "none"))
    with pytest.raises(HarnessError, match=r"no temporary folder can be made: .*TMPDIR"):
        scratch.make("test")
