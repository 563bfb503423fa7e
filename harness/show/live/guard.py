"""Who may ask, and how often: hosts, origins, headers, sizes, one flight at a time for each client.

DNS rebinding: a page of others lets its own name point to this machine, and its script then asks us; the Host header still
bears that name. Sources: OWASP Cheat Sheets "Content Security Policy", "Cross-Site Request Forgery Prevention".
"""

import ipaddress
import re
import socket
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from http import HTTPStatus

from flask import Flask, Request, Response, request

from harness.show.live.refused import Refused

LONGEST_QUERY = 8192
"""Characters of a query."""
LARGEST_BODY = 5_000_000
"""Bytes of an upload; 100,000 rows of a trial take 2 to 4 MB."""
HOST = re.compile(r"(?P<name>\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+)(:[0-9]{1,5})?")
"""A Host header (RFC 9110, 7.2): two of them, which WSGI joins by a comma, are none."""
POLICY = "; ".join(
    [
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self' 'unsafe-inline'",  # Plotly writes the styles of its drawings into the page
        "img-src 'self' data: blob:",  # a figure becomes a PNG by way of a blob
        "connect-src 'self'",
        "form-action 'none'",
        "base-uri 'none'",
        "frame-ancestors 'none'",
    ]
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class Hosts:
    """The names by which the server may be called.

    Bound to this machine alone: its loopback names. Else also the address that it is bound to; bound to all addresses, this
    machine's name and any address, since a number cannot be rebound. `named`: further ones. The port is free: a tunnel has
    its own.
    """

    def __init__(self, bound: str, named: Iterable[str] = ()) -> None:
        own = _address(bound)
        self._any_address = own is not None and own.is_unspecified
        names = {bound, "localhost", "127.0.0.1", "::1", *named}
        self._names = {_plain(name) for name in (*names, *([socket.gethostname()] if self._any_address else []))}

    def trusts(self, host: str) -> bool:
        """Whether a Host header, with or without a port, is one of ours."""
        found = HOST.fullmatch(host)
        if not found:
            return False
        name = _plain(found["name"])
        return name in self._names or (self._any_address and _address(name) is not None)


def _plain(name: str) -> str:
    return name.strip("[]").rstrip(".").lower()


def _address(name: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(name)
    except ValueError:
        return None


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches a server that is bound to `host`."""
    own = _address(host)
    return own.is_loopback if own is not None else _plain(host) == "localhost"


class Turns:
    """One flight at a time for each client, and at most `most` clients that fly or wait."""

    def __init__(self, most: int = 8) -> None:
        self._most = most
        self._busy: set[str] = set()
        self._lock = threading.Lock()

    @contextmanager
    def turn(self, client: str) -> Iterator[None]:
        """The client's turn; Refused (429) if it has one already, Refused (503) if too many have."""
        with self._lock:
            if client in self._busy:
                line = "a flight of yours is under way; one at a time: ask again when it has landed"
                raise Refused(line, HTTPStatus.TOO_MANY_REQUESTS)
            if len(self._busy) >= self._most:
                line = f"{self._most} clients fly or wait already; ask again in a moment"
                raise Refused(line, HTTPStatus.SERVICE_UNAVAILABLE)
            self._busy.add(client)
        try:
            yield
        finally:
            with self._lock:
                self._busy.discard(client)


def protect(app: Flask, hosts: Hosts) -> None:
    """Let `app` refuse what is not from one of our own pages, or too large, and send HEADERS with every answer."""
    app.config["MAX_CONTENT_LENGTH"] = LARGEST_BODY

    @app.before_request
    def check() -> None:
        if not hosts.trusts(request.headers.get("Host", "")):
            line = "this Host is not served here; start ema serve with --allow-host NAME if NAME is yours"
            raise Refused(line, HTTPStatus.BAD_REQUEST)
        if len(request.query_string) > LONGEST_QUERY:
            line = f"the query has {len(request.query_string)} characters; {LONGEST_QUERY} are taken"
            raise Refused(line, HTTPStatus.REQUEST_URI_TOO_LONG)
        if request.path != "/" and _is_foreign(request):
            raise Refused("only this server's own page may ask for this", HTTPStatus.FORBIDDEN)

    @app.after_request
    def dress(answer: Response) -> Response:
        for name, value in HEADERS.items():
            answer.headers[name] = value
        answer.headers.setdefault("Cache-Control", "no-store")
        return answer


def _is_foreign(asked: Request) -> bool:
    """Whether a browser says that another site's page asks."""
    origin = asked.headers.get("Origin")
    if origin is not None and origin not in (f"http://{asked.headers['Host']}", f"https://{asked.headers['Host']}"):
        return True
    return asked.headers.get("Sec-Fetch-Site", "none") not in ("none", "same-origin")
