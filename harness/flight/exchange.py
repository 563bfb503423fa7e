"""The compiled loop of coupled FMUs: exchange at the communication points, step, record.

Variables are rows (component, value reference, kind) of a table; their values are in one row of doubles, in which Integers
and Booleans are exact, and Strings in rows of bytes beside it.
"""

import numpy as np

from harness.compiled import compiled
from harness.flight.calls import (
    DO_STEP,
    GET_BOOLEAN,
    GET_INTEGER,
    GET_REAL,
    GET_STRING,
    SET_BOOLEAN,
    SET_INTEGER,
    SET_REAL,
    SET_STRING,
    WARNING,
    byte_at,
    call_step,
    call_values,
)

KINDS = ("Real", "Integer", "Boolean", "String")
"""Kinds of variables by their number in a table; an Enumeration is an Integer (FMI 2.0, section 2.1.7)."""
REAL, STRING = 0, 3
SETTERS, GETTERS = (SET_REAL, SET_INTEGER, SET_BOOLEAN, SET_STRING), (GET_REAL, GET_INTEGER, GET_BOOLEAN, GET_STRING)
LONGEST = 4096
"""Bytes of a String that is passed on, the last 0 included."""
TOO_LONG = 1000
"""The status of a String that is longer, beside those of FMI."""
NOTHING, STEPPED, FED, SOURCE, TARGET, RECORDED = range(6)
"""What failed: nothing, a component's step, or setting or getting one of these variables."""


@compiled()
def _copied(address, text):  # type: ignore[no-untyped-def]
    """Copy the String at `address` (0: an empty one) to `text`; whether it fits."""
    for i in range(len(text)):
        text[i] = byte_at(address + i) if address else 0
        if text[i] == 0:
            return True
    return False


@compiled()
def _set(calls, components, variables, row, texts, scratch):  # type: ignore[no-untyped-def]
    """Set `variables` from `row` and `texts`; place of the one that failed, in CALLS the place of the call, and status."""
    reference, whole, pointer = scratch
    for j in range(len(variables)):
        k, reference[0], kind = variables[j, 0], variables[j, 1], variables[j, 2]
        if kind == REAL:
            at = row.ctypes.data + 8 * j
        elif kind == STRING:
            pointer[0] = texts.ctypes.data + j * texts.shape[1]
            at = pointer.ctypes.data
        else:
            whole[0] = np.int32(row[j])
            at = whole.ctypes.data
        call = SETTERS[kind]
        status = call_values(calls[k, call], components[k], reference.ctypes.data, 1, at)
        if status > WARNING:
            return j, call, status
    return 0, 0, 0


@compiled()
def _get(calls, components, variables, row, texts, scratch):  # type: ignore[no-untyped-def]
    """Get `variables` into `row` and `texts`; answers as _set."""
    reference, whole, pointer = scratch
    for j in range(len(variables)):
        k, reference[0], kind = variables[j, 0], variables[j, 1], variables[j, 2]
        at = row.ctypes.data + 8 * j
        if kind != REAL:
            at = pointer.ctypes.data if kind == STRING else whole.ctypes.data
        call = GETTERS[kind]
        status = call_values(calls[k, call], components[k], reference.ctypes.data, 1, at)
        if status > WARNING:
            return j, call, status
        if kind == STRING:
            if not _copied(pointer[0], texts[j]):
                return j, call, TOO_LONG
        elif kind != REAL:
            row[j] = whole[0]
    return 0, 0, 0


@compiled()
def start(calls, components, recorded, outputs):  # type: ignore[no-untyped-def]
    """Record the first point; what failed, its place, the call's place in CALLS, and its status; or NOTHING, 0, 0, 0."""
    scratch = np.empty(1, np.uint32), np.empty(1, np.int32), np.empty(1, np.intp)
    j, call, status = _get(calls, components, recorded, outputs[0], np.empty((0, 1), np.uint8), scratch)
    return (RECORDED, j, call, status) if status else (NOTHING, 0, 0, 0)


@compiled()
def advance(calls, components, times, span, spans, sources, targets, factors, fed, table, recorded, outputs):  # type: ignore[no-untyped-def]
    """Steps span[0] to span[1] - 1 between `times` [s], shape (n_steps + 1,); the step that failed, and then as `start`.

    Before component k steps, the connections from spans[k, 0] to spans[k, 1] - 1 are exchanged: first all values are got,
    then all are set.
    """
    n_links = len(factors)
    cell, nothing = np.empty(n_links), np.empty((0, 1), np.uint8)
    texts = np.empty((n_links, LONGEST if np.any(sources[:, 2] == STRING) else 1), np.uint8)
    scratch = np.empty(1, np.uint32), np.empty(1, np.int32), np.empty(1, np.intp)
    for n in range(span[0], span[1]):
        j, call, status = _set(calls, components, fed, table[n], nothing, scratch)
        if status:
            return n, FED, j, call, status
        for k in range(len(components)):
            first, last = spans[k, 0], spans[k, 1]
            row, text = cell[first:last], texts[first:last]
            j, call, status = _get(calls, components, sources[first:last], row, text, scratch)
            if status:
                return n, SOURCE, first + j, call, status
            for i in range(last - first):
                row[i] *= factors[first + i]
            j, call, status = _set(calls, components, targets[first:last], row, text, scratch)
            if status:
                return n, TARGET, first + j, call, status
            status = call_step(calls[k, DO_STEP], components[k], times[n], times[n + 1] - times[n], np.int32(1))
            if status > WARNING:
                return n, STEPPED, k, DO_STEP, status
        j, call, status = _get(calls, components, recorded, outputs[n + 1], nothing, scratch)
        if status:
            return n + 1, RECORDED, j, call, status
    return 0, NOTHING, 0, 0, 0
