"""Campaigns on a Dask cluster of processes: the same bytes; a scheduler that dies and comes back; a worker out of memory."""

import os
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from test_campaign import assert_same

from harness.campaigns import plan, remote
from harness.campaigns.planfile import read_plan
from harness.campaigns.run import cluster, run
from harness.errors import HarnessError

OPTIONS = {"ranges": {"fault.friction": [1.0, 3.0]}, "samples": 22, "seed": 3}
GREEDY = """
import time
import numpy
from harness.campaigns import worker

worker.fly = getattr(worker, "fly", worker._fly_case)  # Dask may load this twice

def greedy(shared, trial, fidelity, parameters, case):
    if case == 5:
        held = numpy.ones(2**30 // 8)
        time.sleep(60)
    return worker.fly(shared, trial, fidelity, parameters, case)

worker._fly_case = greedy
"""
"""Loaded by a worker: a case that takes 1 GiB."""


@pytest.fixture(scope="module", autouse=True)
def small_chunks() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plan, "MOST_TOGETHER", 4)
        for name in ("TIMEOUT", "PATIENCE"):  # of a machine that has much else to do
            patch.setattr(remote, name, 300.0)
        yield


@pytest.fixture(scope="module")
def folder(fmus: dict[str, Path]) -> Path:
    return fmus["ELF"].parent


@pytest.fixture(scope="module")
def undisturbed(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("undisturbed")
    with cluster(None, 1) as crew:
        run(read_plan(None, OPTIONS), crew, fmus=folder, out=out)
    return out


@pytest.fixture
def dask(tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen]]:
    """Starts a process of Dask; all are ended after the test."""
    started: list[subprocess.Popen] = []
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parent.parent)}
    environment |= {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"}

    def start(*words: str) -> subprocess.Popen:
        silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        command = [sys.executable, "-m", "dask", *words, "--no-dashboard"]
        started.append(subprocess.Popen(command, **silent, env=environment, cwd=tmp_path))
        return started[-1]

    yield start
    for process in reversed(started):  # the workers first, that they look for no scheduler
        process.terminate()
    for process in started:
        try:
            process.wait(10.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


@pytest.fixture
def port() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return str(probe.getsockname()[1])


def test_a_scheduler_that_dies_and_comes_back_costs_nothing(undisturbed, folder, tmp_path, dask, port):
    """Two workers. The scheduler and they are killed amid the flights, and others begin at the same address."""
    address, told, seen = f"tcp://127.0.0.1:{port}", [], []

    def begin() -> list[subprocess.Popen]:
        scheduler = dask("scheduler", "--host", "127.0.0.1", "--port", port)
        return [scheduler, *(dask("worker", address, "--nthreads", "1", "--no-nanny") for _ in range(2))]

    running = begin()

    def strike(cases: int) -> None:
        seen.append(cases)
        if len(seen) == 3:
            for process in running:
                process.kill()
                process.wait()
            begin()

    out = tmp_path / "out"
    out.mkdir()
    with cluster(address, 0, told.append) as crew:
        flown = run(read_plan(None, OPTIONS), crew, fmus=folder, out=out, on_cases=strike)
    assert (flown.cases, flown.failures, flown.threads) == (22, [], 2) and sum(seen) == 22
    assert "has gone" in told[0] and "is back" in told[-1]
    assert_same(undisturbed, out)


def test_a_case_for_which_workers_have_no_memory_fails_alone(undisturbed, folder, tmp_path, dask, port):
    """A worker may take 700 MB, and case 5 takes more: Dask's nanny kills it. Else the data are the undisturbed ones."""
    (tmp_path / "greedy.py").write_text(GREEDY)
    address, out = f"tcp://127.0.0.1:{port}", tmp_path / "out"
    out.mkdir()
    dask("scheduler", "--host", "127.0.0.1", "--port", port)
    dask("worker", address, "--nthreads", "1", "--memory-limit", "700MB", "--preload", str(tmp_path / "greedy.py"))
    with cluster(address, 0) as crew:
        flown = run(read_plan(None, OPTIONS), crew, fmus=folder, out=out)
    assert flown.failures == [(5, "the worker's process ended each time it was flown")]
    with xr.open_zarr(out / "campaign.zarr") as held, xr.open_zarr(undisturbed / "campaign.zarr") as whole:
        others = [case for case in range(22) if case != 5]
        assert np.array_equal(held.position.values[others], whole.position.values[others])
        assert held.position.isel(case=5).isnull().all()


def test_where_no_scheduler_answers_is_one_line(port, monkeypatch):
    monkeypatch.setattr(remote, "TIMEOUT", 1.0)
    with (
        pytest.raises(HarnessError, match=f"--scheduler tcp://127.0.0.1:{port}: no Dask scheduler answers there"),
        cluster(f"tcp://127.0.0.1:{port}", 0),
    ):
        pass
