"""The server: the app on a host and a port."""

import socket
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from werkzeug.serving import ThreadedWSGIServer, WSGIRequestHandler

from harness.actuators.actuator import DEFAULT, Actuator
from harness.errors import HarnessError
from harness.flight.isolate import TIME_LIMIT
from harness.show.live.app import app
from harness.show.live.fleet import Fleet
from harness.show.live.guard import Hosts
from harness.show.live.kept import Kept
from harness.show.live.wish import Hangar

MOST_CONNECTIONS = 32
"""Open at the same time; a further one is closed at once."""
SILENCE = 15.0
"""After which a client that says or takes nothing more is hung up on [s]."""


class _Handler(WSGIRequestHandler):
    timeout = SILENCE

    def version_string(self) -> str:
        return "EMA twins"


class _Listener(ThreadedWSGIServer):
    """Threads, no more than MOST_CONNECTIONS."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._free = threading.BoundedSemaphore(MOST_CONNECTIONS)

    def process_request(self, request: Any, client_address: Any) -> None:
        if self._free.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()


class Server:
    """The app on a host and port, flying `actuator`, which the command line calls `named`.

    `hosts`: further names by which it may be called. HarnessError if the port cannot be had; port 0 takes a free one.
    """

    def __init__(
        self,
        fmus: Path,
        *,
        host: str,
        port: int,
        actuator: Actuator = DEFAULT,
        named: str | None = None,
        hosts: Iterable[str] = (),
        time_limit: float = TIME_LIMIT,
    ) -> None:
        self.fleet = Fleet(fmus, time_limit=time_limit)
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            self._socket = socket.create_server((host, port), family=family)
        except (OSError, OverflowError, ValueError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            raise HarnessError(f"--host {host} --port {port}: cannot be had: {reason}; another --port may be free") from None
        number = self._socket.getsockname()[1]
        self.url = f"http://[{host}]:{number}/" if family == socket.AF_INET6 else f"http://{host}:{number}/"
        hangar = Hangar(actuator, named, Kept())
        self.app = app(self.fleet, hangar, Hosts(host, hosts))
        self._server = _Listener(host, number, self.app, _Handler, fd=self._socket.fileno())

    def run(self) -> None:
        """Serve until `stop` or an interrupt."""
        try:
            self._server.serve_forever()
        finally:
            self.close()

    def stop(self) -> None:
        """End `run`, from another thread."""
        self._server.shutdown()

    def close(self) -> None:
        """Give up the port and the FMUs."""
        self._server.server_close()
        self._socket.close()
        self.fleet.close()
