"""A campaign on Dask: a bounded number of batches at work at a time, each written as soon as it is done."""

import contextlib
import logging
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from dataclasses import dataclass
from pathlib import Path

import dask
import numpy as np
from distributed import Client, LocalCluster, as_completed
from distributed.client import Future
from distributed.scheduler import KilledWorker

from ema_fmu_src import __version__
from harness.campaigns.features import names as feature_names
from harness.campaigns.plan import Plan
from harness.campaigns.store import Store
from harness.campaigns.worker import Batch, Result, Shared, SharedByWorkers, fly_batch, software_version
from harness.errors import HarnessError
from harness.flight import fmufile

BATCHES_PER_THREAD = 2
"""Submitted at a time: one at work, one waiting. So memory does not grow with the number of cases."""
WORKER_ENVIRONMENT = {name: "1" for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")} | {
    "MALLOC_TRIM_THRESHOLD_": str(2**28),
    "MALLOC_MMAP_THRESHOLD_": str(2**25),
}
"""Of the workers on this machine: one thread each. By Dask's default, freed memory goes back to the system at once, which
costs a tenth of a run of ELF+."""
WORKER_TIMEOUT = 30.0
"""Time [s] after which a cluster without workers is given up."""


@dataclass(frozen=True)
class Summary:
    """What a campaign has done: number of cases flown now, and of those done before; number and reason of each failure.

    `wall`: seconds from the first batch to the last write; `fmu_seconds`: spent inside the FMUs by all `threads`.
    """

    cases: int
    before: int
    failures: list[tuple[int, str]]
    wall: float
    fmu_seconds: float
    threads: int


@contextlib.contextmanager
def cluster(scheduler: str | None, workers: int) -> Iterator[Client]:
    """A client of the Dask scheduler at an address, or of `workers` processes of one thread on this machine.

    HarnessError if no scheduler answers.
    """
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    if scheduler:
        try:
            client = Client(scheduler, timeout=WORKER_TIMEOUT / 3.0, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise HarnessError(f"--scheduler {scheduler}: no Dask scheduler answers there: {error}") from None
        with client:
            yield client
        return
    settings = {
        "distributed.worker.profile.enabled": False,
        "distributed.admin.tick.interval": "1s",  # 20 ms in four processes cost a hundredth of the cores
        "distributed.nanny.pre-spawn-environ": WORKER_ENVIRONMENT,
    }
    with dask.config.set(settings), tempfile.TemporaryDirectory(prefix="ema_dask_") as folder:
        with _children_ignore_interrupts():
            local = LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                dashboard_address=None,
                silence_logs=logging.CRITICAL,
                local_directory=folder,
            )
        with local, Client(local, set_as_default=False, direct_to_workers=True) as client:
            yield client


