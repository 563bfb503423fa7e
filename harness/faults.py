"""The faults that are identified, each declared once.

Derived from this table: the coordinates, bounds and screen of the search; the estimates, their order, health and remarks;
the trends over many runs; the sliders of the live page; the cases and tables of the bench. The healthy value and the unit of
a fault, and its description, are those of its port.

A fault is a single value, or an amplitude with an angle. To identify one more, add an entry to FAULTS.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ema_fmu_src import ports
from harness.errors import HarnessError, unknown
from harness.parameters import check_value

THRESHOLD = 0.05
"""Loss of health from which a fault is alarmed, if its interval excludes the healthy value."""


@dataclass(frozen=True, kw_only=True)
class FaultParameter:
    """A port `fault.*` whose value is estimated; `slider`: lowest and highest value and step on the live page."""

    port: str
    slider: tuple[float, float, float]

    @property
    def name(self) -> str:
        """Short name, in tables, figures, options and JSON."""
        return self.port.removeprefix("fault.")

    @property
    def unit(self) -> str:
        """The port's unit."""
        return ports.VARIABLES[ports.INDEX[self.port]].unit

    @property
    def healthy(self) -> float:
        """The healthy value, at which the port starts."""
        return ports.VARIABLES[ports.INDEX[self.port]].start


@dataclass(frozen=True, kw_only=True)
class Angle(FaultParameter):
    """The angle [rad] of a fault that also has an amplitude. It has no severity and means nothing at amplitude 0."""


@dataclass(frozen=True)
class Group:
    """Faults of one kind on several parts; the bench draws one of them at a time.

    `all_alike`: remark for a run in which all of them have grown alike, for which something else may be the cause.
    `most`: of them that are told together."""

    name: str
    all_alike: str
    most: int = 3


@dataclass(frozen=True, kw_only=True)
class Fault(FaultParameter):
    """A fault that has a severity; all values in the port's unit, all ranges ours, after those of the paper.

    `limit`: the value at which health is 0. `studied`: the range that the screen and the bench cover; its width is the unit
    of errors. A fault that may depart from healthy to both sides has the healthy value inside that range, not at an end.
    `searched`: the bounds of the search. `better_than_healthy`: remark for an estimate that is surely on the other side of
    healthy than the limit; empty for none.

    With an `angle` the fault is an amplitude, healthy at 0. It is searched as a vector, because the angle means nothing at
    amplitude 0; each of the vector's two coordinates is bounded by plus and minus the upper end of `searched`.

    `scales`: the ports that it multiplies; where all of them are 0 it has no effect; empty if it is no scale. `in_current`:
    it shows in the current, and hardly elsewhere. `rare`: of two faults that explain a run alike, the other is told first.
    `alone`: a fault with which it is never told together, for no run separates the two. `told_by`: the run that tells it
    where another does not."""

    limit: float
    studied: tuple[float, float]
    searched: tuple[float, float]
    angle: Angle | None = None
    group: Group | None = None
    better_than_healthy: str = ""
    scales: tuple[str, ...] = ()
    in_current: bool = False
    rare: bool = False
    alone: str = ""
    told_by: str = ""

    def without_effect(self, parameters: Mapping[str, float]) -> str:
        """Why the fault does nothing in an actuator with these `parameters` by port name; empty if it does something."""
        values = [parameters.get(port, ports.VARIABLES[ports.INDEX[port]].start) for port in self.scales]
        return "" if not values or any(values) else f"no effect, for {' and '.join(self.scales)} is 0"

    @property
    def kind(self) -> str:
        """Name of the fault's group, or its own."""
        return self.group.name if self.group else self.name

    @property
    def span(self) -> float:
        """Width of the studied range, the unit of errors; as a decimal, because 1 - 0.7 is not quite 0.3 in binary."""
        low, high = self.studied
        return float(f"{high - low:.12g}")

    def limit_towards(self, value: float) -> float:
        """The limit on that side of healthy on which `value` is."""
        low, high = self.studied
        if not low < self.healthy < high:
            return self.limit
        distance = abs(self.limit - self.healthy)
        return self.healthy + (distance if value > self.healthy else -distance)

    def limits(self, limit: float | None = None) -> tuple[float, ...]:
        """The values at which health is 0: `limit`, by default its own, and its mirror, if the fault goes so far there."""
        end = self.limit if limit is None else limit
        mirror = 2.0 * self.healthy - end
        low, high = self.searched
        return (end, mirror) if low <= mirror <= high else (end,)

    def health(self, value: float, limit: float | None = None) -> float:
        """Health index of `value`, by its distance from healthy to either side: 1 healthy, 0 at or beyond the limit."""
        end = self.limit if limit is None else limit
        return min(1.0, max(0.0, 1.0 - abs(value - self.healthy) / abs(end - self.healthy)))

    def excludes_healthy(self, low: float, high: float) -> bool:
        """Whether the interval from `low` to `high` excludes the healthy value."""
        return not low <= self.healthy <= high

    def surely_better(self, low: float, high: float) -> bool:
        """Whether the interval from `low` to `high` lies wholly on the other side of healthy than the limit."""
        return high < self.healthy if self.limit > self.healthy else low > self.healthy


