"""The co-simulation master: one FMU through the communication points of a table, in compiled code.

The loop calls the FMI functions of the library that FMPy has loaded, through their addresses; numba compiles it once and
keeps the machine code between processes. Any FMI 2.0 co-simulation FMU will do. A step costs what the FMU takes and some
nanoseconds (`ema bench`), against 3 to 4 us through FMPy's own loop.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harness.compiled import compiled
from harness.flight.calls import (
    CALLS,
    DO_STEP,
    GET_BOOLEAN,
    GET_INTEGER,
    GET_REAL,
    SET_BOOLEAN,
    SET_INTEGER,
    SET_REAL,
    SET_SLOPE,
    WARNING,
    addresses,
    call_slopes,
    call_step,
    call_values,
    instance_address,
    status_name,
)

POINTS_A_NOTICE = 5000
"""Most communication points between two calls of the progress callback."""
PATIENCE = 0.5
"""Most time between them [s], as far as the FMU lets; so a slow one can be stopped too."""
NO_STEP = -2
"""What the loop answers in the place of the step that failed where none has."""


class StepFailed(Exception):
    """An FMI call returned a status worse than a warning; the message says which call, when [s], and the status."""


@dataclass(frozen=True)
class ValueReferences:
    """Value references by type, in the order of a table's columns: first the Reals, then the Integers, then the Booleans."""

    real: Sequence[int] = ()
    integer: Sequence[int] = ()
    boolean: Sequence[int] = ()

    def arrays(self) -> tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.uint32]]:
        """Those of the Reals, the Integers and the Booleans, as the FMI functions take them."""
        real, integer, boolean = (np.array(part, dtype=np.uint32) for part in (self.real, self.integer, self.boolean))
        return real, integer, boolean

    def __len__(self) -> int:
        return len(self.real) + len(self.integer) + len(self.boolean)


@dataclass(frozen=True)
class Stimuli:
    """What the FMU is given: `table`, shape (n_steps + 1, len(inputs)), row n from start + n*step on.

    `inputs` are the variables of the columns. Columns whose place is in `ramps` (Reals only) move linearly to the next row
    within a step, by fmi2SetRealInputDerivatives; the others are held.
    """

    inputs: ValueReferences
    table: NDArray[np.float64]
    ramps: Sequence[int] = field(default_factory=tuple)


@dataclass(frozen=True)
class Recording:
    """What a run gave: `outputs`, shape (n_points, len(wanted)), and the wall time of the loop [s].

    `stopped`: the run was stopped before its end, and the points after that are missing.
    """

    outputs: NDArray[np.float64]
    wall: float
    stopped: bool


@compiled()
def _set_others(calls, component, n, places, row, wholes, whole_data):  # type: ignore[no-untyped-def]
    """Integer and Boolean inputs from `row`; place in CALLS and status of a call that failed, or 0, 0."""
    for kind, call in ((1, SET_INTEGER), (2, SET_BOOLEAN)):
        if n[kind]:
            first = n[0] + (n[1] if kind == 2 else 0)
            for i in range(n[kind]):
                wholes[i] = int(row[first + i])
            status = call_values(calls[call], component, places[kind], n[kind], whole_data)
            if status > WARNING:
                return call, status
    return 0, 0


@compiled()
def _get_others(calls, component, n, places, row, wholes, whole_data):  # type: ignore[no-untyped-def]
    """Integer and Boolean outputs into `row`; place in CALLS and status of a call that failed, or 0, 0."""
    for kind, call in ((1, GET_INTEGER), (2, GET_BOOLEAN)):
        if n[kind]:
            status = call_values(calls[call], component, places[kind], n[kind], whole_data)
            if status > WARNING:
                return call, status
            first = n[0] + (n[1] if kind == 2 else 0)
            for i in range(n[kind]):
                row[first + i] = wholes[i]
    return 0, 0


