"""The co-simulation master: one FMU through the communication points of a table, in compiled code.

The loop calls the FMI functions of the library that FMPy has loaded, through their addresses; numba compiles it once and
keeps the machine code between processes. Any FMI 2.0 co-simulation FMU will do. A call costs what the FMU takes and some
nanoseconds (`ema bench`), against 3 to 4 us through FMPy's own loop.
"""

import ctypes
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray

POINTS_A_NOTICE = 5000
"""Communication points between two calls of the progress callback."""
CALLS = ("fmi2SetReal", "fmi2SetRealInputDerivatives", "fmi2SetInteger", "fmi2SetBoolean", "fmi2DoStep",
         "fmi2GetReal", "fmi2GetInteger", "fmi2GetBoolean")  # fmt: skip
SET_REAL, SET_SLOPE, SET_INTEGER, SET_BOOLEAN, DO_STEP, GET_REAL, GET_INTEGER, GET_BOOLEAN = range(len(CALLS))
STATUSES = ("fmi2OK", "fmi2Warning", "fmi2Discard", "fmi2Error", "fmi2Fatal", "fmi2Pending")
WARNING, NO_STEP = 1, -2


class StepFailed(Exception):
    """An FMI call returned a status worse than a warning: which call, when, and what was computed until then."""

    def __init__(self, call: str, at: float, status: int, outputs: NDArray[np.float64]) -> None:
        name = STATUSES[status] if 0 <= status < len(STATUSES) else f"status {status}"
        super().__init__(f"{call} at {at:.9g} s returned {name}")
        self.call, self.at, self.status, self.outputs = call, at, status, outputs


class Stopped(KeyboardInterrupt):
    """A callback has raised KeyboardInterrupt; `outputs` holds what was computed until then."""

    def __init__(self, outputs: NDArray[np.float64]) -> None:
        super().__init__(f"stopped after {len(outputs) - 1} steps")
        self.outputs = outputs


@dataclass(frozen=True)
class References:
    """Value references by type, in the order of the table's columns: first the Reals, then Integers, then Booleans."""

    real: Sequence[int] = ()
    integer: Sequence[int] = ()
    boolean: Sequence[int] = ()

    def arrays(self) -> tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.uint32]]:
        real, integer, boolean = (np.array(part, dtype=np.uint32) for part in (self.real, self.integer, self.boolean))
        return real, integer, boolean

    def __len__(self) -> int:
        return len(self.real) + len(self.integer) + len(self.boolean)


@dataclass(frozen=True)
class Stimuli:
    """What the FMU is given: `table`, shape (n_steps + 1, len(references)), row n from start + n*step on.

    Columns whose place is in `ramps` (Reals only) move linearly to the next row within a step, by
    fmi2SetRealInputDerivatives; the others are held.
    """

    references: References
    table: NDArray[np.float64]
    ramps: Sequence[int] = field(default_factory=tuple)


