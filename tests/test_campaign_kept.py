"""Campaigns lose nothing and give nothing wrong: killed, on a full disk, damaged, locked, with workers that die.

The truth is a campaign that nothing has disturbed: in the end every file of the folder has its bytes.
"""

import errno
import multiprocessing
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import xarray as xr
from bad import library, replace_library
from test_campaign import assert_same

from ema_fmu_src import ports
from harness.campaigns import checksums, local, plan
from harness.campaigns.local import Local
from harness.campaigns.lock import LOCK, locked
from harness.campaigns.parts import Parts
from harness.campaigns.planfile import read_plan
from harness.campaigns.run import Summary, cluster, run
from harness.campaigns.verify import verify
from harness.errors import HarnessError

OPTIONS = {"ranges": {"fault.friction": [1.0, 3.0]}, "samples": 11, "seed": 3, "fidelities": ["LF", "ELF+"]}
CHUNK = 4
"""Cases in a chunk, so that 22 cases are six chunks, the last one short and one with both fidelities."""
KILLS = int(os.environ.get("EMA_KILLS", "4"))
"""How often a campaign is killed."""


@pytest.fixture(scope="module", autouse=True)
def small_chunks() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plan, "MOST_TOGETHER", CHUNK)
        patch.setattr(local, "LOADED", [*local.LOADED, "harness.campaigns.run", "harness.campaigns.planfile", "scipy.stats"])
        yield


@pytest.fixture(scope="module")
def folder(fmus: dict[str, Path]) -> Path:
    return fmus["ELF"].parent


def fly(folder: Path, out: Path, **more) -> Summary:
    with cluster(None, 2) as crew:
        return run(read_plan(None, OPTIONS), crew, fmus=folder, out=out, **more)


