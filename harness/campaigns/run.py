"""A campaign: its cases go to workers part by part; a chunk of the dataset is written as soon as it is whole."""

import contextlib
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from harness.campaigns.batch import Batch, Result, Shared
from harness.campaigns.lock import locked
from harness.campaigns.names import names
from harness.campaigns.parts import Parts
from harness.campaigns.plan import Plan
from harness.campaigns.store import Store
from harness.errors import required_extra
from harness.provenance import Provenance, file_hash


class Crew(Protocol):
    """Who flies: `threads` cases at a time. What each member does: `local.py`."""

    threads: int

    @property
    def hungry(self) -> bool: ...

    @property
    def busy(self) -> bool: ...

    def knowing(self, shared: Shared, cases: int) -> AbstractContextManager[None]: ...

    def submit(self, part: Batch) -> None: ...

    def result(self) -> tuple[Batch, Result]: ...


@dataclass(frozen=True)
class Summary:
    """What a campaign has done: number of cases flown now, and of those done before; number and reason of each failure.

    `wall`: seconds from the first part to the last write; `fmu_seconds`: spent inside the FMUs by all `threads`; `damaged`:
    what was found damaged and was made again, a line each.
    """

    cases: int
    before: int
    failures: list[tuple[int, str]]
    wall: float
    fmu_seconds: float
    threads: int
    damaged: list[str]


@contextlib.contextmanager
def cluster(scheduler: str | None, workers: int, tell: Callable[[str], None] = lambda line: None) -> Iterator[Crew]:
    """The workers of the Dask scheduler at an address, or `workers` processes of one thread on this machine.

    `tell` is told in a line what happens to them. HarnessError if no scheduler answers.
    """
    if scheduler:
        with required_extra("campaign", "--scheduler"):
            from harness.campaigns.remote import Remote

        with Remote(scheduler, tell) as remote:
            yield remote
    else:
        from harness.campaigns.local import Local, preload

        preload()
        with Local(workers) as local:
            yield local


def run(
    plan: Plan,
    crew: Crew,
    *,
    fmus: Path,
    out: Path,
    record: Provenance | None = None,
    on_start: Callable[[int, int], None] = lambda total, done: None,
    on_cases: Callable[[int], None] = lambda cases: None,
) -> Summary:
    """Fly those cases of `plan` that are not yet done, into the folder `out`, with the FMUs in the folder `fmus`.

    `record`: how the dataset is made, which is kept in it. `on_start(cases, done)` is called once, `on_cases(cases)` after
    each part. HarnessError if `out` holds another campaign, if another process flies one there, if it cannot be written, or
    if the workers go away and do not come back.
    """
    with locked(out):
        contents = {name: (fmus / name).read_bytes() for name in sorted({fidelity.fmu for fidelity in plan.fidelities})}
        hashes = {name: file_hash(fmus / name) for name in contents}
        store = Store(out, plan, hashes, record)
        waiting = store.waiting()
        cases = sum(map(len, waiting))
        before = len(store.table) - cases
        on_start(len(store.table), before)
        if not waiting:
            return Summary(0, before, store.finish(), 0.0, 0.0, crew.threads, store.damaged)
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
        with crew.knowing(shared, cases):
            shape = len(plan.outputs), shared.times, len(names(plan.outputs))
            parts = Parts(store.digest, store.table, waiting, crew.threads, shape)
            wall, fmu_seconds = _fly(crew, parts, store, on_cases)
        return Summary(cases, before, store.finish(), wall, fmu_seconds, crew.threads, store.damaged)


def _fly(crew: Crew, parts: Parts, store: Store, on_cases: Callable[[int], None]) -> tuple[float, float]:
    """Fly all `parts`; wall seconds, and seconds inside the FMUs."""
    started, fmu_seconds = time.perf_counter(), 0.0
    while True:
        while crew.hungry and (part := parts.take()):
            crew.submit(part)
        if not crew.busy:
            return time.perf_counter() - started, fmu_seconds
        flown, result = crew.result()
        if whole := parts.put(flown, result):
            store.write(*whole)
        fmu_seconds += result.fmu_seconds
        on_cases(len(flown))
