"""What the process does: it opens FMUs, does the jobs that come as messages, and answers with plain numbers."""

import fcntl
import os
import resource
import select
import signal
import socket
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from harness.errors import HarnessError
from harness.flight.couple import Connection, System
from harness.flight.couple import fly as fly_system
from harness.flight.shield.wire import Array, Reader, encode
from harness.flight.twin import Twin
from harness.trials import Trial

LARGEST_FILE = 2**31
"""Bytes of a file that an FMU writes."""

OnProgress = Callable[[int], bool]
Answer = tuple[dict[str, Any], Array]
_twins: dict[str, Twin] = {}
"""Open twins by path."""


def _run(job: dict[str, Any], body: Array, on_progress: OnProgress) -> Answer:
    """`Twin.run`: the outputs as columns, Booleans as 0 and 1."""
    names = job["trial"].pop("names")
    inputs = dict(zip(names, body.reshape(len(names), -1), strict=True))
    continuous = frozenset(job["trial"].pop("continuous"))
    trial = Trial(**job["trial"], inputs=inputs, continuous=continuous)
    if job["fmu"] not in _twins:
        _twins[job["fmu"]] = Twin(Path(job["fmu"]))
    run = _twins[job["fmu"]].run(trial, job["parameters"], on_progress=on_progress)
    table = np.column_stack([run[name].values.astype(np.float64) for name in job["outputs"]])
    return {"rows": len(table), "wall": run.attrs["wall_s"], "stopped": bool(run.attrs["stopped"])}, table


def _couple(job: dict[str, Any], body: Array, on_progress: OnProgress) -> Answer:
    """`couple.fly`: what is recorded, as columns."""
    told = job["system"]
    system = System(
        components={name: Path(path) for name, path in told["components"].items()},
        connections=[Connection(**each) for each in told["connections"]],
        parameters=told["parameters"],
    )
    bounds = np.cumsum([0, *job["lengths"]])
    inputs = {name: body[bounds[i] : bounds[i + 1]] for i, name in enumerate(job["names"])}
    run = fly_system(system, inputs=inputs, **job["options"])
    columns = [run["time"].values, *(run[name].values for name in job["options"]["record"])]
    kinds = [column.dtype.kind for column in columns]
    return {"rows": len(columns[0]), "kinds": kinds}, np.column_stack([column.astype(np.float64) for column in columns])


JOBS: dict[str, Callable[[dict[str, Any], Array, OnProgress], Answer]] = {"run": _run, "couple": _couple}


def main() -> None:
    """The arguments after the search path: numbers of the connection and of the pipe that lives as long as the parent does;
    bytes that a job may take."""
    connection, life, memory = socket.socket(fileno=int(sys.argv[2])), int(sys.argv[3]), int(sys.argv[4])
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    _die_with(life)
    _limit(memory)
    connection.sendall(encode({"kind": "ready"}))
    jobs = _Jobs(connection)
    while (message := jobs.next()) is not None:
        job, body = message
        if job.get("kind") == "stop":  # it came after the answer
            continue
        try:
            head, answer = JOBS[job["job"]](job, body, jobs.on_progress)
        except HarnessError as error:
            connection.sendall(encode({"kind": "refused", "line": str(error)[:4000]}))
        except MemoryError:
            line = f"takes more memory than the {memory // 2**20} MiB that are allowed"
            connection.sendall(encode({"kind": "refused", "line": f"{job.get('what', 'the job')}: {line}"}))
        else:
            connection.sendall(encode({"kind": "answer", "number": job["number"], **head}, answer))
    for twin in _twins.values():
        twin.close()


class _Jobs:
    """What comes from the parent."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection, self._reader = connection, Reader(2**40)

    def next(self) -> tuple[dict[str, Any], Array] | None:
        """The next message; None if the parent has closed the connection."""
        while (message := self._reader.next()) is None:
            data = self._connection.recv(2**20)
            if not data:
                return None
            self._reader.feed(data)
        return message

    def on_progress(self, points: int) -> bool:
        """Tell the parent; True if it wants a stop."""
        self._connection.sendall(encode({"kind": "notice", "points": points}))
        if not select.select([self._connection], [], [], 0.0)[0]:
            return False
        message = self.next()
        return message is None or message[0].get("kind") == "stop"


def _die_with(life: int) -> None:
    """The system ends the whole group, by SIGIO, once the last writer of this pipe is gone."""
    fcntl.fcntl(life, fcntl.F_SETOWN, -os.getpgrp())
    fcntl.fcntl(life, fcntl.F_SETFL, fcntl.fcntl(life, fcntl.F_GETFL) | os.O_ASYNC)


def _limit(memory: int) -> None:
    """No core files, no endless files; and `memory` bytes above what Python has now, where the system tells that."""
    _lower(resource.RLIMIT_CORE, 0)
    _lower(resource.RLIMIT_FSIZE, LARGEST_FILE)
    statistics = Path("/proc/self/statm")
    if statistics.exists():
        _lower(resource.RLIMIT_AS, int(statistics.read_text().split()[0]) * resource.getpagesize() + memory)


def _lower(kind: int, value: int) -> None:
    _, hard = resource.getrlimit(kind)
    least = value if hard == resource.RLIM_INFINITY else min(value, hard)
    resource.setrlimit(kind, (least, least))