@pytest.fixture(scope="module")
def undisturbed(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("undisturbed")
    flown = fly(folder, out)
    assert (flown.cases, flown.before, flown.failures, flown.damaged) == (22, 0, [], [])
    return out


@pytest.fixture
def copy(undisturbed: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(undisturbed, tmp_path / "copy"))


def files_of(out: Path) -> list[Path]:
    return sorted(path for path in out.rglob("*") if path.is_file())


def flip(path: Path, random_place: random.Random) -> None:
    """Flip one bit."""
    content = bytearray(path.read_bytes())
    content[random_place.randrange(len(content))] ^= 1 << random_place.randrange(8)
    path.write_bytes(content)


def _fly_in_a_process(folder: Path, out: Path) -> None:
    plan.MOST_TOGETHER = CHUNK
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    fly(folder, out)


def begun(folder: Path, out: Path) -> multiprocessing.Process:
    local.preload()
    process = multiprocessing.get_context("forkserver").Process(target=_fly_in_a_process, args=(folder, out))
    process.start()
    return process


def test_killed_at_random_moments_it_ends_with_the_same_bytes(undisturbed, folder, tmp_path):
    moments, out, started = random.Random(18), tmp_path / "0", time.monotonic()
    out.mkdir()
    process = begun(folder, out)
    process.join()
    assert process.exitcode == 0
    whole = time.monotonic() - started
    assert_same(undisturbed, out)
    finished = 1
    for _ in range(KILLS):
        if (out / "features.parquet").exists():
            out, finished = tmp_path / str(finished), finished + 1
            out.mkdir()
        process = begun(folder, out)
        process.join(moments.uniform(0.2, 0.9) * whole)
        process.kill()
        process.join()
    fly(folder, out)
    assert_same(undisturbed, out)
    assert verify(out).problems == []


def _killed_in_a_write(folder: Path, out: Path, at: int, part: float) -> None:
    """Fly until the write number `at`, of which a part is done when the process is killed."""
    whole, count = checksums.write, [0]

    def write(path: Path, content: bytes) -> str:
        count[0] += 1
        if count[0] == at:
            path.with_name(f"{path.name}.part").write_bytes(content[: int(part * len(content))])
            if part == 1.0:
                path.with_name(f"{path.name}.part").replace(path)
            os.kill(os.getpid(), signal.SIGKILL)
        return whole(path, content)

    checksums.write = write
    _fly_in_a_process(folder, out)


@pytest.mark.long
def test_killed_within_a_write_it_ends_with_the_same_bytes(undisturbed, folder, tmp_path):
    """A chunk is 6 writes and its checksums a seventh; so the kills are in arrays, in checksums, and between them."""
    moments = random.Random(4)
    local.preload()
    for _ in range(KILLS):
        killed = multiprocessing.get_context("forkserver").Process(
            target=_killed_in_a_write,
            args=(folder, tmp_path, moments.randrange(1, 15), moments.choice([0.0, 0.5, 1.0])),
        )
        killed.start()
        killed.join()
        assert killed.exitcode in (-signal.SIGKILL, 0)
    fly(folder, tmp_path)
    assert_same(undisturbed, tmp_path)


@pytest.mark.parametrize("way", ["flipped", "emptied", "lost"])
def test_a_damaged_chunk_is_found_told_and_flown_again(way, undisturbed, folder, copy):
    choice = random.Random(way)
    victims = ["position/1.0", "motor_speed/5.0", "features/2.0", "failure/3", "done/0"]
    for victim in (copy / "campaign.zarr" / name for name in victims):
        if way == "flipped":
            flip(victim, choice)
        elif way == "emptied":
            victim.write_bytes(b"")
        else:
            victim.unlink()
    told = verify(copy)
    assert (told.cases, told.whole) == (22, 4)  # of the six chunks, one is whole
    assert len(told.problems) == len(victims)
    assert all(any(f"{copy / 'campaign.zarr' / name}: is " in line for line in told.problems) for name in victims)
    flown = fly(folder, copy)
    assert flown.cases == 18 and flown.before == 4 and sorted(flown.damaged) == sorted(told.problems)
    assert_same(undisturbed, copy)


@pytest.mark.parametrize("way", ["flipped", "emptied", "lost"])
def test_what_describes_the_data_is_mended_when_it_is_damaged(way, undisturbed, folder, copy):
    choice = random.Random(way)
    names = (
        "campaign.zarr/.zattrs", "campaign.zarr/position/.zarray", "campaign.zarr/fault.friction/0", "campaign.zarr/case/0",
        "checksums/cases_4_7.sha256", "checksums/dataset.sha256", "features.parquet",
    )  # fmt: skip
    for name in names:
        if way == "flipped":
            flip(copy / name, choice)
        elif way == "emptied":
            (copy / name).write_bytes(b"")
        else:
            (copy / name).unlink()
    flown = fly(folder, copy)
    assert flown.cases in (0, 4) and flown.damaged
    assert_same(undisturbed, copy)


def test_any_flipped_bit_of_any_file_is_found(undisturbed, copy):
    choice = random.Random(9)
    for path in choice.sample(files_of(copy), 25):
        content = path.read_bytes()
        flip(path, choice)
        try:
            problems = verify(copy).problems
        except HarnessError as error:
            problems = [str(error)]
        assert problems and "\n" not in "".join(problems), path
        path.write_bytes(content)
    assert verify(copy).problems == [] and verify(copy).whole == 22


def test_a_store_of_unknown_origin_is_refused(folder, copy):
    for name in (".zattrs", ".zmetadata"):
        (copy / "campaign.zarr" / name).write_bytes(b"")
    with pytest.raises(HarnessError, match=r"\.zattrs and \.zmetadata are both damaged; delete it or choose another --out"):
        fly(folder, copy)


def test_a_disk_that_is_full_keeps_what_is_done(undisturbed, folder, tmp_path, monkeypatch):
    whole, count = checksums.write, [0]

    def full(path: Path, content: bytes) -> str:
        count[0] += 1
        if count[0] > 17:
            path.with_name(f"{path.name}.part").write_bytes(content[:10])
            path.with_name(f"{path.name}.part").unlink()
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return whole(path, content)

    monkeypatch.setattr(checksums, "write", full)
    with pytest.raises(HarnessError, match="No space left on device; what is done is kept: make room, and the same command"):
        fly(folder, tmp_path)
    monkeypatch.setattr(checksums, "write", whole)
    told = verify(tmp_path)
    assert told.problems == [] and 0 < told.whole < 22
    flown = fly(folder, tmp_path)
    assert flown.before == told.whole and flown.damaged == []
    assert_same(undisturbed, tmp_path)


def test_a_small_disk_that_fills_and_is_made_larger(undisturbed, folder, tmp_path):
    disk, pages = tmp_path / "disk", sum(-(-path.stat().st_size // 4096) for path in files_of(undisturbed))
    disk.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={int(0.85 * pages) * 4}k", "tmpfs", str(disk)],
        capture_output=True,
        check=False,
    )
    if mounted.returncode:
        pytest.skip(f"no small disk can be mounted: {mounted.stderr.decode(errors='replace').strip()}")
    try:
        with pytest.raises(HarnessError, match="No space left on device"):
            fly(folder, disk)
        told = verify(disk)
        assert told.problems == [] and 0 < told.whole < 22
        subprocess.run(["mount", "-o", "remount,size=64m", str(disk)], check=True)
        fly(folder, disk)
        assert_same(undisturbed, disk)
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def test_a_second_campaign_in_the_folder_is_told_who_runs(undisturbed, folder, copy):
    who = rf"{copy}: another campaign is at work in it: process {os.getpid()} on .*, since"
    with locked(copy), pytest.raises(HarnessError, match=who):
        fly(folder, copy)
    assert not (copy / LOCK).exists()
    (copy / LOCK).write_text("of one that was killed")
    assert fly(folder, copy).before == 22
    assert_same(undisturbed, copy)


def test_a_worker_that_is_killed_costs_nothing(undisturbed, folder, tmp_path):
    killed: list[int] = []

    def kill(cases: int) -> None:
        workers = [each for each in multiprocessing.active_children() if each.daemon]
        if len(killed) < 3 and workers:
            killed.append(int(workers[len(killed) % len(workers)].pid or 0))
            os.kill(killed[-1], signal.SIGKILL)

    assert fly(folder, tmp_path, on_cases=kill).failures == [] and len(killed) == 3
    assert_same(undisturbed, tmp_path)


def test_cases_at_which_workers_die_are_recorded_and_the_others_flown(folder, tmp_path):
    """LF aborts in each run: its cases say so, those of ELF+ are flown."""
    mine = Path(shutil.copytree(folder, tmp_path / "fmus"))
    replace_library(mine / "EMA_LF.fmu", library(tmp_path, '-DALWAYS="CRASH"'))
    options = {"grid": {"fault.friction": [1.0, 2.0]}, "fidelities": ["LF", "ELF+"]}
    out = tmp_path / "out"
    out.mkdir()
    with cluster(None, 2) as crew:
        flown = run(read_plan(None, options), crew, fmus=mine, out=out)
    assert flown.failures == [(case, "the worker's process ended each time it was flown") for case in (0, 1)]
    with xr.open_zarr(out / "campaign.zarr") as held:
        assert held.position.isel(case=slice(0, 2)).isnull().all() and held.position.isel(case=slice(2, 4)).notnull().all()


def test_what_a_campaign_here_does_not_need_is_not_loaded():
    """Dask, compiled code (the workers' own), SciPy's statistics and Plotly took most of the seconds of its start."""
    code = "import sys, harness.campaigns.planfile, harness.campaigns.run, harness.campaigns.local; print(*sys.modules)"
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parent.parent)}
    loaded = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True).stdout
    assert not {"distributed", "dask", "numba", "scipy.stats", "plotly"} & set(loaded.split())
    assert "harness.campaigns.run" in loaded.split()


