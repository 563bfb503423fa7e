"""Other simulators of such a drive, where they are installed: how long they take for a simulated second.

They compute other things than the twins do, which the table says; a comparison of times, not of results.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec


@dataclass(frozen=True)
class Peer:
    """One peer: wall time per simulated second [s], 0 where it is not installed; what it computes and what it does not."""

    name: str
    wall: float
    computes: str
    lacks: str


def measure() -> list[Peer]:
    """Every peer of PEERS, those that are not installed with a word on it."""
    found = []
    for name, (module, run, computes, lacks) in PEERS.items():
        if find_spec(module) is None:
            found.append(Peer(name, 0.0, computes, f"not installed: pip install 'ema-twins[bench]' ({module})"))
        else:
            found.append(Peer(name, run(), computes, lacks))
    return found


PEERS: dict[str, tuple[str, Callable[[], float], str, str]] = {}
"""Name -> module, what runs it, what it computes, what it does not."""
