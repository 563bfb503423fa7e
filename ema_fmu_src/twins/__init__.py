"""The twins: one fidelity a file, its states and its step, composed from the equations of `physics`.

The contract between a twin and whatever runs it (the native runtime's C, the pythonfmu slave, a test):

- `v`, float64, one place a variable of `ports.VARIABLES` (its value reference): the host writes inputs and parameters,
  the twin writes outputs and local variables.
- `x`, float64, `n_states` places: everything that the twin remembers, so that a copy of `v` and `x` is a copy of the
  twin. The host writes three things into it: `x[STALE] = 1.0` after a tunable parameter has changed, `x[SLOPES[NAME]]`,
  the slope of the input NAME over the coming step (per second; 0 holds the input), and, after `initialize`, `x[TOLERANCE]`,
  the relative tolerance of the experiment (0: none given).
- `initialize(v, x) -> Status` starts the twin at time 0 from the parameters and inputs in `v` and writes the outputs.
- `advance(v, x, t) -> Status` runs to time `t` in seconds since the start and writes the outputs. The inputs in `v` are
  those at the beginning of the step. Steps may have any length > 0; the twin keeps its own ticks.
- where the clock of a twin lies in `x` is told by `CLOCK`, so that a host can check a copy before it uses it.
- after another status than OK the twin is not to be advanced.

The functions are numba dispatchers that accept numpy arrays or, for the native runtime, `CPointer(float64)`; they
allocate nothing, call no library and run unchanged as plain Python with NUMBA_DISABLE_JIT=1.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from ..fidelities import FIDELITIES, MODELS
from . import host
from .host import SLOPES, clock, partial, told
from .status import Status

__all__ = ["CLOCK", "SLOPES", "STALE", "TOLERANCE", "TWINS", "Status", "Twin"]

STALE: int = told.stale
TOLERANCE: int = told.tolerance
CLOCK: dict[str, int] = {
    **{state.name: getattr(clock, state.name) for state in host.CLOCK},
    "pending": partial.pending,
    "ramped": partial.ramped,
}
"""Place in `x` of each state of a twin's clock (twins/host.py), and of two flags (0 or 1) of its last partial step."""


@dataclass(frozen=True)
class Twin:
    """One fidelity: its kernels and what a reader needs to know of it."""

    name: str
    title: str
    n_states: int
    initialize: Callable[[Any, Any], Status]
    advance: Callable[[Any, Any, float], Status]
    tick: str
    """The port that tells how long a tick of the clock is; empty: as long as the twin's own step."""


def _twin(name: str) -> Twin:
    """The model `name`, from the module of that name."""
    module = import_module(f".{name.lower()}", __package__)
    return Twin(name, FIDELITIES[name].title, len(module.STATES), module.initialize, module.advance, module.TICK)


TWINS: dict[str, Twin] = {name: _twin(name) for name in MODELS}
