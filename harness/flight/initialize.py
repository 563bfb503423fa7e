"""The start of coupled FMUs: inputs and outputs that fit each other before initialization mode is left.

FMI 2.0.4, section 4.2.4: in initialization mode inputs are set and outputs got, as often as it takes. On what an output
depends at the start is in ModelStructure's InitialUnknowns (section 2.2.8); where nothing is said, on all inputs.
Connections are followed in that order; those that close a loop are solved together.
"""

import warnings
from collections.abc import Mapping, Sequence
from graphlib import TopologicalSorter

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from harness.errors import HarnessError
from harness.flight.component import Component, Value
from harness.flight.wiring import Connection, Places

Array = NDArray[np.float64]

TOLERANCE = 1e-9
"""Largest difference between the two ends of a connection in a loop, over the larger of value and nominal value."""
LEAST_DISTANCE = 1e-5
"""Least distance of the gain around a loop from 1."""
SWEEPS = 200
"""Most rounds through a loop with other than Real variables, which only repetition can solve."""


def settle(opened: Mapping[str, Component], places: Places, connections: Sequence[Connection], *, flown: bool) -> None:
    """Set every connected input to what its output is; all FMUs are in initialization mode, other inputs are set.

    HarnessError if a loop has no solution near the start values, or none that is found; with its variables' names. Also, if
    steps will be `flown`, for a loop that is still one in steps (ModelStructure's Outputs) and amplifies: exchanged once a
    step, its values would grow without end.
    """
    wires = [_Wire(opened, places, each) for each in connections]
    later = _dependencies(opened, places, connections, "outputs")
    for group, loop in _groups(_dependencies(opened, places, connections, "initialUnknowns")):
        if loop:
            _solve(members := [wires[j] for j in group])
            stays = any(again for _, again in _groups([[group.index(i) for i in later[j] if i in group] for j in group]))
            if flown and stays and all(wire.continuous for wire in members):
                _check_gain(members)
        elif isinstance(value := wires[group[0]].carry(), float) and not np.isfinite(value):
            raise HarnessError(f"{wires[group[0]]}: the value is {value} at the start, no finite number")
    if any(wire.error(wire.arriving(), wire.standing) > TOLERANCE for wire in wires):
        _solve(wires)  # an FMU depends on more than it says
        if flown and all(wire.continuous for wire in wires):
            _check_gain(wires)


class _Wire:
    """A connection whose ends can be read and set."""

    def __init__(self, opened: Mapping[str, Component], places: Places, connection: Connection) -> None:
        (source, self._from), (target, self._to) = places.split(connection.source), places.split(connection.target)
        self._source, self._target = opened[source], opened[target]
        self._factor, self._name = connection.factor, str(connection)
        self.real = places.variable(connection.target).type == "Real"
        self.continuous = self.real and places.variable(connection.source).type == "Real"
        self.nominal = _nominal(places, connection.target)
        self.standing: Value = float("nan")

    def __str__(self) -> str:
        return self._name

    def arriving(self) -> Value:
        """What the source is now, as it arrives at the target."""
        value = self._source.get(self._from)
        return float(value) * self._factor if self.real else value

    def put(self, value: Value) -> Value:
        """Set the target."""
        self._target.set(self._to, value)
        self.standing = value
        return value

    def carry(self) -> Value:
        """From the source to the target."""
        return self.put(self.arriving())

    def error(self, arriving: Value, standing: Value) -> float:
        """How far the two are apart, as TOLERANCE tells; infinite where they are not numbers or not to be had in between."""
        if arriving == standing:
            return 0.0
        if not self.continuous or isinstance(arriving, str) or isinstance(standing, str):
            return float("inf")
        error = abs(arriving - standing) / max(abs(arriving), abs(standing), self.nominal)
        return error if np.isfinite(error) else float("inf")


def _nominal(places: Places, name: str) -> float:
    """The nominal value; 1 where none is stated (FMI 2.0, section 2.2.7)."""
    variable = places.variable(name)
    try:
        return abs(float(variable.nominal)) or 1.0
    except (TypeError, ValueError):
        return 1.0


def _dependencies(
    opened: Mapping[str, Component], places: Places, connections: Sequence[Connection], part: str
) -> list[list[int]]:
    """For each connection, the connections that its source depends on, by that part of the FMUs' ModelStructure."""
    ends = [places.split(each.target) for each in connections]
    return [
        [
            j
            for j, (component, variable) in enumerate(ends)
            if component == own and _depends(opened[own], source, variable, part)
        ]
        for own, source in (places.split(each.source) for each in connections)
    ]