TURNS = Group("N", "all three phases have lost alike: weaker magnets (fault.magnet) or a larger mechanics.J look the same")


LOADED = "a run with a known load (load_torque)"
STARTS = "a run with many starts from rest"
SATURATED = "a run fast enough to saturate the voltage"
IN_PHASES = "a run whose phase currents are logged"
SLOW = "a slow run with reversals, its position measured behind the gear"
TURNING = "a run in which the motor turns fast enough for a row in every eighth of an electrical turn, and slowly too"
MOVING = "a run whose command moves fast"
OFFSETS = Group("current_offset", "", most=2)  # alike in all three phases, a star connection does not show them
GAINS = Group("current_gain", "", most=2)  # alike in all three, they are a torque constant


def _turns(phase: str) -> Fault:
    return Fault(
        port=f"fault.N_{phase}",
        limit=0.7,
        studied=(0.7, 1.0),
        searched=(0.3, 1.0),
        slider=(0.3, 1.0, 0.01),
        group=TURNS,
        in_current=True,
        told_by=LOADED,
    )


def _sensor_offset(phase: str) -> Fault:
    return Fault(
        port=f"fault.current_offset_{phase}",
        limit=1.0,
        studied=(-1.0, 1.0),
        searched=(-5.0, 5.0),
        slider=(-1.0, 1.0, 0.05),
        group=OFFSETS,
        in_current=True,
        rare=True,
        told_by=IN_PHASES,
    )


def _sensor_gain(phase: str) -> Fault:
    return Fault(
        port=f"fault.current_gain_{phase}",
        limit=0.7,
        studied=(0.7, 1.3),
        searched=(0.4, 2.0),
        slider=(0.7, 1.3, 0.01),
        group=GAINS,
        in_current=True,
        rare=True,
        told_by=IN_PHASES,
    )


