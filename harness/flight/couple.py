"""Several FMUs as one system: outputs of one are inputs of another, exchanged at the communication points.

Jacobi: all FMUs step with what the others had at the last point. Gauss-Seidel: in the order given, each takes what those
before it have just reached. Either is of first order in the communication step. The loop is compiled, as the master's.
"""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from harness.compiled import compiled
from harness.errors import HarnessError
from harness.flight.calls import (
    CALLS,
    DO_STEP,
    GET_REAL,
    SET_REAL,
    WARNING,
    addresses,
    call_step,
    call_values,
    instance_address,
    status_name,
)
from harness.flight.component import Component

Order = Literal["jacobi", "gauss-seidel"]
Array = NDArray[np.float64]
NO_COMPONENT = -1
"""What the loop answers in the place of the component that failed where none has."""


@dataclass(frozen=True)
class Connection:
    """An output of one component that is an input of another, as COMPONENT.VARIABLE, times `factor`."""

    source: str
    target: str
    factor: float = 1.0


@dataclass(frozen=True)
class System:
    """FMU files by component name, in the order of Gauss-Seidel; connections of Real variables; parameters and start
    values by COMPONENT.VARIABLE, an Enumeration's by value or by the name of an item."""

    components: Mapping[str, Path]
    connections: Sequence[Connection]
    parameters: Mapping[str, float | str] = field(default_factory=dict)


@compiled()
def _transfer(calls, components, call, variables, row, value_reference):  # type: ignore[no-untyped-def]
    """GET_REAL into `row` or SET_REAL from it, a value for each of `variables`; answers as _loop, without the step."""
    for j in range(len(variables)):
        k, value_reference[0] = variables[j, 0], variables[j, 1]
        at = row.ctypes.data + 8 * j
        status = call_values(calls[k, call], components[k], value_reference.ctypes.data, 1, at)
        if status > WARNING:
            return k, call, status
    return NO_COMPONENT, 0, 0


@compiled()
def _exchange(calls, components, sources, targets, factors, cell, value_reference):  # type: ignore[no-untyped-def]
    """Along connections: first all values, then all sets; answers as _loop, without the step."""
    failed, call, status = _transfer(calls, components, GET_REAL, sources, cell, value_reference)
    if status > WARNING:
        return failed, call, status
    for j in range(len(factors)):
        cell[j] *= factors[j]
    return _transfer(calls, components, SET_REAL, targets, cell, value_reference)


@compiled()
def _loop(calls, components, step, spans, sources, targets, factors, fed, table, recorded, outputs):  # type: ignore[no-untyped-def]
    """All steps; step, component, place in CALLS and status of a call that failed, or 0, NO_COMPONENT, 0, 0.

    Before component k steps, the connections from spans[k, 0] to spans[k, 1] - 1 are exchanged.
    """
    cell, value_reference = np.empty(len(factors) + 1), np.empty(1, np.uint32)
    failed, call, status = _transfer(calls, components, GET_REAL, recorded, outputs[0], value_reference)
    if status > WARNING:
        return 0, failed, call, status
    for n in range(len(outputs) - 1):
        failed, call, status = _transfer(calls, components, SET_REAL, fed, table[n], value_reference)
        if status > WARNING:
            return n, failed, call, status
        at, end = n * step, (n + 1) * step
        for k in range(len(components)):
            first, last = spans[k, 0], spans[k, 1]
            links = (sources[first:last], targets[first:last], factors[first:last])
            failed, call, status = _exchange(calls, components, *links, cell, value_reference)
            if status > WARNING:
                return n, failed, call, status
            status = call_step(calls[k, DO_STEP], components[k], at, end - at, np.int32(1))
            if status > WARNING:
                return n, k, DO_STEP, status
        failed, call, status = _transfer(calls, components, GET_REAL, recorded, outputs[n + 1], value_reference)
        if status > WARNING:
            return n, failed, call, status
    return 0, NO_COMPONENT, 0, 0


class _Places:
    """Finds COMPONENT.VARIABLE among open FMUs; HarnessError that names what is not there."""

    def __init__(self, opened: Mapping[str, Component]) -> None:
        self._opened, self._names = opened, list(opened)

    def split(self, name: str) -> tuple[str, str]:
        component, dot, variable = name.partition(".")
        if not dot or component not in self._opened:
            raise HarnessError(f"{name}: COMPONENT.VARIABLE is needed, with a component of {', '.join(self._names)}")
        return component, variable

    def of(self, name: str) -> tuple[int, int]:
        """Place of the component, and value reference of the Real variable."""
        component, variable = self.split(name)
        return self._names.index(component), self._opened[component].value_reference(variable)

    def table(self, names: Iterable[str]) -> NDArray[np.int64]:
        """Those of several, shape (n, 2)."""
        return np.array([self.of(name) for name in names], dtype=np.int64).reshape(-1, 2)


def _spans(targets: NDArray[np.int64], n_components: int, order: Order) -> NDArray[np.int64]:
    """First and last + 1 of the connections that are exchanged before each component steps, shape (n_components, 2).

    `targets` are the components at the ends of the connections, in rising order. Jacobi: all before the first component.
    """
    if order == "jacobi":
        return np.array([(0, len(targets)), *[(0, 0)] * (n_components - 1)])
    bounds = np.searchsorted(targets, np.arange(n_components + 1))
    return np.column_stack([bounds[:-1], bounds[1:]])


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
        places = _Places(opened)
        connections = sorted(system.connections, key=lambda each: places.of(each.target)[0])
        sources, targets = (places.table(getattr(each, end) for each in connections) for end in ("source", "target"))
        factors = np.array([each.factor for each in connections], dtype=np.float64)
        fed, recorded = places.table(given), places.table(record)
        starts: dict[str, dict[str, float | str]] = {name: {} for name in opened}
        for name, value in system.parameters.items():
            component, variable = places.split(name)
            starts[component][variable] = value
        slaves = [component.begin(starts[name], {}) for name, component in opened.items()]
        calls = np.array([addresses(slave) for slave in slaves], dtype=np.intp)
        components = np.array([instance_address(slave) for slave in slaves], dtype=np.intp)
        table = np.column_stack([series[:n_steps] for series in given.values()]) if given else np.empty((n_steps, 0))
        table = np.ascontiguousarray(table, dtype=np.float64)
        outputs = np.full((n_steps + 1, len(record)), np.nan)
        spans = _spans(targets[:, 0], len(slaves), order)
        wiring = (spans, sources, targets, factors, fed, table, recorded, outputs)
        at, failed, call, status = _loop(calls, components, step, *wiring)  # type: ignore[call-arg]
        if failed != NO_COMPONENT:
            name = list(opened)[failed]
            reason = opened[name].take_messages() or f"{CALLS[call]} returned {status_name(status)}"
            raise HarnessError(f"{name}, at {at * step:g} s: {reason}")
    data = {name: ("time", outputs[:, column]) for column, name in enumerate(record)}
    return xr.Dataset(data, coords={"time": ("time", np.arange(n_steps + 1) * step, {"units": "s"})})
