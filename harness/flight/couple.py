"""Several FMUs as one system: outputs of one are inputs of another, exchanged at the communication points.

Jacobi: all FMUs step with what the others had at the last point. Gauss-Seidel: in the order given, each takes what those
before it have just reached. Either is of first order in the communication step. At the start all ends fit each other.
"""

import math
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from harness.errors import HarnessError
from harness.flight import exchange
from harness.flight.calls import CALLS, addresses, instance_address, status_name
from harness.flight.component import Component, Value
from harness.flight.initialize import settle
from harness.flight.interrupt import deferred
from harness.flight.wiring import Connection, Places, as_series, check, check_names, check_series

__all__ = ["Connection", "System", "fly"]

Order = Literal["jacobi", "gauss-seidel"]
Array = NDArray[np.float64]
WHOLE = 1e-9
"""Part of a number of steps by which it may miss a whole number: the rounding of stop and step."""
MOST_STEPS = 10**9
PATIENCE = 0.1
"""Wall time between two looks for Ctrl-C, if the FMUs step faster than that [s]."""


@dataclass(frozen=True)
class System:
    """FMU files by component name, in the order of Gauss-Seidel; connections; parameters and start values by
    COMPONENT.VARIABLE: a number, a text for a String, the name of an item for an Enumeration."""

    components: Mapping[str, Path]
    connections: Sequence[Connection]
    parameters: Mapping[str, Value] = field(default_factory=dict)


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
    the dataset holds over time [s]. The last step is shorter where `stop` is no multiple of `step`. HarnessError for an
    unknown name, a second value for an input, a loop that has no start, or if an FMU refuses something (such as a step of
    another length).
    """
    if order not in ("jacobi", "gauss-seidel"):
        raise HarnessError(f"order {order}: jacobi or gauss-seidel is needed")
    times = _times(stop, step)
    given = {name: as_series(name, series) for name, series in (inputs or {}).items()}
    check_names(system.components)
    with ExitStack() as stack:
        interrupted = stack.enter_context(deferred())
        opened = {name: stack.enter_context(Component(Path(path))) for name, path in system.components.items()}
        places = Places(opened)
        _check_steps(opened, times, step)
        connections = sorted(system.connections, key=lambda each: places.place(each.target))
        check(places, connections, given)
        for name, series in given.items():
            check_series(places, name, series, len(times) - 1)
        for name in record:
            if places.variable(name).type == "String":
                raise HarnessError(f"{name}: a String cannot be recorded")
        slaves = _begin(opened, places, system, connections, given, stop=float(times[-1]))
        flight = _Flight(opened, places, slaves, connections, given, record, times, order)
        flight.run(interrupted)
        if interrupted():
            raise KeyboardInterrupt
        for component in opened.values():
            component.pass_on()
        kinds = {name: places.variable(name).type for name in record}
    types: dict[str, Any] = {"Real": np.float64, "Boolean": np.bool_}
    data: dict[str, Any] = {
        name: ("time", flight.outputs[:, i].astype(types.get(kinds[name], np.int64))) for i, name in enumerate(record)
    }
    return xr.Dataset(data, coords={"time": ("time", times, {"units": "s"})})


def _times(stop: float, step: float) -> Array:
    """Communication points [s]: 0, step, 2*step and so on, and `stop`."""
    if not (math.isfinite(step) and step > 0.0):
        raise HarnessError(f"step {step:g} s: a finite step of more than 0 s is needed")
    if not 0.0 <= stop <= MOST_STEPS * step:
        raise HarnessError(
            f"stop {stop:g} s: 0 s to {MOST_STEPS * step:g} s ({MOST_STEPS:g} steps of {step:g} s) can be flown"
        )
    whole = round(stop / step)
    if abs(stop / step - whole) <= WHOLE * max(whole, 1):
        return np.arange(whole + 1, dtype=np.float64) * step
    return np.append(np.arange(math.floor(stop / step) + 1, dtype=np.float64) * step, stop)


def _check_steps(opened: Mapping[str, Component], times: Array, step: float) -> None:
    """HarnessError if the last step is shorter, but an FMU takes only equal ones (FMI 2.0, section 4.3.1)."""
    if len(times) < 2 or times[-1] == (len(times) - 1) * step:
        return
    for name, component in opened.items():
        if not component.description.coSimulation.canHandleVariableCommunicationStepSize:
            below, above = ((len(times) - n) * step for n in (2, 1))
            raise HarnessError(
                f"stop {times[-1]:.9g} s is no multiple of the step {step:g} s, and {name} ({component.path.name}) "
                f"takes only equal steps: stop at {below:.9g} s or {above:.9g} s"
            )


def _begin(
    opened: Mapping[str, Component],
    places: Places,
    system: System,
    connections: Sequence[Connection],
    given: Mapping[str, Array],
    *,
    stop: float,
) -> list[Any]:
    """Initialize all FMUs together; FMPy's slaves."""
    starts: dict[str, dict[str, Value]] = {name: {} for name in opened}
    for name, value in system.parameters.items():
        own, variable = places.split(name)
        starts[own][variable] = value
    for name, component in opened.items():
        component.enter(starts[name], stop=stop)
    for name, series in given.items():
        if len(series):
            places.component(name).set(places.split(name)[1], float(series[0]))
    settle(opened, places, connections, flown=stop > 0.0)
    return [component.leave() for component in opened.values()]


