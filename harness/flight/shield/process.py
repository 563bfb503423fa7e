"""A process of its own, asked by messages and contained: in time, in memory, in what it prints, with all that it starts."""

import contextlib
import json
import os
import selectors
import signal
import socket
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from harness import scratch
from harness.errors import HarnessError
from harness.flight.archive import told
from harness.flight.shield.wire import Array, Forged, Reader, encode

START_LIMIT = 120.0
"""For Python's own start [s]."""
STOP_LIMIT = 5.0
"""For an answer after a stop was asked for, and for an end after the connection was closed [s]."""
POLL = 0.1
"""Between two looks at the time and at what the caller wants [s]."""
MOST_WORDS = 4096
"""Bytes of what is printed that are kept, the last ones; the rest is thrown away as it comes."""
MARK = "EMA_SHIELD"
"""Environment variable by which what the process has started is found, wherever it has gone."""
PROGRAM = "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from harness.flight.shield.child import main; main()"

OnProgress = Callable[[int], object]


class Ended(Exception):
    """The process is gone: the text says how it ended, or why it was ended."""


class Process:
    """A process that does jobs of `child.JOBS`; started when it is first asked, and anew after its end.

    `time_limit` [s] is for a job; `memory_limit` [bytes] is for what a job takes above what Python has (Linux). All of its
    group, and on Linux whatever else it has started, is killed with it, and its temporary files are removed. If this process
    is killed, its group ends too.
    """

    def __init__(self, *, time_limit: float, memory_limit: int) -> None:
        self.time_limit, self.memory_limit = time_limit, memory_limit
        self._process: subprocess.Popen[bytes] | None = None
        self._to_send = memoryview(b"")
        self._number = 0

    def ask(
        self, job: Mapping[str, Any], body: Array, *, most: int, on_progress: OnProgress
    ) -> tuple[dict[str, Any], Array]:
        """Head and body (at most `most` bytes) of the answer to a job.

        `on_progress(points)` is called when the job has got on, and with 0 meanwhile; once it answers True, the job is asked
        to stop. HarnessError if the job is refused, Ended if there is no answer; the process is then gone.
        """
        try:
            if self._process is None:
                self._start()
            self._number += 1
            self._to_send = memoryview(bytes(self._to_send) + encode({**job, "number": self._number}, body))
            late = f"has not finished within {self.time_limit:g} s"
            return self._wait(Reader(most), self.time_limit, late, on_progress, "answer")
        except HarnessError:
            raise
        except BaseException as error:
            words = self._end(graceful=False)
            if isinstance(error, Ended) and words:
                raise Ended(f"{error}; its last words: {words}") from None
            raise

    def close(self) -> None:
        """End the process; a second call does nothing."""
        self._end(graceful=True)

    def kill(self) -> None:
        """End the process without waiting for it."""
        self._end(graceful=False)

    def _start(self) -> None:
        if not hasattr(os, "killpg"):
            raise HarnessError("a process of its own for an FMU needs Linux or macOS; leave out --isolate")
        self._folder = scratch.make("shield")
        self._token = uuid.uuid4().hex
        self._words = b""
        self._status: int | None = None
        self._taken = 0
        self._number = 0
        self._to_send = memoryview(b"")
        self._socket, other = socket.socketpair()
        life, self._life = os.pipe()
        self._output, output = os.pipe()
        self._socket.setblocking(False)
        os.set_blocking(self._output, False)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._socket, selectors.EVENT_READ)
        self._selector.register(self._output, selectors.EVENT_READ)
        arguments = [json.dumps(sys.path), str(other.fileno()), str(life), str(self.memory_limit)]
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-c", PROGRAM, *arguments],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                pass_fds=(other.fileno(), life),
                start_new_session=True,
                env=os.environ | {MARK: self._token, "TMPDIR": str(self._folder)},
            )
        except OSError as error:
            self._selector.close()
            self._socket.close()
            for number in (self._life, self._output):
                os.close(number)
            scratch.remove(self._folder)
            raise HarnessError(f"no process can be started: {error.strerror or error}") from None
        finally:
            other.close()
            os.close(life)
            os.close(output)
        self._wait(Reader(0), START_LIMIT, f"has not started within {START_LIMIT:g} s", lambda points: False, "ready")

    def _wait(
        self, reader: Reader, limit: float, late: str, on_progress: OnProgress, wanted: str
    ) -> tuple[dict[str, Any], Array]:
        """The next message of the kind `wanted`."""
        deadline, stopping = time.monotonic() + limit, False
        while True:
            open_still = self._pump(reader)
            points = 0
            while (message := _checked(reader)) is not None:
                head, body = message
                kind = head.get("kind")
                if kind == "refused" and isinstance(head.get("line"), str):
                    raise HarnessError(told(head["line"]))
                if kind == wanted and head.get("number", 0) == self._number:
                    return head, body
                if kind != "notice" or not _is_count(head.get("points")):
                    raise Ended("was ended: it sent what is no answer")
                points += head["points"]
            if not open_still:
                raise Ended(self._death())
            if on_progress(points) and not stopping:
                stopping, deadline = True, time.monotonic() + STOP_LIMIT
                late = f"was ended: it did not stop within {STOP_LIMIT:g} s"
                self._to_send = memoryview(bytes(self._to_send) + encode({"kind": "stop"}))
            if time.monotonic() > deadline:
                raise Ended(late)

    def _pump(self, reader: Reader) -> bool:
        """Move what is ready, within POLL; False once the process is dead and all that it sent has been taken."""
        dead = self._is_dead()
        events = selectors.EVENT_READ | (selectors.EVENT_WRITE if self._to_send else 0)
        with contextlib.suppress(KeyError):
            self._selector.modify(self._socket, events)
        came = False
        for key, event in self._selector.select(0.0 if dead else POLL):
            try:
                if key.fileobj is not self._socket:
                    data = os.read(self._output, 2**16)
                    self._words = (self._words + data)[-MOST_WORDS:]
                elif event & selectors.EVENT_READ:
                    data = self._socket.recv(2**20)
                    reader.feed(data)
                    came = bool(data)
                else:
                    sent = self._socket.send(self._to_send)
                    self._to_send, data = self._to_send[sent:], b"-"
                if not data:
                    self._selector.unregister(key.fileobj)
            except BlockingIOError:
                pass
            except OSError:  # the other end is gone
                self._selector.unregister(key.fileobj)
        if not dead and not self._selector.get_map():
            time.sleep(POLL)
        return came or not dead

    def _is_dead(self) -> bool:
        """Whether the process has ended; then also how, and how much memory it had [bytes]."""
        if self._status is None and self._process is not None:
            number, status, usage = os.wait4(self._process.pid, os.WNOHANG)
            if number:
                self._status = os.waitstatus_to_exitcode(status)
                self._taken = usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024)
                self._process.returncode = self._status
        return self._status is not None

    def _death(self) -> str:
        status = self._status or 0
        try:
            name = signal.Signals(-status).name if status < 0 else ""
        except ValueError:
            name = f"signal {-status}"
        text = f"crashed ({name})" if name else f"ended its process with exit code {status}"
        if self._taken > 0.8 * self.memory_limit:
            text += f" with {self._taken // 2**20} MiB of memory; {self.memory_limit // 2**20} MiB are allowed"
        return text

    def _end(self, *, graceful: bool) -> str:
        """End the process, with all that it has started; the last line that it printed."""
        process = self._process
        if process is None:
            return ""
        self._process = None
        self._selector.close()
        self._socket.close()
        deadline = time.monotonic() + (STOP_LIMIT if graceful else 0.0)
        while self._status is None and time.monotonic() < deadline:
            self._status = process.poll()
            time.sleep(0.005)
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
        if self._status is None:
            process.wait()
        _kill_marked(self._token)
        os.close(self._output)
        os.close(self._life)
        scratch.remove(self._folder)
        lines = [line for line in self._words.decode(errors="replace").splitlines() if line.strip()]
        return told(lines[-1])[:200] if lines else ""


def _checked(reader: Reader) -> tuple[dict[str, Any], Array] | None:
    try:
        return reader.next()
    except Forged as error:
        raise Ended(f"was ended: it sent what is {error}") from None


def _is_count(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**40


def _kill_marked(token: str) -> None:
    """Kill the processes that have inherited the mark: those that have left the group. Only where there is /proc."""
    wanted = f"{MARK}={token}".encode()
    for _ in range(20):  # a process may start another while it is looked for
        found = []
        for path in Path("/proc").glob("[0-9]*/environ"):
            with contextlib.suppress(OSError):
                if wanted in path.read_bytes().split(b"\0"):
                    found.append(int(path.parent.name))
        if not found:
            return
        for number in found:
            with contextlib.suppress(ProcessLookupError):
                os.kill(number, signal.SIGKILL)
        time.sleep(0.005)