def _depends(component: Component, output: str, name: str, part: str) -> bool:
    """Whether `output` may depend on the variable `name` of the same FMU, by that part of its ModelStructure."""
    variable = component.variables[output]
    if variable.causality == "input":
        return output == name
    exact = variable.initial == "exact" and part == "initialUnknowns"
    if variable.causality == "parameter" or variable.variability == "constant" or exact:
        return False
    for unknown in getattr(component.description, part):
        if unknown.variable is variable and unknown.dependencies is not None:
            return any(each.name == name for each in unknown.dependencies)
    return True


def _groups(depends_on: Sequence[Sequence[int]]) -> list[tuple[list[int], bool]]:
    """Connections in an order in which each comes after those that it depends on; those in one loop together, with True."""
    n = len(depends_on)
    if not n:
        return []
    pairs = [(i, j) for i, others in enumerate(depends_on) for j in others]
    rows, columns = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    count, label = connected_components(csr_array((np.ones(len(pairs)), (rows, columns)), shape=(n, n)), connection="strong")
    order = TopologicalSorter({k: set[int]() for k in range(count)})
    for i, j in pairs:
        if label[i] != label[j]:
            order.add(int(label[i]), int(label[j]))
    members = [[int(i) for i in np.flatnonzero(label == k)] for k in range(count)]
    return [(members[k], len(members[k]) > 1 or members[k][0] in depends_on[members[k][0]]) for k in order.static_order()]


def _solve(loop: Sequence[_Wire]) -> None:
    """Make both ends of every connection of a loop alike: by going round where that ends, else by Powell's hybrid method."""
    continuous = all(wire.continuous for wire in loop)
    first = values = [wire.carry() for wire in loop]
    for _ in range(len(loop) if continuous else SWEEPS):
        before, values = values, [wire.carry() for wire in loop]
        if values == before and all(isinstance(value, str) or np.isfinite(value) for value in values):
            return
    found = _hybrid(loop, np.array(first, dtype=np.float64)) if continuous else np.empty(0)
    errors = [wire.error(wire.arriving(), wire.standing) for wire in loop]
    worst = int(np.argmax(errors))
    told = f"{_told(loop)}: no values were found that fit at the start"
    if errors[worst] > TOLERANCE:
        raise HarnessError(
            f"{told}; the ends of {loop[worst]} differ by {errors[worst]:.2g} of the value, {TOLERANCE:g} is allowed. "
            "Other start values of these variables may help"
        )
    if continuous and np.abs(_gains(loop, found) - 1.0).min() < LEAST_DISTANCE:  # far away, differences vanish in rounding
        raise HarnessError(f"{told}; the gain around it is 1, which determines none")


def _told(loop: Sequence[_Wire]) -> str:
    return f"the loop of connections {'; '.join(map(str, loop))}"


def _arriving(loop: Sequence[_Wire], values: Array) -> Array:
    """What arrives when `values` are put."""
    for wire, value in zip(loop, values, strict=True):
        wire.put(float(value))
    return np.array([wire.arriving() for wire in loop], dtype=np.float64)


def _hybrid(loop: Sequence[_Wire], start: Array) -> Array:
    """The solution that is nearest, which the inputs are left at."""
    if not np.isfinite(start).all():
        start = np.zeros(len(loop))
    with np.errstate(all="ignore"), warnings.catch_warnings(action="ignore"):
        found = root(lambda values: _arriving(loop, values) - values, start, method="hybr", options={"xtol": 1e-13}).x
    _arriving(loop, found)
    return np.asarray(found, dtype=np.float64)


def _gains(loop: Sequence[_Wire], values: Array) -> NDArray[np.complex128]:
    """The gains around the loop at `values`, which the inputs are left at.

    They are the eigenvalues of the derivatives of what arrives by what is put, whatever the units are; 1 where those cannot
    be had.
    """
    there = _arriving(loop, values)
    steps = 1e-7 * np.maximum(np.abs(values), [wire.nominal for wire in loop])
    slopes = np.column_stack([(_arriving(loop, values + step) - there) / step.sum() for step in np.diag(steps)])
    _arriving(loop, values)
    finite = np.isfinite(slopes).all()
    return np.asarray(np.linalg.eigvals(slopes) if finite else np.ones(len(loop)), dtype=np.complex128)


def _check_gain(loop: Sequence[_Wire]) -> None:
    """HarnessError if a difference grows on the way around."""
    gain = float(np.abs(_gains(loop, np.array([wire.standing for wire in loop], dtype=np.float64))).max())
    if gain >= 1.0 - LEAST_DISTANCE:
        raise HarnessError(
            f"{_told(loop)}: its gain is {gain:.3g}; exchanged once a step, values grow without end from 1 on. "
            "Delay one of them, or make its FMUs one"
        )
