"""A request that is refused: one line, and the HTTP status that goes with it."""

from http import HTTPStatus

from harness.errors import HarnessError


class Refused(HarnessError):
    """What is wrong with a request, in one line; `status` is that of the answer."""

    def __init__(self, line: str, status: HTTPStatus = HTTPStatus.BAD_REQUEST) -> None:
        super().__init__(line)
        self.status = status