FAULTS: dict[str, Fault] = {
    fault.name: fault
    for fault in (
        Fault(
            port="fault.friction",
            limit=3.0,
            studied=(1.0, 3.0),
            searched=(0.2, 10.0),
            slider=(0.0, 5.0, 0.1),
            scales=("mechanics.T_static", "mechanics.T_coulomb"),
            told_by=LOADED,
            better_than_healthy="friction is below that of a healthy actuator: "
            "another actuator, or parameters to be set with --set?",
        ),
        Fault(
            port="fault.backlash",
            limit=100.0,
            studied=(1.0, 100.0),
            searched=(0.0, 300.0),
            slider=(0.0, 100.0, 1.0),
            scales=("gear.backlash",),
            told_by=SLOW,
        ),
        *map(_turns, "abc"),
        Fault(
            port="fault.zeta",
            limit=0.15,
            studied=(0.0, 0.15),
            searched=(0.0, 0.34),  # keeps motor.p * zeta below 1 where both coordinates are at their bounds
            slider=(0.0, 0.3, 0.01),
            angle=Angle(port="fault.phi", slider=(-3.1, 3.1, 0.1)),
            in_current=True,
            told_by=TURNING,
        ),
        Fault(
            port="fault.gain",
            limit=0.5,
            studied=(0.5, 1.5),
            searched=(0.2, 3.0),
            slider=(0.1, 2.0, 0.05),
            scales=("controller.K_pos",),
            told_by=MOVING,
        ),
        Fault(
            port="fault.jam",
            limit=0.1,
            studied=(0.0, 0.1),
            searched=(0.0, 1.0),
            slider=(0.0, 0.1, 0.005),
            rare=True,
            alone="friction",
            told_by=STARTS,
        ),
        Fault(
            port="fault.magnet",
            limit=0.7,
            studied=(0.7, 1.0),
            searched=(0.3, 1.0),
            slider=(0.3, 1.0, 0.01),
            scales=("motor.K_e",),
            in_current=True,
            rare=True,
            told_by=LOADED,
        ),
        Fault(
            port="fault.resistance",
            limit=2.0,
            studied=(1.0, 2.0),
            searched=(0.5, 3.0),
            slider=(0.5, 3.0, 0.05),
            scales=("motor.R",),
            in_current=True,
            rare=True,
            told_by=SATURATED,
            better_than_healthy="the windings have less resistance than a healthy actuator's: cold, or "
            "motor.R is set too high?",
        ),
        *map(_sensor_offset, "abc"),
        *map(_sensor_gain, "abc"),
        Fault(
            port="fault.resolver_offset",
            limit=0.3,
            studied=(-0.3, 0.3),
            searched=(-0.4, 0.4),
            slider=(-0.3, 0.3, 0.01),
            in_current=True,
            rare=True,
            told_by=LOADED,
        ),
    )
}
"""By short name, in the order of all results."""

ESTIMATED: dict[str, FaultParameter] = {
    parameter.name: parameter for fault in FAULTS.values() for parameter in (fault, fault.angle) if parameter is not None
}
"""All that is estimated, by short name: each fault, followed by its angle if it has one."""

KINDS: dict[str, tuple[Fault, ...]] = {
    kind: tuple(fault for fault in FAULTS.values() if fault.kind == kind)
    for kind in dict.fromkeys(fault.kind for fault in FAULTS.values())
}
"""The faults by kind: those of a group together, every other one alone."""


def parse_limits(texts: Sequence[str]) -> dict[str, float]:
    """Limits of the health index by short name, from texts NAME=VALUE such as friction=2.

    HarnessError for an unknown fault, a text that is no number, or the healthy value itself.
    """
    limits: dict[str, float] = {}
    for text in texts:
        name, equals, number = (part.strip() for part in text.partition("="))
        if not equals:
            raise HarnessError(f"--limit {text}: NAME=VALUE is needed, such as friction=2")
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        limits |= checked_limit(name, value, f"--limit {text}")
    return limits


def checked_limit(name: str, value: float, where: str) -> dict[str, float]:
    """{short name: value} of the limit of a fault; HarnessError, beginning with `where`, as from `parse_limits`."""
    name = name.removeprefix("fault.")
    if name not in FAULTS:
        raise HarnessError(f"{where}: {unknown('fault', name, FAULTS)}")
    fault = FAULTS[name]
    if not math.isfinite(value) or value == fault.healthy:
        raise HarnessError(f"{where}: a number other than {fault.healthy:g}, which is healthy, is needed")
    low, high = fault.studied
    if low == fault.healthy > value or high == fault.healthy < value:
        side = "more" if low == fault.healthy else "less"
        raise HarnessError(f"{where}: {side} than {fault.healthy:g}, which is healthy, is needed: that way it grows")
    check_value(ports.VARIABLES[ports.INDEX[fault.port]], value, where)
    return {name: value}