@contextlib.contextmanager
def _children_ignore_interrupts() -> Iterator[None]:
    """Processes that begin inside ignore Ctrl-C: this process ends them, so that they print no tracebacks."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def run(
    plan: Plan,
    client: Client,
    *,
    fmus: Path,
    out: Path,
    on_start: Callable[[int, int], None] = lambda total, done: None,
    on_cases: Callable[[int], None] = lambda cases: None,
) -> Summary:
    """Fly those cases of `plan` that are not yet done, into the folder `out`, with the FMUs in the folder `fmus`.

    `on_start(cases, done)` is called once, `on_cases(cases)` after each batch. HarnessError if `out` holds another campaign,
    or if the cluster has no workers.
    """
    contents = {name: (fmus / name).read_bytes() for name in sorted({fidelity.fmu for fidelity in plan.fidelities})}
    hashes = {name: fmufile.content_hash(fmus / name) for name in contents}
    store = Store(out, plan, hashes)
    waiting = store.batches()
    open_cases = sum(len(cases) for cases in waiting)
    on_start(len(store.table), len(store.table) - open_cases)
    try:
        client.wait_for_workers(1, timeout=WORKER_TIMEOUT)
    except TimeoutError:
        raise HarnessError(
            f"the Dask cluster has no workers after {WORKER_TIMEOUT:g} s; start some, or leave out --scheduler"
        ) from None
    shared = Shared(
        store.digest,
        plan.trials,
        plan.fidelities,
        {name: (hashes[name], content) for name, content in contents.items()},
        plan.outputs,
        plan.noise,
        plan.every,
        plan.seed,
        plan.actuator.output,
    )
    threads = sum(client.nthreads().values())
    if not waiting:
        return Summary(0, len(store.table), store.finish(), 0.0, 0.0, threads)
    with _sent(client, shared):
        wall, fmu_seconds = _fly(client, plan, store, waiting, BATCHES_PER_THREAD * threads, on_cases)
    return Summary(open_cases, len(store.table) - open_cases, store.finish(), wall, fmu_seconds, threads)


@contextlib.contextmanager
def _sent(client: Client, shared: Shared) -> Iterator[None]:
    """Inside, every worker, also one that joins later, holds what all cases share.

    HarnessError if one of them has another release of this software.
    """
    plugin = SharedByWorkers(shared)
    try:
        client.register_plugin(plugin)
        versions = client.run(software_version)
    except ImportError as error:
        raise HarnessError(f"the workers need ema-twins {__version__}, as here: {error}") from None
    for address, found in versions.items():
        if found != __version__:
            raise HarnessError(f"worker {address} has ema-twins {found}, here it is {__version__}; they have to be the same")
    try:
        yield
    finally:
        with contextlib.suppress(Exception):  # the cluster may have gone, and its workers with it
            client.unregister_worker_plugin(plugin.name)


def _fly(
    client: Client, plan: Plan, store: Store, waiting: list[range], at_once: int, on_cases: Callable[[int], None]
) -> tuple[float, float]:
    """Fly the batches `waiting`, `at_once` of them at a time; wall seconds, and seconds inside the FMUs."""
    started, fmu_seconds = time.perf_counter(), 0.0
    submitted: dict[Future, range] = {}
    queue = iter(waiting)
    finished = as_completed(loop=client.loop)

    def submit() -> None:
        cases = next(queue, None)
        if cases is not None:
            future = client.submit(fly_batch, _batch(store, cases), pure=False, retries=2)
            submitted[future] = cases
            finished.add(future)

    for _ in range(at_once):
        submit()
    for future in finished:
        cases = submitted.pop(future)
        result = _result(client, future, plan, store, cases)
        submit()
        store.write(cases, result)
        fmu_seconds += result.fmu_seconds
        on_cases(len(cases))
    return time.perf_counter() - started, fmu_seconds


def _batch(store: Store, cases: range) -> Batch:
    rows, table = slice(cases.start, cases.stop), store.table
    return Batch(
        store.digest,
        tuple(cases),
        tuple(table.trial[rows].tolist()),
        tuple(table.fidelity[rows].tolist()),
        table.names,
        table.values[rows],
    )


def _result(client: Client, future: Future, plan: Plan, store: Store, cases: range) -> Result:
    """The result of a batch. If it has killed its workers repeatedly, each case is flown alone: only the bad ones fail."""
    try:
        result: Result = future.result()
        return result
    except KilledWorker:
        pass
    except (ImportError, AttributeError) as error:
        raise HarnessError(
            f"the workers cannot fly: {error}; they need the ema-twins {__version__} that runs here"
        ) from None
    except (CancelledError, OSError) as error:
        raise HarnessError(f"the Dask cluster has gone: {error}; what is done is kept, the same command goes on") from None
    parts = []
    for case in cases:
        alone = _batch(store, range(case, case + 1))
        try:
            parts.append(client.submit(fly_batch, alone, pure=False).result())
        except KilledWorker:
            blank = np.full((1, len(plan.outputs), len(plan.time)), np.nan, dtype=np.float32)
            width = len(feature_names(plan.outputs))
            parts.append(
                Result(blank, np.full((1, width), np.nan), ["the worker's process ended each time it was flown"], 0.0)
            )
    return Result(
        np.concatenate([part.values for part in parts]),
        np.concatenate([part.features for part in parts]),
        [reason for part in parts for reason in part.failures],
        sum(part.fmu_seconds for part in parts),
    )
