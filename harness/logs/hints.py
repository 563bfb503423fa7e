"""What a channel looks like that a model does not explain: other units, signs, columns or stops; shifts at their bounds."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from harness.logs.shown import Shown

Array = NDArray[np.float64]

FACTORS = {
    "rad": {180.0 / math.pi: "degrees", 0.5 / math.pi: "turns", 1e3: "mrad"},
    "m": {1e3: "mm", 100.0: "cm", 1e6: "um"},
    "rad/s": {30.0 / math.pi: "rpm", 180.0 / math.pi: "degrees a second", 0.5 / math.pi: "turns a second"},
    "A": {1e3: "mA"},
}
"""Unit -> factor by which a column is too large -> the unit that it then looks like."""
SAME_QUANTITY = 0.9
"""Correlation from which two curves are taken for the same quantity."""
FACTOR_TOLERANCE = 1.4
"""Ratio within which a factor is taken for a known one: faults change a curve too."""
FAR = 90.0
"""A curve more than so many times another is of another unit, whatever it looks like."""
END_STOP_TOLERANCE = 1.1
"""A position beyond so many times the end stop's cannot be."""
AT_BOUND = 0.95
"""Part of its bound from which a shift in time is said to have come to it."""


@dataclass(frozen=True)
class Seen:
    """A log beside what a model makes of its command, all as shown: `measured`, finite, and `expected`, shape (n_rows,
    n_channels), the `command`, shape (n_rows,), in the unit of a position, and the end stop, which is in it too."""

    channels: Sequence[Shown]
    measured: Array
    expected: Array
    command: Array
    end_stop: float

    @cached_property
    def names(self) -> list[str]:
        return [channel.name for channel in self.channels]

    def hint(self, place: int, expects: str = "what the model expects") -> str:
        """What the channel at `place` looks like, as a question; empty if it looks like nothing known."""
        data, unit = self.measured[:, place], self.channels[place].unit
        if self.names[place] == "position":
            if found := scaled(data, self.command, unit, "the command"):
                return found
            if found := self.beyond(place):
                return found
        if found := scaled(data, self.expected[:, place], unit, expects):
            return found
        alike = [abs(_correlation(data, model)) for model in self.expected.T]
        other = int(np.argmax(alike))
        if alike[other] > SAME_QUANTITY and alike[other] > alike[place] + 0.1:
            return f"it looks like {self.names[other]}: columns interchanged?"
        return sized(data, self.expected[:, place], unit, expects)

    def beyond(self, place: int) -> str:
        """A question if the position at `place` lies beyond the end stops, empty if not."""
        return self._beyond(self.measured[:, place], self.channels[place].unit)

    def command_beyond(self) -> str:
        """The same of the command; empty without a position, whose unit it has."""
        return (
            self._beyond(self.command, self.channels[self.names.index("position")].unit) if "position" in self.names else ""
        )

    def _beyond(self, series: Array, unit: str) -> str:
        reached = float(np.max(np.abs(series)))
        if reached <= END_STOP_TOLERANCE * self.end_stop:
            return ""
        other = "degrees instead of rad" if unit == "rad" else "is mechanics.end_stop right"
        return f"it reaches {reached:.3g} {unit}, beyond the end stops at {self.end_stop:.3g} {unit}: {other}?"


def scaled(data: Array, expected: Array, unit: str, what: str) -> str:
    """What it means if `data` is what was `expected`, in `unit`, multiplied or divided by one of FACTORS or turned round;
    empty if it is not."""
    correlation = _correlation(data, expected)
    if abs(correlation) < SAME_QUANTITY:
        return ""
    size, turned = abs(correlation) * _ratio(data, expected), correlation < 0.0
    times = f"it is {plain(math.copysign(size, correlation))} times {what}"
    for known, other in FACTORS.get(unit, {}).items():
        end = " and the other sign?" if turned else "?"
        if _near(size, known):
            return f"{times}: {other} instead of {unit}{end}"
        if known > 1.0 and _near(size, 1.0 / known):
            return f"{times}: is {what} in {other}{end}"
    return f"{times}: the other sign?" if turned and _near(size, 1.0) else ""


def sized(data: Array, expected: Array, unit: str, what: str) -> str:
    """The same by size alone, for curves that hardly look alike: only of factors that no fault or other drive makes."""
    size = _ratio(data, expected)
    for known, other in FACTORS.get(unit, {}).items():
        if known > FAR and 1.0 / FACTOR_TOLERANCE**2 < size / known < FACTOR_TOLERANCE**2:
            return f"it is {plain(size)} times as large as {what}: {other} instead of {unit}?"
    return ""


def at_bounds(names: Sequence[str], shifts: Sequence[float], bounds: Sequence[float]) -> list[str]:
    """A line for each channel whose shift in time [s] has come to its bound: most likely it is beyond; none for no bound."""
    return [
        f"{name} is shifted in time by {1e3 * shift:.3g} ms, as far as is allowed: are its times and the command's right?"
        for name, shift, bound in zip(names, shifts, bounds, strict=False)
        if bound > 0.0 and abs(shift) > AT_BOUND * bound
    ]


def plain(value: float, digits: int = 3) -> str:
    """A number of so many digits, without an exponent where it is large."""
    rounded = float(f"{value:.{digits}g}")
    return f"{rounded:.0f}" if abs(rounded) >= 10.0**digits else f"{rounded:.{digits}g}"


def percent(part: float | None, digits: int = 3) -> str:
    """A part as a percentage of so many digits; "-" for none."""
    return "-" if part is None else f"{plain(100.0 * part, digits)} %"


def _near(size: float, known: float) -> bool:
    return 1.0 / FACTOR_TOLERANCE < size / known < FACTOR_TOLERANCE


def _ratio(data: Array, expected: Array) -> float:
    return float(np.std(data) / max(float(np.std(expected)), 1e-300))


def _correlation(one: Array, other: Array) -> float:
    a, b = one - one.mean(), other - other.mean()
    return float(a @ b / max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-300))
