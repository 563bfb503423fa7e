"""Workers on this machine: processes that begin within a fraction of a second, and die alone.

They are forked from a process that has loaded the code already and has no threads. One that dies, whatever it dies of, is
replaced, and what it flew is flown again, case by case; a case at which workers die repeatedly is recorded as failed.
"""

import contextlib
import multiprocessing
import signal
import sys
import tempfile
import types
from collections import deque
from collections.abc import Iterator
from multiprocessing import connection, forkserver
from pathlib import Path
from typing import Self

from harness import scratch
from harness.campaigns.batch import Batch, Result, Shared, died
from harness.errors import HarnessError
from harness.parallel import THREADS, environment

ENVIRONMENT = dict.fromkeys(THREADS, "1") | {
    "MALLOC_TRIM_THRESHOLD_": str(2**28),
    "MALLOC_MMAP_THRESHOLD_": str(2**25),
}
"""Of the workers: one thread each, and freed memory is kept for the next run, which saves a tenth of a run of ELF+."""
LOADED = ["harness.campaigns.worker"]
"""What the process loads that workers are forked from."""
AHEAD = 2
"""Parts that a worker has: one at work, one waiting."""
MOST_DEATHS = 3
"""Workers that may die of a case before it counts as failed, or in a row as they begin before the campaign ends."""


def preload() -> None:
    """Begin the process that workers are forked from; it loads their code while this one goes on."""
    multiprocessing.get_context("forkserver").set_forkserver_preload(LOADED)
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # inherited: a Ctrl-C is for this process alone
    try:
        with environment(ENVIRONMENT):
            forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


class Local:
    """`workers` processes on this machine, or fewer where there are fewer cases; a context manager."""

    def __init__(self, workers: int) -> None:
        self.threads = self._most = workers
        self._crew: list[_Worker] = []
        self._waiting: deque[Batch] = deque()
        self._failed: deque[tuple[Batch, Result]] = deque()
        self._deaths: dict[int, int] = {}
        self._stillborn = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for worker in self._crew:
            worker.end()
        self._crew.clear()

    @contextlib.contextmanager
    def knowing(self, shared: Shared, cases: int) -> Iterator[None]:
        """Within it, the workers fly the `cases` cases of a campaign."""
        self.threads = min(self._most, cases)
        self._shared = shared
        with scratch.folder("campaign") as folder:
            self._begin = folder, shared
            try:
                self._crew += [_Worker(*self._begin) for _ in range(self.threads)]
                yield
            finally:
                self.__exit__()

    @property
    def hungry(self) -> bool:
        """Whether a worker would soon have nothing to do."""
        return not self._waiting and any(len(worker.parts) < AHEAD for worker in self._crew)

    @property
    def busy(self) -> bool:
        """Whether there is a result to wait for."""
        return bool(self._failed or self._waiting or any(worker.parts for worker in self._crew))

    def submit(self, part: Batch) -> None:
        """Have a part flown."""
        self._waiting.append(part)
        self._hand_out()

    def result(self) -> tuple[Batch, Result]:
        """Waits for the result of a part, or of a case of it that was flown alone."""
        while True:
            if self._failed:
                return self._failed.popleft()
            ready = connection.wait([worker.pipe for worker in self._crew])
            worker = next(worker for worker in self._crew if worker.pipe is ready[0])
            try:
                answer = worker.pipe.recv()
            except (EOFError, OSError):
                self._replace(worker)
                continue
            if answer is None:
                worker.ready = True
                continue
            done = worker.parts.popleft()
            self._hand_out()
            return done, answer

    def _hand_out(self) -> None:
        while self._waiting:
            worker = min(self._crew, key=lambda worker: len(worker.parts))
            if len(worker.parts) >= AHEAD:
                return
            part = self._waiting.popleft()
            worker.parts.append(part)
            with contextlib.suppress(OSError):  # it has died: `result` will see it
                worker.pipe.send(part)

    def _replace(self, dead: "_Worker") -> None:
        """A new worker for a dead one; what it was at is flown again, case by case, the rest as it was."""
        code = dead.end()
        self._stillborn = 0 if dead.ready else self._stillborn + 1
        if self._stillborn >= MOST_DEATHS:
            raise HarnessError(f"the worker processes end as they begin, with exit code {code}; --workers N gives fewer")
        self._crew[self._crew.index(dead)] = _Worker(*self._begin)
        if dead.parts and dead.ready:
            part = dead.parts.popleft()
            case = part.cases[0]
            self._deaths[case] = self._deaths.get(case, 0) + (len(part) == 1)
            if len(part) > 1:
                dead.parts.extend(part.alone(place) for place in range(len(part)))
            elif self._deaths[case] < MOST_DEATHS:
                dead.parts.append(part)
            else:
                self._failed.append((part, died(part, self._shared)))
        self._waiting.extend(dead.parts)
        self._hand_out()


class _Worker:
    """A process, the pipe to it, and the parts that it has, the one that it flies first."""

    def __init__(self, folder: Path, shared: Shared) -> None:
        context = multiprocessing.get_context("forkserver")
        self.pipe, theirs = context.Pipe()
        self.parts: deque[Batch] = deque()
        self.ready = False
        with _without_main():
            self._process = context.Process(target=_work, args=(theirs, folder, shared), daemon=True)
            self._process.start()
        theirs.close()

    def end(self) -> int | None:
        """End the process at once; its exit code."""
        self._process.kill()
        self._process.join()
        self.pipe.close()
        return self._process.exitcode


def _work(pipe: connection.Connection, folder: Path, shared: Shared) -> None:
    """What the process does: fly what comes, until nobody is there who would send something."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    tempfile.tempdir = str(folder)
    from harness.campaigns import worker

    worker.know(shared)
    with contextlib.suppress(EOFError, ConnectionError):
        pipe.send(None)
        while True:
            pipe.send(worker.fly_batch(pipe.recv()))


@contextlib.contextmanager
def _without_main() -> Iterator[None]:
    """Processes that begin within it do not import the script that runs, which would fly its campaign in each of them."""
    script = sys.modules["__main__"]
    sys.modules["__main__"] = types.ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = script
