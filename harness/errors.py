"""A user's mistake, told in one line: what is wrong, where, and what would be right."""

import difflib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager


class HarnessError(Exception):
    """Bad input, or an FMU that cannot be flown; the command line prints the message and exits with 2."""


def unknown(what: str, name: str, choices: Iterable[str]) -> HarnessError:
    """The error for an unknown name, with the nearest of `choices`; `what` is the kind of name."""
    known = list(choices)
    lowered = {choice.lower(): choice for choice in known}
    nearest = difflib.get_close_matches(name.lower(), lowered, n=1, cutoff=0.5)
    hint = f"did you mean {lowered[nearest[0]]}? " if nearest else ""
    listed = f"known: {', '.join(known)}" if len(known) <= 12 else "'ema ports' lists all"
    return HarnessError(f"unknown {what} '{name}': {hint}{listed}")


@contextmanager
def required_extra(extra: str, what: str = "this command") -> Iterator[None]:
    """Turns a missing library into one line that names the extra which installs it; `what` needs it."""
    try:
        yield
    except ImportError as error:
        raise HarnessError(f"{what} needs {error.name}: pip install 'ema-twins[{extra}]'") from None
