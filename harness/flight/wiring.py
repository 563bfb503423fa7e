"""How FMUs are wired: variables by COMPONENT.VARIABLE, and whether a connection makes sense."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harness.errors import HarnessError, unknown
from harness.flight.component import FUNCTIONS, Component
from harness.flight.exchange import KINDS

FITTING = {("Integer", "Real"), ("Enumeration", "Integer")}
"""Types from which a value passes to another without loss, beside a type to itself."""
RANGES = {"Boolean": (0.0, 1.0), "Integer": (-(2.0**31), 2.0**31 - 1.0), "Enumeration": (-(2.0**31), 2.0**31 - 1.0)}
"""Least and greatest value of a type of whole numbers."""


@dataclass(frozen=True)
class Connection:
    """An output of one component that is an input of another, as COMPONENT.VARIABLE, times `factor` (into a Real).

    Both are of one type, or an Integer goes to a Real or an Enumeration, by its number, to an Integer.
    """

    source: str
    target: str
    factor: float = 1.0

    def __str__(self) -> str:
        return f"{self.source} -> {self.target}"


class Places:
    """Finds COMPONENT.VARIABLE among open FMUs; HarnessError that names what is not there."""

    def __init__(self, opened: Mapping[str, Component]) -> None:
        self._opened, self._names = opened, list(opened)

    def split(self, name: str) -> tuple[str, str]:
        """Name of the component, and of the variable, which may not be there."""
        component, dot, variable = name.partition(".")
        if not dot or component not in self._opened:
            raise HarnessError(f"{name}: COMPONENT.VARIABLE is needed, with a component of {', '.join(self._names)}")
        return component, variable

    def component(self, name: str) -> Component:
        return self._opened[self.split(name)[0]]

    def variable(self, name: str) -> Any:
        """FMPy's description of it."""
        component, variable = self.split(name)
        known = self._opened[component].variables
        if variable not in known:
            raise unknown(f"variable of {component}", variable, known)
        return known[variable]

    def place(self, name: str) -> int:
        """Place of the component among the components."""
        return self._names.index(self.split(name)[0])

    def table(self, names: Iterable[str]) -> NDArray[np.int64]:
        """Place of the component, value reference and number in KINDS of each variable, shape (n, 3)."""
        rows = []
        for name in names:
            variable = self.variable(name)
            rows.append((self.place(name), variable.valueReference, KINDS.index(FUNCTIONS[variable.type])))
        return np.array(rows, dtype=np.int64).reshape(-1, 3)


def check(places: Places, connections: Sequence[Connection], fed: Iterable[str]) -> None:
    """HarnessError if a value of a connection, or one that is `fed`, has no place to go, or is not the only one there."""
    comes: dict[tuple[int, ...], str] = {}
    for name in fed:
        _check_settable(places, name)
        _claim(places, comes, name, "the inputs that are given")
    for each in connections:
        source, target = places.variable(each.source), places.variable(each.target)
        _check_settable(places, each.target)
        if source.type != target.type and (source.type, target.type) not in FITTING:
            raise HarnessError(f"{each}: {source.type} cannot become {target.type}")
        if not np.isfinite(each.factor) or (each.factor != 1.0 and target.type != "Real"):
            raise HarnessError(f"{each}: factor {each.factor:g}: a finite one is possible into Real, only 1 into others")
        _claim(places, comes, each.target, each.source)


def _claim(places: Places, comes: dict[tuple[int, ...], str], name: str, origin: str) -> None:
    """Note that the value of a variable, under whatever name, comes from `origin`; HarnessError if it has one already."""
    (place,) = map(tuple, places.table([name]).tolist())
    if place in comes:
        raise HarnessError(f"{name}: gets its value from {comes[place]} and from {origin}; it can have only one")
    comes[place] = origin


def _check_settable(places: Places, name: str) -> None:
    variable = places.variable(name)
    if variable.causality != "input" and variable.variability != "tunable":
        what = variable.causality or "variable"
        raise HarnessError(
            f"{name}: is no input but a{'n' if what[0] in 'aeiou' else ''} {what} of {places.component(name).path}"
        )


def check_names(components: Iterable[str]) -> None:
    """HarnessError if there is no component, or one whose variables cannot be named."""
    names = list(components)
    if not names:
        raise HarnessError("a system needs one component at least")
    for name in names:
        if not name or "." in name:
            raise HarnessError(f"component '{name}': a name without a dot is needed, as in COMPONENT.VARIABLE")


def as_series(name: str, series: Any) -> NDArray[np.float64]:
    """Values as an array; HarnessError if they are no numbers."""
    try:
        return np.asarray(series, dtype=np.float64)
    except (TypeError, ValueError):
        raise HarnessError(f"{name}: an array of numbers is needed, one a step") from None


def check_series(places: Places, name: str, series: NDArray[np.float64], n_steps: int) -> None:
    """HarnessError unless `series` has a value for each step, of the variable's type."""
    kind = places.variable(name).type
    if kind == "String":
        raise HarnessError(f"{name}: a String cannot change over time; it can have a start value among the parameters")
    if series.ndim != 1 or len(series) < n_steps:
        raise HarnessError(f"{name}: {len(series) if series.ndim else 1} values are given, {n_steps} are needed")
    wrong = ~np.isfinite(series)
    if kind in RANGES:
        low, high = RANGES[kind]
        wrong |= (series != np.round(series)) | (series < low) | (series > high)
    if wrong.any():
        at = int(np.argmax(wrong))
        raise HarnessError(f"{name}: its value {at}, {series[at]:g}, is no {kind if kind in RANGES else 'finite number'}")
