"""Other simulators of such a drive, where they are installed: how long they take for a simulated second.

They compute other things than the twins do, which the table says: a comparison of times, not of results. Each gets the
twins' motor where it has such a motor, and a run that keeps it turning.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec

from harness.bench.peers import gem, motulator, progpy, scipy_hf


@dataclass(frozen=True)
class Peer:
    """One peer: wall time per simulated second [s], 0 where it is not installed; what it computes and what it does not."""

    name: str
    wall: float
    computes: str
    lacks: str


PEERS: tuple[tuple[str, str, Callable[[], float], str, str], ...] = (
    ("SciPy solve_ivp, HF's equations", "scipy", scipy_hf.run, scipy_hf.COMPUTES, scipy_hf.LACKS),
    ("motulator, 4 kHz carrier", "motulator", lambda: motulator.run(4e3), motulator.COMPUTES, motulator.LACKS),
    ("motulator, 10 kHz carrier", "motulator", lambda: motulator.run(10e3), motulator.COMPUTES, motulator.LACKS),
    ("gym-electric-motor, tau 1e-5 s", "gym_electric_motor", gem.run, gem.COMPUTES, gem.LACKS),
    ("progpy Powertrain, dt 1e-4 s", "progpy", progpy.run, progpy.COMPUTES, progpy.LACKS),
)
"""Name, module, what flies it and gives its wall time per simulated second, what it computes, what it does not."""


def measure() -> list[Peer]:
    """Every peer; those that are not installed with a word on how to get them."""
    found = []
    for name, module, run, computes, lacks in PEERS:
        if find_spec(module) is None:
            found.append(Peer(name, 0.0, computes, f"not installed ({module}): pip install -e '.[bench]' in the checkout"))
            continue
        found.append(Peer(name, run(), computes, lacks))
    return found
