"""FMUs in a process of their own: one that crashes, hangs or floods takes nothing else with it."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import xarray as xr

from harness.errors import HarnessError
from harness.flight.couple import System
from harness.flight.master import Recording
from harness.flight.shield.process import Ended, Process
from harness.flight.shield.wire import Array
from harness.flight.twin import Twin
from harness.provenance import file_hash
from harness.trials import Trial

TIME_LIMIT = 60.0
"""For one run, the FMU's loading included, but not the start of the process [s]."""
MEMORY_LIMIT = 4 * 2**30
"""For an FMU, above what Python takes itself; address space, on Linux only [bytes]."""

KINDS = {"f": np.float64, "i": np.int64, "b": np.bool_}
"""Of recorded variables."""

OnProgress = Callable[[int], object]


class Isolated:
    """Flies trials with the FMU at `path` in another process; a context manager, with the interface of `Twin.run`.

    HarnessError with one line if the process dies, takes longer than `time_limit` [s] or more than `memory_limit` [bytes],
    or sends what is no run (the next run then starts a new one), or if the FMU refuses something. No process is left behind.
    It is no sandbox: the FMU has this user's rights.
    """

    def __init__(self, path: Path, *, time_limit: float = TIME_LIMIT, memory_limit: int = MEMORY_LIMIT) -> None:
        self.path = path
        self._process = Process(time_limit=time_limit, memory_limit=memory_limit)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """End the process; a second call does nothing."""
        self._process.close()

    def run(
        self,
        trial: Trial,
        parameters: Mapping[str, float] | None = None,
        *,
        on_progress: Callable[[int], object] | None = None,
    ) -> xr.Dataset:
        """As `Twin.run`; `on_progress` is also called with 0, so that an FMU that does not return can be stopped."""
        given = {name: float(value) for name, value in (parameters or {}).items()}
        outputs = Twin.recorded()
        n_steps = len(trial.time) - 1
        plain = {each.name: getattr(trial, each.name) for each in fields(trial) if each.name != "inputs"}
        job = {
            "job": "run",
            "what": f"{self.path.name}, trial {trial.name}",
            "fmu": str(self.path.absolute()),
            "trial": plain | {"continuous": sorted(trial.continuous), "names": list(trial.inputs)},
            "parameters": given,
            "outputs": [port.name for port in outputs],
        }
        inputs = np.stack(list(trial.inputs.values()))
        most = (n_steps + 1) * len(outputs) * 8
        try:
            head, table = _asked(self._process, job, inputs, most, len(outputs), on_progress)
            wall, stopped = head.get("wall"), head.get("stopped")
            whole = len(table) == n_steps + 1
            if not isinstance(wall, float) or not 0.0 <= wall < math.inf or stopped is not (not whole) or not len(table):
                self._process.kill()
                raise Ended("was ended: it sent what is no run")
        except Ended as error:
            raise HarnessError(f"{self.path.name}, trial {trial.name}: {error}") from None
        digest = file_hash(self.path)
        return Twin.dataset(self.path.name, digest, trial, given, outputs, Recording(table, wall, stopped))


def couple(
    system: System,
    *,
    stop: float,
    step: float,
    inputs: Mapping[str, Array] | None = None,
    record: Sequence[str] = (),
    order: str = "jacobi",
    time_limit: float = TIME_LIMIT,
    memory_limit: int = MEMORY_LIMIT,
) -> xr.Dataset:
    """As `couple.fly`, all FMUs of the system in one process; HarnessError as from `Isolated`."""
    given = {name: np.asarray(series, dtype=np.float64) for name, series in (inputs or {}).items()}
    job = {
        "job": "couple",
        "what": ", ".join(system.components),
        "system": {
            "components": {name: str(path.absolute()) for name, path in system.components.items()},
            "connections": [asdict(each) for each in system.connections],
            "parameters": dict(system.parameters),
        },
        "names": list(given),
        "lengths": [len(series) for series in given.values()],
        "options": {"stop": stop, "step": step, "record": list(record), "order": order},
    }
    body = np.concatenate(list(given.values())) if given else np.empty(0)
    width = len(record) + 1
    most = (math.ceil(stop / step) + 2) * width * 8
    process = Process(time_limit=time_limit, memory_limit=memory_limit)
    try:
        head, table = _asked(process, job, body, most, width, None)
        kinds = head.get("kinds")
        if not isinstance(kinds, list) or len(kinds) != width or not set(kinds) <= set(KINDS):
            raise Ended("was ended: it sent what is no run")
    except Ended as error:
        raise HarnessError(f"{job['what']}: {error}") from None
    finally:
        process.close()
    data: dict[str, Any] = {name: ("time", table[:, i].astype(KINDS[kinds[i]])) for i, name in enumerate(record, 1)}
    return xr.Dataset(data, coords={"time": ("time", table[:, 0], {"units": "s"})})


def _asked(
    process: Process,
    job: Mapping[str, Any],
    body: Array,
    most: int,
    width: int,
    on_progress: OnProgress | None,
) -> tuple[dict[str, Any], Array]:
    """Head and table, shape (rows, width), of the answer; Ended if they do not fit."""
    head, numbers = process.ask(job, body, most=most, on_progress=on_progress or (lambda points: False))
    if head.get("rows") != len(numbers) / width:
        process.kill()
        raise Ended("was ended: it sent what is no run")
    return head, numbers.reshape(-1, width)
