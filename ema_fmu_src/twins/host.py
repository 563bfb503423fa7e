"""What every FMU needs, whatever it models: start, inputs, and steps of its own whatever steps the host takes.

A twin moves on ticks of its own. At a communication point within a step, what moves is backed up as it was at the step's
beginning, and is then on its way: HF takes a part of the step, the others take it whole and stand between its ends. Once the
host is beyond it, what moves is restored and the step is taken whole. So the results do not depend on how a run is cut into
communication steps, as long as inputs and parameters are constant. A change of the load, of the supply or of a parameter is
an event: what was on its way is then kept, and the next step of the twin starts there.
"""

from typing import Any, NamedTuple

from .. import ports
from ..physics.jit import kernel
from .memory import Moving, State, namespace, places, port
from .status import Status

TOLD = (
    State("stale", "1", "1 after the host has changed a parameter, 0 once the twin has taken it in"),
    State("tolerance", "1", "relative tolerance of the experiment, written after the start; 0: none given"),
    *(
        State(f"slope_{variable.name}", f"{variable.unit}/s", f"slope of {variable.name} over the step; 0: held")
        for variable in ports.INPUTS
    ),
)
"""What the host writes."""
CLOCK = (
    State("step", "s", "the twin's own step; HF: the longest"),
    State("tick", "1", "whole steps since the start; HF: whole controller periods"),
    State("offset", "s", "time since that tick"),
    State("per_sample", "1", "ticks from sample to sample of the controller"),
    State("next_sample", "1", "the tick at which the controller is sampled next"),
    State("point", "s", "time of the last communication point"),
)
PARTIAL = (
    State("pending", "1", "1: the last communication point was reached by a partial step"),
    State("ramped", "1", "1: an input had a slope then"),
    State("load_torque", "N.m", "input then, to notice a change"),
    State("supply_voltage", "V", "input then, to notice a change"),
)
STATES = (*TOLD, *CLOCK, *PARTIAL)
told = places("told", TOLD)
clock = places("clock", CLOCK, first=len(TOLD))
partial = places("partial", PARTIAL, first=len(TOLD) + len(CLOCK))


class Input(NamedTuple):
    """Where an input is: its value in `v`, its slope in `x`."""

    port: int
    slope: int


SLOPES: dict[str, int] = {variable.name: getattr(told, f"slope_{variable.name}") for variable in ports.INPUTS}
"""Place in `x` of the slope of each input."""
_ALL_SLOPES = tuple(SLOPES.values())
inputs = namespace("inputs", {name: Input(ports.INDEX[name], slope) for name, slope in SLOPES.items()})

CLOSE = 1e-6
"""Two times closer than this fraction of a step are one: hosts that add up their steps are off by 1e-12 s."""


@kernel
def start(v, x, period, longest, n_states):
    """Clear `x` and begin to count.

    The twin's own step is the longest within `longest` [s] that divides `period` [s]; the controller is sampled every
    period.
    """
    for place in range(n_states):
        x[place] = 0.0
    x[clock.per_sample] = float(int(period / longest + 0.999999))
    x[clock.step] = period / x[clock.per_sample]


@kernel
def _sloped(x):
    """Whether an input has a slope."""
    sloped = False
    for slope in _ALL_SLOPES:
        if x[slope] != 0.0:
            sloped = True
    return sloped


@kernel
def back_up(v, x, moving):
    """Before a partial step: keep what moves as it is, and what is held or ramps."""
    for place in range(moving.first, moving.first + moving.size):
        x[place + moving.size] = x[place]
    x[partial.pending] = 1.0
    x[partial.ramped] = 1.0 if _sloped(x) else 0.0
    x[partial.load_torque] = v[port.load_torque]
    x[partial.supply_voltage] = v[port.supply_voltage]


@kernel
def _restore(x, moving):
    """Take back a partial step."""
    for place in range(moving.first, moving.first + moving.size):
        x[place] = x[place + moving.size]


@kernel
def take_in(v, x, tick_length, moving):
    """Begin a communication step: whether the host has changed a parameter. `tick_length` [s] is that of clock.tick.

    A partial step is taken back if nothing has changed but the command, and kept otherwise.
    """
    stale = x[told.stale] != 0.0
    if x[partial.pending] != 0.0:
        changed = x[partial.load_torque] != v[port.load_torque] or x[partial.supply_voltage] != v[port.supply_voltage]
        if stale or changed or x[partial.ramped] != 0.0 or _sloped(x):
            x[clock.offset] = x[clock.point] - x[clock.tick] * tick_length
        else:
            _restore(x, moving)
        x[partial.pending] = 0.0
    x[told.stale] = 0.0
    return stale


@kernel
def input_at(v, x, source, t):
    """One of `inputs` at time `t` [s]: its value at the last communication point, and its slope since."""
    return v[source.port] + x[source.slope] * (t - x[clock.point])


def stepper(sample: Any, shortened: Any, step: Any, on_the_way: Any, moving: Moving) -> Any:
    """A kernel run(v, x, t) that takes steps of one length, or of whole parts of it, until the time `t` [s].

    It is made of the twin's own kernels: sample(v, x, now), where the controller is due, shortened(v, x, h), the part of
    the step h that may be taken at once, step(v, x, now, h), and on_the_way(v, x, share), which takes what moves back from
    the end of the step to `share` of it. Status.STIFF where no part of a step may be taken.
    """

    @kernel
    def run(v, x, t):
        length = x[clock.step]
        while True:
            now = x[clock.tick] * length + x[clock.offset]
            left = t - now
            if left <= CLOSE * length:
                break
            if x[clock.tick] == x[clock.next_sample]:
                sample(v, x, now)
                x[clock.next_sample] += x[clock.per_sample]
            h = shortened(v, x, length - x[clock.offset])
            if h == 0.0:
                return Status.STIFF
            if h > left + CLOSE * length:
                back_up(v, x, moving)
                step(v, x, now, h)
                on_the_way(v, x, left / h)
                break
            step(v, x, now, h)
            x[clock.offset] += h
            if x[clock.offset] < (1.0 - CLOSE) * length:
                continue
            x[clock.tick] += 1.0
            x[clock.offset] = 0.0
        return Status.OK

    return run
