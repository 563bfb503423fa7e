"""The twins: one fidelity a file, its states and its step, composed from the equations of `physics`.

The contract between a twin and whatever runs it (the native runtime's C, the pythonfmu slave, a test):

- `v`, float64, one place a variable of `ports.VARIABLES` (its value reference): the host writes inputs and parameters,
  the twin writes outputs and local variables.
- `x`, float64, `n_states` places: everything that the twin remembers, so that a copy of `v` and `x` is a copy of the
  twin. The host writes three things into it: `x[STALE] = 1.0` after a tunable parameter has changed, `x[SLOPE + i]`,
  the slope of input i over the coming step (per second; 0 holds the input), and, after `initialize`, `x[TOLERANCE]`, the
  relative tolerance of the experiment (0: none given).
- `initialize(v, x) -> status` starts the twin at time 0 from the parameters and inputs in `v` and writes the outputs.
- `advance(v, x, t) -> status` runs to time `t` in seconds since the start and writes the outputs. The inputs in `v` are
  those at the beginning of the step. Steps may have any length > 0; the twin keeps its own ticks.
- where the clock of a twin lies in `x` is told by `CLOCK`, so that a host can check a copy before it uses it.
- the status is 0, or an index into `STATUS`; after another status than 0 the twin is not to be advanced.

The functions are numba dispatchers that accept numpy arrays or, for the native runtime, `CPointer(float64)`; they
allocate nothing, call no library and run unchanged as plain Python with NUMBA_DISABLE_JIT=1.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..fidelities import FIDELITIES
from . import elf, hf, layout, lf
from .layout import SLOPE, STALE, STATUS, TOLERANCE

__all__ = ["CLOCK", "SLOPE", "STALE", "STATUS", "TOLERANCE", "TWINS", "Twin"]

CLOCK: dict[str, int] = {
    "step": layout.GRID,
    "per_period": layout.PER_PERIOD,
    "tick": layout.TICK,
    "offset": layout.OFFSET,
    "due": layout.DUE,
    "pending": layout.PENDING,
    "ramped": layout.RAMPED,
    "point": layout.POINT,
}
"""Place in `x` of each state of a twin's clock: its own step [s], how many make a controller period, whole ticks since the
start, time since then [s], three flags (0 or 1), the time of the last communication point [s]."""


@dataclass(frozen=True)
class Twin:
    """One fidelity: its kernels and what a reader needs to know of it."""

    name: str
    title: str
    n_states: int
    initialize: Callable[[Any, Any], int]
    advance: Callable[[Any, Any, float], int]
    tick: str = ""
    """The port that tells how long a tick of the clock is; empty: as long as the twin's own step."""


TWINS: dict[str, Twin] = {
    "HF": Twin(
        "HF",
        FIDELITIES["HF"].title,
        hf.N_STATES,
        hf.initialize,
        hf.advance,
        tick="controller.period",
    ),
    "ELF": Twin(
        "ELF",
        FIDELITIES["ELF"].title,
        elf.N_STATES,
        elf.initialize,
        elf.advance,
    ),
    "LF": Twin("LF", FIDELITIES["LF"].title, lf.N_STATES, lf.initialize, lf.advance),
}