def _spans(targets: NDArray[np.int64], n_components: int, order: Order) -> NDArray[np.int64]:
    """First and last + 1 of the connections that are exchanged before each component steps, shape (n_components, 2).

    `targets` are the components at the ends of the connections, in rising order. Jacobi: all before the first component.
    """
    if order == "jacobi":
        return np.array([(0, len(targets)), *[(0, 0)] * (n_components - 1)])
    bounds = np.searchsorted(targets, np.arange(n_components + 1))
    return np.column_stack([bounds[:-1], bounds[1:]])


class _Flight:
    """The flight of initialized FMUs; `outputs` has the shape (n_steps + 1, n_recorded)."""

    def __init__(
        self,
        opened: Mapping[str, Component],
        places: Places,
        slaves: Sequence[Any],
        connections: Sequence[Connection],
        given: Mapping[str, Array],
        record: Sequence[str],
        times: Array,
        order: Order,
    ) -> None:
        n_steps = len(times) - 1
        self._opened, self._places, self._times = opened, places, times
        self._calls = np.array([addresses(slave) for slave in slaves], dtype=np.intp)
        self._instances = np.array([instance_address(slave) for slave in slaves], dtype=np.intp)
        ends = [[getattr(each, end) for each in connections] for end in ("source", "target")]
        sources, targets = map(places.table, ends)
        factors = np.array([each.factor for each in connections], dtype=np.float64)
        table = np.column_stack([series[:n_steps] for series in given.values()]) if given else np.empty((n_steps, 0))
        self.outputs = np.full((n_steps + 1, len(record)), np.nan)
        self._recorded = places.table(record)
        spans = _spans(targets[:, 0], len(slaves), order)
        fed = (places.table(given), np.ascontiguousarray(table))
        self._wiring = (spans, sources, targets, factors, *fed, self._recorded, self.outputs)
        self._names: dict[int, Sequence[str]] = {
            exchange.STEPPED: list(opened),
            exchange.FED: list(given),
            exchange.SOURCE: ends[0],
            exchange.TARGET: ends[1],
            exchange.RECORDED: record,
        }

    def run(self, interrupted: Any) -> None:
        """All steps, until `interrupted()` is true; HarnessError that names what failed."""
        what, *failure = exchange.start(self._calls, self._instances, self._recorded, self.outputs)  # type: ignore[call-arg]
        self._check(0, what, *failure)
        done, chunk, n_steps = 0, 1, len(self._times) - 1
        while done < n_steps and not interrupted():
            span, began = (done, min(done + chunk, n_steps)), time.perf_counter()
            at, what, *failure = exchange.advance(self._calls, self._instances, self._times, span, *self._wiring)  # type: ignore[call-arg]
            self._check(at, what, *failure)
            done, lasted = span[1], time.perf_counter() - began
            chunk = 2 * chunk if lasted < 0.5 * PATIENCE else max(1, chunk // 2) if lasted > PATIENCE else chunk

    def _check(self, at: int, what: int, place: int, call: int, status: int) -> None:
        """HarnessError, with the FMU's own words, if something failed."""
        if what == exchange.NOTHING:
            return
        name = self._names[what][place]
        component = self._opened[name] if what == exchange.STEPPED else self._places.component(name)
        reason = component.take_messages() or f"{CALLS[call]} returned {status_name(status)}"
        if status == exchange.TOO_LONG:
            reason = f"its text is longer than {exchange.LONGEST - 1} bytes, which are the most that are passed on"
        raise HarnessError(f"{name}, at {self._times[at]:.9g} s: {reason}")
