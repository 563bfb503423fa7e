"""The co-simulation master: one FMU through the communication points of a trial."""

import ctypes
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

POINTS_A_NOTICE = 500
"""Communication points between two calls of the progress callback."""


def run(
    slave: Any,
    *,
    start: float,
    step: float,
    inputs: NDArray[np.float64],
    input_references: list[int],
    real_references: list[int],
    boolean_references: list[int],
    on_progress: Callable[[int], None] | None = None,
) -> tuple[NDArray[np.float64], float]:
    """Set inputs, do a step, get outputs, from point to point; the slave has just left initialization mode.

    `slave` is FMPy's FMU2Slave. `inputs` has shape (n_steps + 1, n_inputs), its row n held from start + n*step on.
    Returns the outputs, shape (n_steps + 1, n_real + n_boolean), and the wall time of the loop [s]. Raises whatever
    FMPy raises on a bad status.
    """
    n_steps = len(inputs) - 1
    n_real, n_boolean = len(real_references), len(boolean_references)
    outputs = np.empty((n_steps + 1, n_real + n_boolean))
    in_refs = (ctypes.c_uint32 * len(input_references))(*input_references)
    in_values = (ctypes.c_double * len(input_references))()
    in_array = np.ctypeslib.as_array(in_values)
    real_refs = (ctypes.c_uint32 * n_real)(*real_references)
    real_values = (ctypes.c_double * n_real)()
    real_array = np.ctypeslib.as_array(real_values)
    bool_refs = (ctypes.c_uint32 * n_boolean)(*boolean_references)
    bool_values = (ctypes.c_int * n_boolean)()
    component = slave.component

    def read(row: int) -> None:
        slave.fmi2GetReal(component, real_refs, n_real, real_values)
        outputs[row, :n_real] = real_array
        if n_boolean:
            slave.fmi2GetBoolean(component, bool_refs, n_boolean, bool_values)
            outputs[row, n_real:] = bool_values

    began = time.perf_counter()
    read(0)
    for n in range(n_steps):
        in_array[:] = inputs[n]
        slave.fmi2SetReal(component, in_refs, len(in_refs), in_values)
        slave.doStep(start + n * step, step)
        read(n + 1)
        if on_progress and (n + 1) % POINTS_A_NOTICE == 0:
            on_progress(POINTS_A_NOTICE)
    wall = time.perf_counter() - began
    if on_progress:
        on_progress(n_steps % POINTS_A_NOTICE)
    return outputs, wall
