"""What the commands show on a terminal: tables on stdout, progress on stderr."""

import os
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress

WIDE = 220
"""Characters a line of what is no terminal: a file or a pipe folds nothing."""


def show(
    caption: str, heads: Sequence[str], rows: Iterable[Sequence[str]], *, words: Collection[str] = (), wide: int = WIDE
) -> None:
    """Print a table of plain texts; columns of figures stand to the right, the first and those named in `words` to the left.

    The first, of names, is not folded where the others can be. An empty row draws a line. `wide`: characters a line, where
    no terminal says how many.
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    shown = Table(title=Text(caption))
    for place, head in enumerate(heads):
        left = place == 0 or head in words
        shown.add_column(Text(head), justify="left" if left else "right", overflow="fold", no_wrap=place == 0)
    for row in rows:
        if row:
            shown.add_row(*map(Text, row))
        else:
            shown.add_section()
    Console(width=None if sys.stdout.isatty() or "COLUMNS" in os.environ else wide).print(shown)


@contextmanager
def working() -> "Iterator[Callable[[str], None]]":
    """A spinner beside what is being done, which the function it yields is told; nothing is left behind."""
    from rich.console import Console
    from rich.text import Text

    with Console(stderr=True).status("reading") as status:
        yield lambda text: status.update(Text(text))


def progress() -> "Progress":
    """A bar with counts and the time left; a context manager that leaves nothing behind."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(*columns, console=Console(stderr=True), transient=True)
