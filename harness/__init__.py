"""Runs, compares and reports the twins, which it knows only as FMUs and by their ports.

For scripts and notebooks: `import harness as ema`, then `ema.fly("SIN", "HF", set={"fault.N_a": 0.9})` and the other names
of `__all__`. Each takes names and paths as texts, answers datasets or results that show themselves, and raises
`ema.HarnessError` with one clear line. They are imported when they are first asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from harness.errors import HarnessError

if TYPE_CHECKING:
    from harness.library.campaigns import Campaign, campaign
    from harness.library.flights import Compared, Flight, compare, fly
    from harness.library.measured import Calibrated, Identified, Replayed, calibrate, identify, replay

_PLACES = {
    "harness.library.campaigns": ("Campaign", "campaign"),
    "harness.library.flights": ("Compared", "Flight", "compare", "fly"),
    "harness.library.measured": ("Calibrated", "Identified", "Replayed", "calibrate", "identify", "replay"),
}
_HOME = {name: place for place, names in _PLACES.items() for name in names}

__all__ = [
    "Calibrated",
    "Campaign",
    "Compared",
    "Flight",
    "HarnessError",
    "Identified",
    "Replayed",
    "calibrate",
    "campaign",
    "compare",
    "fly",
    "identify",
    "replay",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {', '.join(__all__)}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
