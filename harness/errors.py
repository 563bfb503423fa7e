"""A user's mistake, told in one line: what is wrong, where, and what would be right."""

import difflib
from collections.abc import Iterable


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
