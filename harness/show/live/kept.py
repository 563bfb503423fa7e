"""Uploads: trials and actuators of a user's own, kept in memory, the latest few, and read in a folder of their own."""

import hashlib
import re
import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path
from typing import TypeVar

from harness import scratch
from harness.actuators.actuator import Actuator
from harness.actuators.tomlfile import read_actuator_toml
from harness.errors import HarnessError
from harness.logs.mapping import check_layout
from harness.logs.trialfile import read_trial
from harness.show.live.guard import LARGEST_BODY
from harness.show.live.refused import Refused
from harness.trials import Trial

MOST_KEPT = 16
"""Uploads that are kept; the one that was asked for longest ago gives way."""
LONGEST = 10.0
"""A trial that is flown here [s]; `ema run --trial-file` flies longer ones."""
MOST_LINES = 200_000


@dataclass(frozen=True)
class Kind:
    """What may be uploaded: the suffix that it is given, and the most bytes of a file and of a line of it."""

    suffix: str
    text: str
    largest: int
    longest_line: int


KINDS = {
    "trial": Kind(".csv", "columns, such as CSV; ema run --trial-file reads other formats", LARGEST_BODY, 1000),
    "actuator": Kind(".toml", "TOML", 100_000, 4000),
}
MARK = "@"
"""Between the name of an upload and its digest; no built-in name has it."""
Read = TypeVar("Read")
CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1f]")


@dataclass(frozen=True)
class Upload:
    """A file as it came; `kind` is "trial" or "actuator", `name` a plain file name."""

    kind: str
    name: str
    data: bytes

    @property
    def token(self) -> str:
        """By which the page asks for it."""
        return f"{self.name}{MARK}{hashlib.sha256(self.data).hexdigest()[:16]}"


def upload(kind: str, name: str, data: bytes) -> Upload:
    """The upload; Refused for an unknown kind, what is no text, or a file that is too large to be read here."""
    if kind not in KINDS:
        raise Refused(f"kind={kind[:20]}: trial or actuator is needed")
    stem = re.sub(r"[^A-Za-z0-9_-]+", "_", re.split(r"[/\\]", name)[-1].rpartition(".")[0])[:60].strip("_") or "mine"
    limits = KINDS[kind]
    plain = f"{stem}{limits.suffix}"
    if CONTROL.search(data) or not data.strip():
        raise Refused(f"{plain}: is no text of {limits.text}", HTTPStatus.UNSUPPORTED_MEDIA_TYPE)
    if len(data) > limits.largest:
        raise Refused(f"{plain}: at most {limits.largest} bytes are taken", HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
    lines = data.splitlines()
    if len(lines) > MOST_LINES:
        raise Refused(f"{plain}: has {len(lines)} lines; at most {MOST_LINES} are taken")
    longest = max(map(len, lines))
    if longest > limits.longest_line:
        raise Refused(f"{plain}: a line has {longest} bytes; at most {limits.longest_line} are taken")
    return Upload(kind, plain, data)


class Kept:
    """The latest uploads, and what was read of them."""

    def __init__(self) -> None:
        self._uploads: OrderedDict[str, Upload] = OrderedDict()
        self._trials: OrderedDict[tuple[str, str], Trial] = OrderedDict()
        self._lock = threading.Lock()

    def keep(self, new: Upload) -> str:
        """Keep it; returns its token."""
        with self._lock:
            self._uploads[new.token] = new
            self._uploads.move_to_end(new.token)
            while len(self._uploads) > MOST_KEPT:
                self._uploads.popitem(last=False)
        return new.token

    def named(self, kind: str) -> dict[str, str]:
        """Token -> name of the uploads of this kind."""
        with self._lock:
            return {token: found.name for token, found in self._uploads.items() if found.kind == kind}

    def get(self, kind: str, token: str) -> Upload:
        """The upload; Refused (410) if it is not kept any more."""
        with self._lock:
            found = self._uploads.get(token)
            if found is None or found.kind != kind:
                name = token.partition(MARK)[0]
                raise Refused(f"{kind} {name}: is not kept here any more; choose the file again", HTTPStatus.GONE)
            self._uploads.move_to_end(token)
            return found

    def trial(self, token: str, actuator: Actuator) -> Trial:
        """The trial, in the units outside of `actuator`; HarnessError as from `read_trial`, or if it lasts too long."""
        key = (token, f"{actuator.sha256}{sorted(actuator.log.items())}")
        with self._lock:
            found = self._trials.get(key)
        return found or self.read_trial(self.get("trial", token), actuator)

    def read_trial(self, given: Upload, actuator: Actuator) -> Trial:
        """As `trial`, of an upload that need not be kept."""
        trial = _read(given, lambda path: read_trial(path, actuator.output, None, actuator.log, longest=LONGEST))
        with self._lock:
            self._trials[given.token, f"{actuator.sha256}{sorted(actuator.log.items())}"] = trial
            while len(self._trials) > MOST_KEPT // 4:
                self._trials.popitem(last=False)
        return trial

    def actuator(self, token: str) -> Actuator:
        """The actuator; HarnessError as from `read_actuator`."""
        return read_actuator(self.get("actuator", token))


def read_actuator(given: Upload) -> Actuator:
    """The actuator of an upload; HarnessError as from the command line."""

    def read(path: Path) -> Actuator:
        actuator = read_actuator_toml(path)
        check_layout(actuator.log, actuator.output, f"{given.name}, [log]")
        return actuator

    return _read(given, read)


def _read(given: Upload, read: Callable[[Path], Read]) -> Read:
    """What `read` makes of the upload as a file; a refusal names the file as the user does."""
    with scratch.folder("serve") as folder:
        path = folder / given.name
        path.write_bytes(given.data)
        try:
            return read(path)
        except HarnessError as error:
            raise Refused(str(error).replace(f"{folder}/", "")) from None
