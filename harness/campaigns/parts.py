"""How a campaign is cut up: chunks of the dataset into parts for workers, of about equal work, and parts put together."""

from collections.abc import Sequence
from dataclasses import dataclass

from harness.campaigns.batch import Batch, Result, blank
from harness.campaigns.plan import Table

WORK = 0.25
"""Seconds that a part should take: handing it out costs some ms, and at the end a core waits for about so long."""
SHARES = 2
"""A part is no more than this part of what each thread has left to do, so that all end at about the same time."""


@dataclass
class _Chunk:
    cases: range
    result: Result
    missing: int


class Parts:
    """The cases of the `waiting` chunks of the campaign `digest`, part by part.

    `shape`: numbers of outputs, times and features in a result; `threads`: how many fly at a time.
    """

    def __init__(
        self, digest: str, table: Table, waiting: Sequence[range], threads: int, shape: tuple[int, int, int]
    ) -> None:
        self._digest, self._table, self._threads, self._shape = digest, table, threads, shape
        self._left = sum(map(len, waiting))
        self._waiting = iter(waiting)
        self._rest = range(0)
        self._chunk_of: dict[int, _Chunk] = {}
        self._seconds: dict[int, float] = {}

    def take(self) -> Batch | None:
        """The next part, of one fidelity; None if there is no more."""
        if not self._rest:
            whole = next(self._waiting, None)
            if whole is None:
                return None
            self._rest = whole
            self._chunk_of |= dict.fromkeys(whole, _Chunk(whole, blank(len(whole), *self._shape), len(whole)))
        first, table = self._rest.start, self._table
        kind = int(table.fidelity[first])
        stop = min(self._rest.stop, first + self._size(kind))
        last = next((case for case in range(first, stop) if table.fidelity[case] != kind), stop)
        self._rest = range(last, self._rest.stop)
        self._left -= last - first
        rows = slice(first, last)
        return Batch(
            self._digest,
            tuple(range(first, last)),
            tuple(table.trial[rows].tolist()),
            tuple(table.fidelity[rows].tolist()),
            table.names,
            table.values[rows],
        )

    def put(self, part: Batch, result: Result) -> tuple[range, Result] | None:
        """Put the result of a part, or of a part of it, in its place; its chunk's cases and result, if that is now whole."""
        self._seconds[part.fidelity[0]] = max(result.fmu_seconds / len(part), 1e-9)
        chunk = self._chunk_of[part.cases[0]]
        for case in part.cases:
            del self._chunk_of[case]
        rows = slice(part.cases[0] - chunk.cases.start, part.cases[-1] + 1 - chunk.cases.start)
        chunk.result.values[rows], chunk.result.features[rows] = result.values, result.features
        chunk.result.failures[rows] = result.failures
        chunk.missing -= len(part)
        return None if chunk.missing else (chunk.cases, chunk.result)

    def _size(self, kind: int) -> int:
        """Cases in the next part: one, as long as it is not known what a case of this fidelity costs."""
        if kind not in self._seconds:
            return 1
        share = -(-self._left // (SHARES * self._threads))
        return max(1, min(share, int(WORK / self._seconds[kind])))
