"""A user's mistake, told in one line: what is wrong, where, and what would be right."""

import difflib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager


class HarnessError(Exception):
    """Bad input, or an FMU that cannot be flown; the command line prints the message and exits with 2."""

    def _render_traceback_(self) -> list[str]:
        """What IPython shows of it: the message, as the command line does."""
        return [f"ema: {self}"]


MOST_LISTED = 24
"""Names that a message lists."""


def unknown(what: str, name: str, choices: Iterable[str], *, listed: str = "") -> HarnessError:
    """The error for an unknown name, with the nearest of `choices`; `what` is the kind of name.

    `listed`: what lists all of them; else they are in the message, at most MOST_LISTED.
    """
    known = list(choices)
    lowered = {choice.lower(): choice for choice in known}
    nearest = difflib.get_close_matches(name.lower(), lowered, n=1, cutoff=0.5)
    hint = f"did you mean {lowered[nearest[0]]}? " if nearest else ""
    if not listed or len(known) <= MOST_LISTED // 2:
        more = f", and {len(known) - MOST_LISTED} more" if len(known) > MOST_LISTED else ""
        listed = f"known: {', '.join(known[:MOST_LISTED])}{more}"
    return HarnessError(f"unknown {what} '{name}': {hint}{listed}")


@contextmanager
def required_extra(extra: str, what: str = "this command") -> Iterator[None]:
    """Turns a missing library into one line that names the extra which installs it; `what` needs it."""
    try:
        yield
    except ImportError as error:
        raise HarnessError(f"{what} needs {error.name}: pip install -e '.[{extra}]' in the checkout") from None
