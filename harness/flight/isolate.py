"""An FMU in a process of its own: one that crashes or hangs takes nothing else with it."""

import multiprocessing
import signal
from collections.abc import Callable, Mapping
from multiprocessing.connection import Connection
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import xarray as xr

from harness.errors import HarnessError
from harness.trials import Trial

TIME_LIMIT = 60.0
"""For one run, the FMU's loading included, but not the start of the process [s]."""


def _serve(pipe: Connection, path: Path) -> None:
    """What the process does: open the FMU, fly what comes through the pipe, answer with the run or with a line of text."""
    from harness.flight.twin import Twin

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    pipe.send(None)  # ready: the time limit is for FMUs, not for Python's own start
    twin: Any = None
    while True:
        try:
            trial, parameters = pipe.recv()
        except EOFError:
            return
        try:
            twin = twin or Twin(path)
            pipe.send(twin.run(trial, parameters))
        except HarnessError as error:
            pipe.send(str(error))


class Isolated:
    """Flies trials with the FMU at `path` in another process; a context manager, with the interface of `Twin.run`.

    HarnessError with one line if the process dies or takes longer than `time_limit` [s] (the next run then starts a new
    one), or if the FMU refuses something. No process is left behind.
    """

    def __init__(self, path: Path, *, time_limit: float = TIME_LIMIT) -> None:
        self.path = path
        self.time_limit = time_limit
        self._process: Any = None
        self._pipe: Connection | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """End the process; a second call does nothing."""
        process, self._process = self._process, None
        if self._pipe is not None:
            self._pipe.close()
            self._pipe = None
        if process is not None:
            process.join(timeout=1.0)
            if process.is_alive():
                process.kill()
                process.join()
            process.close()

    def run(
        self,
        trial: Trial,
        parameters: Mapping[str, float] | None = None,
        *,
        on_progress: Callable[[int], object] | None = None,
    ) -> xr.Dataset:
        """As `Twin.run`, but the run is never stopped: `on_progress` is called once, at its end."""
        try:
            pipe = self._pipe or self._started()
            pipe.send((trial, dict(parameters or {})))
            if not pipe.poll(self.time_limit):
                problem = f"has not finished within {self.time_limit:g} s"
                self._process.kill()
            else:
                answer = pipe.recv()
                if isinstance(answer, str):
                    raise HarnessError(answer)
                if on_progress:
                    on_progress(len(answer.time) - 1)
                return answer
        except (EOFError, OSError):
            problem = self._death()
        self.close()
        raise HarnessError(f"{self.path.name}, trial {trial.name}: {problem}")

    def _started(self) -> Connection:
        """The pipe to a new process that is ready; EOFError if it has died."""
        context = multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=_serve, args=(other, self.path), daemon=True)
        self._process.start()
        other.close()
        self._pipe.recv()
        return self._pipe

    def _death(self) -> str:
        self._process.join()
        code = self._process.exitcode or 0
        return f"crashed ({signal.Signals(-code).name})" if code < 0 else f"ended its process with exit code {code}"
