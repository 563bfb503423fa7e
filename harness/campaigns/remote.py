"""Workers of a Dask cluster. A scheduler that goes away is waited for: what was with it is sent again when it is back."""

import contextlib
import logging
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from typing import Any, Self

from distributed import Client, WorkerPlugin, as_completed
from distributed.client import Future
from distributed.scheduler import KilledWorker

from ema_fmu_src import __version__
from harness.campaigns import worker as flights
from harness.campaigns.batch import Batch, Result, Shared, died
from harness.errors import HarnessError

AHEAD = 2
"""Parts that a thread has: one at work, one waiting. So memory does not grow with the number of cases."""
TIMEOUT = 30.0
"""Time [s] after which a cluster without workers is given up; a third of it for a scheduler that does not answer."""
PATIENCE = 120.0
"""Time [s] for which a scheduler that was there is waited for."""
PAUSE = 1.0
"""Time [s] between two looks for it."""
GONE = (CancelledError, OSError, TimeoutError)
"""What Dask raises where a cluster has gone."""


class SharedByWorkers(WorkerPlugin):
    """Sends what all cases share to every worker once, instead of with each part, and loads the compiled code there."""

    def __init__(self, shared: Shared) -> None:
        self.shared = shared
        self.name = f"ema-campaign-{shared.digest}"

    def setup(self, worker: object) -> None:
        flights.know(self.shared)
        flights.warm(self.shared)

    def teardown(self, worker: object) -> None:
        flights.forget(self.shared.digest)


def software_version() -> str:
    """The release of this software on the worker."""
    return __version__


class Remote:
    """The workers of the Dask scheduler at `address`; a context manager. `tell` is told in a line what has happened to it.

    HarnessError if no scheduler answers.
    """

    def __init__(self, address: str, tell: Callable[[str], None] = lambda line: None) -> None:
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        self._address, self._tell = address, tell
        self._out: dict[Future, Batch] = {}
        self._failed: deque[tuple[Batch, Result]] = deque()
        self._suspects: deque[Batch] = deque()
        self._alone: Batch | None = None
        self.threads = 0
        try:
            self._connect()
        except (*GONE, ValueError) as error:
            raise HarnessError(f"--scheduler {address}: no Dask scheduler answers there: {error}") from None

    def _connect(self) -> None:
        self._client = Client(self._address, timeout=TIMEOUT / 3.0, set_as_default=False)
        self._finished = as_completed(loop=self._client.loop)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(Exception):  # the cluster may have gone
            self._client.close(timeout=PAUSE)

    @contextlib.contextmanager
    def knowing(self, shared: Shared, cases: int) -> Iterator[None]:
        """Within it, every worker, also one that joins later, holds what all cases share.

        HarnessError if there is none, or if one of them has another release of this software.
        """
        self._plugin, self._shared = SharedByWorkers(shared), shared
        try:
            self._teach()
        except GONE as error:
            raise HarnessError(f"--scheduler {self._address}: {self._nobody(error)}") from None
        try:
            yield
        finally:
            for future in self._out:
                with contextlib.suppress(Exception):
                    future.cancel()
            with contextlib.suppress(Exception):
                self._client.unregister_worker_plugin(self._plugin.name)

    def _nobody(self, error: BaseException) -> str:
        if isinstance(error, TimeoutError):
            return f"the Dask cluster has no workers after {TIMEOUT:g} s; start some, or leave out --scheduler"
        return f"the Dask cluster has gone: {error}"

    def _teach(self) -> None:
        self._client.wait_for_workers(1, timeout=TIMEOUT)
        try:
            self._client.register_plugin(self._plugin)
            versions: dict[str, Any] = self._client.run(software_version)
        except ImportError as error:
            raise HarnessError(f"the workers need ema-twins {__version__}, as here: {error}") from None
        for address, found in versions.items():
            if found != __version__:
                raise HarnessError(
                    f"worker {address} has ema-twins {found}, here it is {__version__}; they have to be the same"
                )
        self.threads = sum(self._client.nthreads().values())

    @property
    def hungry(self) -> bool:
        """Whether a worker would soon have nothing to do."""
        return self._alone is None and len(self._out) < AHEAD * max(self.threads, 1)

    @property
    def busy(self) -> bool:
        """Whether there is a result to wait for."""
        return bool(self._failed or self._out or self._suspects)

    def submit(self, part: Batch) -> None:
        """Have a part flown."""
        try:
            future = self._client.submit(flights.fly_batch, part, pure=False, retries=2)
            self._out[future] = part
            self._finished.add(future)
        except GONE as error:
            self._wait(error, [part])

    def result(self) -> tuple[Batch, Result]:
        """Waits for the result of a part, or of a case of it that was flown alone.

        Dask blames all that a dead worker had. So the cases of such parts are flown when the others are done, one at a time:
        only one of which a worker dies then has failed. HarnessError if the cluster has gone and does not come back.
        """
        while not self._failed:
            if not self._out:
                self._alone = self._suspects.popleft()
                self.submit(self._alone)
            future = next(self._finished)
            if future not in self._out:  # of a cluster that has gone since
                continue
            part = self._out.pop(future)
            try:
                result: Result = future.result()
                self._alone = None
                return part, result
            except KilledWorker:
                if part is self._alone:
                    self._failed.append((part, died(part, self._shared)))
                    self._alone = None
                else:
                    self._suspects.extend(part.alone(place) for place in range(len(part)))
            except (ImportError, AttributeError, KeyError) as error:
                raise HarnessError(
                    f"the workers cannot fly: {error!r}; they need the ema-twins {__version__} that runs here"
                ) from None
            except GONE as error:
                self._wait(error, [part])
        return self._failed.popleft()

    def _wait(self, error: BaseException, parts: list[Batch]) -> None:
        """Wait for a cluster that has gone; what was with it, and `parts`, is sent again."""
        parts = [*parts, *self._out.values()]
        self._out.clear()
        self._tell(f"the Dask cluster at {self._address} has gone: {error}; waiting {PATIENCE:g} s for it to come back")
        end = time.monotonic() + PATIENCE
        while True:
            self.__exit__()
            try:
                self._connect()
                self._teach()
                break
            except GONE as still:
                if time.monotonic() > end:
                    raise HarnessError(
                        f"the Dask cluster at {self._address} has gone and does not come back: {still}; "
                        "what is done is kept, the same command goes on"
                    ) from None
                time.sleep(PAUSE)
        self._tell(f"the Dask cluster is back, with {self.threads} threads")
        for part in parts:
            self.submit(part)