@compiled(nogil=True)
def _loop(calls, component, start, step, span, given, wanted, places, ramps, table, outputs):  # type: ignore[no-untyped-def]
    """Steps span[0] to span[1] - 1; the step at which a call failed, its place in CALLS, its status; or NO_STEP, 0, 0.

    `given`, `wanted`: numbers of Real, Integer, Boolean inputs and outputs; `places`: addresses of their value references.
    Reals come first in a row: the FMU reads and writes them in `table` and `outputs` themselves, without a copy.
    `ramps`: columns and value references of the inputs that ramp. Steps before 0 only get the outputs.
    """
    wholes = np.empty(table.shape[1] + outputs.shape[1], np.int32)
    columns, value_references = ramps
    orders, slopes = np.ones(len(columns), np.int32), np.empty(len(columns))
    slope_at, order_at, reference_at = slopes.ctypes.data, orders.ctypes.data, value_references.ctypes.data
    whole_at, input_at, output_at = wholes.ctypes.data, table.ctypes.data, outputs.ctypes.data
    input_stride, output_stride = 8 * table.shape[1], 8 * outputs.shape[1]
    for n in range(span[0], span[1]):
        if n >= 0:
            at, end = start + n * step, start + (n + 1) * step
            if given[0]:
                status = call_values(calls[SET_REAL], component, places[0][0], given[0], input_at + n * input_stride)
                if status > WARNING:
                    return n, SET_REAL, status
            if given[1] + given[2]:
                call, status = _set_others(calls, component, given, places[0], table[n], wholes, whole_at)
                if status > WARNING:
                    return n, call, status
            if len(columns):
                for i in range(len(columns)):
                    slopes[i] = (table[n + 1, columns[i]] - table[n, columns[i]]) / step
                status = call_slopes(calls[SET_SLOPE], component, reference_at, len(columns), order_at, slope_at)
                if status > WARNING:
                    return n, SET_SLOPE, status
            status = call_step(calls[DO_STEP], component, at, end - at, np.int32(1))
            if status > WARNING:
                return n, DO_STEP, status
        if wanted[0]:
            status = call_values(calls[GET_REAL], component, places[1][0], wanted[0], output_at + (n + 1) * output_stride)
            if status > WARNING:
                return n, GET_REAL, status
        if wanted[1] + wanted[2]:
            call, status = _get_others(calls, component, wanted, places[1], outputs[n + 1], wholes, whole_at)
            if status > WARNING:
                return n, call, status
    return NO_STEP, 0, 0


def run(
    slave: Any,
    *,
    start: float,
    step: float,
    stimuli: Stimuli,
    wanted: ValueReferences,
    on_progress: Callable[[int], object] | None = None,
    into: NDArray[np.float64] | None = None,
) -> Recording:
    """Set inputs, do a step, get outputs, from point to point; the slave has just left initialization mode.

    `slave` is FMPy's FMU2Slave. Communication points are start + n*step [s]. `on_progress(points)` is called every
    POINTS_A_NOTICE points or after PATIENCE; if it answers True, the run stops there. `into`, of shape (n_steps + 1,
    len(wanted)), is filled and returned instead of a new array: where many runs follow one another and memory goes back to
    the system after each (as Dask's workers do), that saves a quarter of a run of ELF+. StepFailed at the first status worse
    than a warning.
    """
    table = np.ascontiguousarray(stimuli.table, dtype=np.float64)
    n_steps = len(table) - 1
    outputs = np.empty((n_steps + 1, len(wanted))) if into is None else into
    if outputs.shape != (n_steps + 1, len(wanted)) or not outputs.flags.c_contiguous:
        raise ValueError(f"into: shape {(n_steps + 1, len(wanted))} in C order is needed, not {outputs.shape}")
    if into is None:
        outputs.fill(np.nan)  # touched: page faults would cost as much as the FMU
    calls, instance = addresses(slave), instance_address(slave)
    given, got = stimuli.inputs.arrays(), wanted.arrays()
    sizes = tuple(tuple(len(part) for part in parts) for parts in (given, got))
    places = tuple(tuple(part.ctypes.data for part in parts) for parts in (given, got))
    columns = np.array(stimuli.ramps, dtype=np.intp)
    ramps = (columns, given[0][columns])

    def fly(first: int, last: int) -> None:
        where = (*sizes, places, ramps, table, outputs)
        failed, call, status = _loop(calls, instance, start, step, (first, last), *where)  # type: ignore[call-arg]
        if failed != NO_STEP:
            at = start + max(failed, 0) * step
            raise StepFailed(f"{CALLS[call]} at {at:.9g} s returned {status_name(status)}")

    fly(0, 0)  # load or compile the loop before the clock starts
    fly(-1, 0)
    wall, done, told, stopped, chunk = 0.0, 0, 0, False, 64
    noticed = time.perf_counter()
    while done < n_steps and not stopped:
        until = min(done + chunk, told + POINTS_A_NOTICE, n_steps)
        began = time.perf_counter()
        fly(done, until)
        ended = time.perf_counter()
        wall += ended - began
        done = until
        chunk = (
            4 * chunk if ended - began < 0.1 * PATIENCE else max(1, chunk // 4) if ended - began > 0.5 * PATIENCE else chunk
        )
        if done in (told + POINTS_A_NOTICE, n_steps) or ended - noticed > PATIENCE:
            stopped = bool(on_progress and on_progress(done - told)) and done < n_steps
            told, noticed = done, time.perf_counter()
    return Recording(outputs[: done + 1], wall, stopped)