def test_no_more_workers_than_cases(folder, tmp_path):
    with Local(8) as crew:
        run(read_plan(None, {"grid": {"fault.friction": [1.0, 2.0]}}), crew, fmus=folder, out=tmp_path)
        assert crew.threads == 2
    assert multiprocessing.active_children() == []


def test_parts_are_of_about_equal_work_and_the_last_ones_small():
    """HF costs 25 ms a case, 60 cases: no part of more than WORK or than a share, and both threads end together."""
    from harness.campaigns.batch import blank

    table = read_plan(None, {"ranges": {"fault.friction": [1.0, 3.0]}, "samples": 60, "fidelities": ["HF"]}).table()
    parts = Parts("", table, [range(0, 60)], 2, (1, 1, 1))
    free, sizes = [0.0, 0.0], []
    while part := parts.take():
        sizes.append(len(part))
        thread = free.index(min(free))
        free[thread] += 0.025 * len(part)
        result = blank(len(part), 1, 1, 1)
        whole = parts.put(part, type(result)(result.values, result.features, result.failures, 0.025 * len(part)))
    assert sum(sizes) == 60 and max(sizes) <= 10 and sizes[0] == 1 and whole is not None and whole[0] == range(0, 60)
    assert abs(free[0] - free[1]) <= 0.05


def test_a_grid_of_more_cases_than_a_machine_counts_is_refused():
    """4**32 is 0 in 64 bits."""
    grid = {}
    for port in [port for port in ports.PARAMETERS if port.kind == "Real"][:32]:
        low = port.start if port.minimum is None else port.minimum
        high = low + 1.0 if port.maximum is None else port.maximum
        grid[port.name] = [low + share * (high - low) for share in (0.2, 0.4, 0.6, 0.8)]
    with pytest.raises(HarnessError, match=f"{4**32:,} cases are more than 10,000,000; split the campaign"):
        read_plan(None, {"grid": grid})


@pytest.mark.parametrize("after", ["the folder", "the store"])
def test_an_interrupt_while_a_campaign_starts_ends_it(after, folder, tmp_path):
    out = tmp_path / "out"
    words = [sys.executable, "-c", "from harness.cli import main; main()", "campaign", "--range", "fault.friction=1:3",
             "--samples", "5000", "--fmus", str(folder), "--out", str(out)]  # fmt: skip
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parent.parent)}
    process = subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment, text=True, start_new_session=True
    )
    awaited = out if after == "the folder" else out / "campaign.zarr"
    while not awaited.exists():
        assert process.poll() is None
        time.sleep(0.002)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to all processes of the command
    told = process.communicate(timeout=60)
    assert process.returncode == 130 and "interrupted" in told[1] and not re.search("Traceback|Error", told[1]), told
    for _ in range(100):
        left = subprocess.run(["pgrep", "-s", str(process.pid)], capture_output=True, text=True, check=False).stdout
        if not left:
            break
        time.sleep(0.1)
    assert not left