def _call(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    """Code of a call through the address `values[0]`: an `int` function in C of the arguments that follow."""
    kinds = {types.intp: ir.IntType(64), types.float64: ir.DoubleType(), types.int32: ir.IntType(32)}
    function = ir.FunctionType(ir.IntType(32), [kinds[argument] for argument in signature.args[1:]])
    return builder.call(builder.inttoptr(values[0], function.as_pointer()), values[1:])


@intrinsic
def call_values(typing_context, address, component, references, n, values):  # type: ignore[no-untyped-def]
    """fmi2Set<Type> and fmi2Get<Type>(component, references, n, values)."""
    return types.int32(types.intp, types.intp, types.intp, types.intp, types.intp), _call


@intrinsic
def call_slopes(typing_context, address, component, references, n, orders, values):  # type: ignore[no-untyped-def]
    """fmi2SetRealInputDerivatives(component, references, n, orders, values)."""
    return types.int32(types.intp, types.intp, types.intp, types.intp, types.intp, types.intp), _call


@intrinsic
def call_step(typing_context, address, component, time, size, no_set_state_prior):  # type: ignore[no-untyped-def]
    """fmi2DoStep(component, currentCommunicationPoint, communicationStepSize, noSetFMUStatePriorToCurrentPoint)."""
    return types.int32(types.intp, types.intp, types.float64, types.float64, types.int32), _call


@njit(cache=True)
def _set_others(calls, component, n, places, row, wholes, whole_data):  # type: ignore[no-untyped-def]
    """Integer and Boolean inputs from `row`; place in CALLS and status of a bad call, or 0, 0."""
    for kind, call in ((1, SET_INTEGER), (2, SET_BOOLEAN)):
        if n[kind]:
            first = n[0] + (n[1] if kind == 2 else 0)
            for i in range(n[kind]):
                wholes[i] = int(row[first + i])
            status = call_values(calls[call], component, places[kind], n[kind], whole_data)
            if status > WARNING:
                return call, status
    return 0, 0


@njit(cache=True)
def _get_others(calls, component, n, places, row, wholes, whole_data):  # type: ignore[no-untyped-def]
    """Integer and Boolean outputs into `row`; place in CALLS and status of a bad call, or 0, 0."""
    for kind, call in ((1, GET_INTEGER), (2, GET_BOOLEAN)):
        if n[kind]:
            status = call_values(calls[call], component, places[kind], n[kind], whole_data)
            if status > WARNING:
                return call, status
            first = n[0] + (n[1] if kind == 2 else 0)
            for i in range(n[kind]):
                row[first + i] = wholes[i]
    return 0, 0


@njit(cache=True)
def _loop(calls, component, start, step, span, given, wanted, places, ramps, table, outputs):  # type: ignore[no-untyped-def]
    """Steps span[0] to span[1] - 1; the step at which a call went wrong, its place in CALLS, its status; or -1, 0, 0.

    `given`, `wanted`: numbers of Real, Integer, Boolean inputs and outputs; `places`: addresses of their value references.
    Reals lie first in a row: the FMU reads and writes them in `table` and `outputs` themselves, without a copy.
    `ramps`: columns and value references of the inputs that ramp. Steps before 0 only get the outputs.
    """
    wholes = np.empty(table.shape[1] + outputs.shape[1], np.int32)
    columns, references = ramps
    orders, slopes = np.ones(len(columns), np.int32), np.empty(len(columns))
    slope_at, order_at, reference_at = slopes.ctypes.data, orders.ctypes.data, references.ctypes.data
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
    wanted: References,
    on_progress: Callable[[int], None] | None = None,
    into: NDArray[np.float64] | None = None,
) -> tuple[NDArray[np.float64], float]:
    """Set inputs, do a step, get outputs, from point to point; the slave has just left initialization mode.

    `slave` is FMPy's FMU2Slave. Communication points are start + n*step [s]. Returns the outputs, shape
    (n_steps + 1, len(wanted)), and the wall time of the loop [s]. `on_progress(points)` is called now and then.
    `into`, of that shape, is filled and returned instead of a new array: where many runs follow one another and memory goes
    back to the system after each (as Dask's workers do), that saves a quarter of a run of ELF+.
    StepFailed at the first status worse than a warning, Stopped if `on_progress` raises KeyboardInterrupt: both hold the
    outputs until then.
    """
    table = np.ascontiguousarray(stimuli.table, dtype=np.float64)
    n_steps = len(table) - 1
    outputs = np.empty((n_steps + 1, len(wanted))) if into is None else into
    if outputs.shape != (n_steps + 1, len(wanted)) or not outputs.flags.c_contiguous:
        raise ValueError(f"into: shape {(n_steps + 1, len(wanted))} in C order is needed, not {outputs.shape}")
    if into is None:
        outputs.fill(np.nan)  # touched: page faults would cost as much as the FMU
    calls = tuple(entry(slave, name) for name in CALLS)
    component = int(ctypes.cast(slave.component, ctypes.c_void_p).value or 0)
    given, got = stimuli.references.arrays(), wanted.arrays()
    sizes = tuple(tuple(len(part) for part in parts) for parts in (given, got))
    places = tuple(tuple(part.ctypes.data for part in parts) for parts in (given, got))
    columns = np.array(stimuli.ramps, dtype=np.intp)
    ramps = (columns, given[0][columns])

    def fly(first: int, last: int) -> None:
        where = (*sizes, places, ramps, table, outputs)
        bad, call, status = _loop(calls, component, start, step, (first, last), *where)  # type: ignore[call-arg]
        if bad != NO_STEP:
            raise StepFailed(CALLS[call], start + max(bad, 0) * step, status, outputs[: bad + 1])

    fly(0, 0)  # load or compile the loop before the clock starts
    fly(-1, 0)
    wall = 0.0
    for done in range(0, n_steps, POINTS_A_NOTICE):
        until = min(done + POINTS_A_NOTICE, n_steps)
        began = time.perf_counter()
        fly(done, until)
        wall += time.perf_counter() - began
        if on_progress:
            try:
                on_progress(until - done)
            except KeyboardInterrupt:
                raise Stopped(outputs[: until + 1]) from None
    return outputs, wall


def entry(slave: Any, name: str) -> int:
    """Address of a function of the slave's library; 0 if it has none."""
    try:
        return int(ctypes.cast(getattr(slave.dll, name), ctypes.c_void_p).value or 0)
    except AttributeError:
        return 0
