"""Several FMUs as one system: outputs of one are inputs of another, exchanged at the communication points.

Jacobi: all FMUs step with what the others had at the last point. Gauss-Seidel: in the order given, each takes what those
before it have just reached. Either is of first order in the communication step. The loop is compiled, as the master's is.
"""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
import xarray as xr
from numba import njit
from numpy.typing import NDArray

from harness.errors import HarnessError
from harness.flight.component import Component
from harness.flight.master import CALLS, DO_STEP, GET_REAL, SET_REAL, STATUSES, WARNING, call_step, call_values, entry

Order = Literal["jacobi", "gauss-seidel"]
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Connection:
    """An output of one component that is an input of another, as COMPONENT.VARIABLE, times `factor`."""

    source: str
    target: str
    factor: float = 1.0


@dataclass(frozen=True)
class System:
    """FMU files by component name, in the order of Gauss-Seidel; connections of Real variables; parameters and start
    values by COMPONENT.VARIABLE."""

    components: Mapping[str, Path]
    connections: Sequence[Connection]
    parameters: Mapping[str, float] = field(default_factory=dict)


@njit(cache=True)
def _exchange(calls, components, links, factors, target, cell, whole):  # type: ignore[no-untyped-def]
    """The connections to `target` (-1: all): first all values, then all sets; call and status of a bad call, or 0, 0."""
    for j in range(len(links)):
        if target < 0 or links[j, 2] == target:
            source = links[j, 0]
            whole[0] = links[j, 1]
            at = cell.ctypes.data + 8 * j
            status = call_values(calls[source, GET_REAL], components[source], whole.ctypes.data, 1, at)
            if status > WARNING:
                return GET_REAL, status
            cell[j] *= factors[j]
    for j in range(len(links)):
        if target < 0 or links[j, 2] == target:
            whole[0] = links[j, 3]
            at = cell.ctypes.data + 8 * j
            status = call_values(calls[links[j, 2], SET_REAL], components[links[j, 2]], whole.ctypes.data, 1, at)
            if status > WARNING:
                return SET_REAL, status
    return 0, 0


@njit(cache=True)
def _note(calls, components, watched, row, whole):  # type: ignore[no-untyped-def]
    """The recorded variables into `row`; call and status of a bad call, or 0, 0."""
    for j in range(len(watched)):
        whole[0] = watched[j, 1]
        at = row.ctypes.data + 8 * j
        status = call_values(calls[watched[j, 0], GET_REAL], components[watched[j, 0]], whole.ctypes.data, 1, at)
        if status > WARNING:
            return GET_REAL, status
    return 0, 0


@njit(cache=True)
def _loop(calls, components, step, jacobi, links, factors, fed, table, watched, outputs):  # type: ignore[no-untyped-def]
    """All steps; component, step, place in CALLS and status of a bad call, or -1, 0, 0, 0."""
    cell, whole, value = np.empty(len(links) + 1), np.empty(1, np.uint32), np.empty(1)
    call, status = _note(calls, components, watched, outputs[0], whole)
    if status > WARNING:
        return 0, 0, call, status
    for n in range(len(outputs) - 1):
        for j in range(len(fed)):
            whole[0], value[0] = fed[j, 1], table[n, j]
            k = fed[j, 0]
            status = call_values(calls[k, SET_REAL], components[k], whole.ctypes.data, 1, value.ctypes.data)
            if status > WARNING:
                return k, n, SET_REAL, status
        if jacobi:
            call, status = _exchange(calls, components, links, factors, -1, cell, whole)
            if status > WARNING:
                return 0, n, call, status
        at, end = n * step, (n + 1) * step
        for k in range(len(components)):
            if not jacobi:
                call, status = _exchange(calls, components, links, factors, k, cell, whole)
                if status > WARNING:
                    return k, n, call, status
            status = call_step(calls[k, DO_STEP], components[k], at, end - at, np.int32(1))
            if status > WARNING:
                return k, n, DO_STEP, status
        call, status = _note(calls, components, watched, outputs[n + 1], whole)
        if status > WARNING:
            return 0, n, call, status
    return -1, 0, 0, 0


def fly(
    system: System,
    *,
    stop: float,
    step: float,
    inputs: Mapping[str, Array] | None = None,
    record: Sequence[str] = (),
    order: Order = "jacobi",
) -> xr.Dataset:
    """Fly the system from 0 to `stop` [s] with communication steps of `step` [s].

    `inputs`: COMPONENT.VARIABLE -> values at the points n*step, held from each on. `record`: the COMPONENT.VARIABLE that
    the dataset holds over time [s]. HarnessError for an unknown name, or if an FMU refuses something.
    """
    if order not in ("jacobi", "gauss-seidel"):
        raise HarnessError(f"order {order}: jacobi or gauss-seidel is needed")
    n_steps = round(stop / step)
    given = dict(inputs or {})
    for name, series in given.items():
        if len(series) < n_steps:
            raise HarnessError(f"{name}: {len(series)} values are given, {n_steps} are needed")
    with ExitStack() as stack:
        opened = {name: stack.enter_context(Component(path)) for name, path in system.components.items()}
        names = list(opened)

        def place(name: str) -> tuple[int, int]:
            component, dot, variable = name.partition(".")
            if not dot or component not in opened:
                raise HarnessError(f"{name}: COMPONENT.VARIABLE is needed, with a component of {', '.join(names)}")
            return names.index(component), opened[component].reference(variable)

        links = np.array([place(c.source) + place(c.target) for c in system.connections], dtype=np.int64).reshape(-1, 4)
        factors = np.array([connection.factor for connection in system.connections], dtype=np.float64)
        fed = np.array([place(name) for name in given], dtype=np.int64).reshape(-1, 2)
        watched = np.array([place(name) for name in record], dtype=np.int64).reshape(-1, 2)
        starts: dict[str, dict[str, float]] = {name: {} for name in names}
        for name, value in system.parameters.items():
            component, _, variable = name.partition(".")
            if component not in starts:
                raise HarnessError(f"{name}: COMPONENT.VARIABLE is needed, with a component of {', '.join(names)}")
            starts[component][variable] = value
        slaves = [opened[name].begin(starts[name], {}) for name in names]
        calls = np.array([[entry(slave, call) for call in CALLS] for slave in slaves], dtype=np.intp)
        components = np.array([slave.component for slave in slaves], dtype=np.intp)
        table = np.column_stack([series[:n_steps] for series in given.values()]) if given else np.empty((n_steps, 0))
        outputs = np.full((n_steps + 1, len(record)), np.nan)
        bad, at, call, status = _loop(
            calls, components, step, order == "jacobi", links, factors, fed, table, watched, outputs
        )  # fmt: skip
        if bad >= 0:
            told = opened[names[bad]].told() or f"{CALLS[call]} returned {STATUSES[min(status, 5)]}"
            raise HarnessError(f"{names[bad]}, at {at * step:g} s: {told}")
    data = {name: ("time", outputs[:, column]) for column, name in enumerate(record)}
    return xr.Dataset(data, coords={"time": ("time", np.arange(n_steps + 1) * step, {"units": "s"})})
