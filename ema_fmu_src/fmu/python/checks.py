"""What an instance takes from its host, and what not; the rules are those of the native runtime."""

import math
from collections.abc import Sequence
from typing import Any

from ... import ports
from ...twins import CLOCK, Status, Twin

MOST_STEPS = 1e9
"""Of the twin's own in one communication step."""
MOST_TICKS = 2.0**52
MODES = ("instantiated", "initializing", "running")


def value_problem(variable: ports.Variable, value: float, mode: str) -> str:
    """Why `variable` cannot be set to `value` while the instance is in `mode`; empty if it can."""
    if variable.causality not in ("input", "parameter"):
        return f"it is a variable of causality {variable.causality}, which only the FMU sets"
    if not math.isfinite(value):
        return "a finite number is needed"
    if variable.minimum is not None and value < variable.minimum:
        return f"it is less than the minimum {variable.minimum}"
    if variable.maximum is not None and value > variable.maximum:
        return f"it is more than the maximum {variable.maximum}"
    if variable.variability == "fixed" and mode == "running":
        return "a fixed parameter cannot change after initialization"
    return ""


def _slack(time: float, step: float) -> float:
    """How far from the last communication point, at `time`, a step may begin [s]: a thousandth of it, and what the host's
    clock rounds off, be it of double or of single precision. A tenth of a step is never rounding."""
    return 1e-3 * step + min(2.0**-23 * abs(time), 0.1 * step) + 2.0**-50 * abs(time)


def step_problem(time: float, step: float, *, point: float, stop: float, inner: float) -> str:
    """Why no step can be taken from `time` over `step`; empty if one can.

    `point`: the last communication point; `stop`: the end of the experiment; `inner`: the twin's own step; all in seconds.
    """
    end = time + step
    if not (math.isfinite(time) and math.isfinite(end)):
        return "time and step must be finite"
    if step <= 0.0:
        return f"the step size is {step} s, more than 0 s is needed"
    if abs(time - point) > _slack(point, step):
        return f"the communication point {time} s does not follow the last one, {point} s"
    if end <= point:
        return f"it is too short: it would end at {end} s, and the FMU is at {point} s"
    if end > stop + (_slack(stop, step) if math.isfinite(stop) else 0.0):
        return f"it would end at {end} s, after the stop time {stop} s"
    if step > MOST_STEPS * inner:
        return f"it takes {step / inner:.6g} steps of {inner:.6g} s within the FMU, and {MOST_STEPS:.6g} are the most"
    return ""


def _numbers(values: Any, n: int) -> bool:
    """Whether `values` are n floats."""
    return isinstance(values, list) and len(values) == n and all(isinstance(value, float) for value in values)


def _is_count(value: float, least: float, most: float) -> bool:
    return least <= value <= most and value == int(value)


def _is_clock(twin: Twin, v: Sequence[float], x: Sequence[float], since_start: float) -> bool:
    """Whether a twin that has started could have such a clock: a step of it ends, and ends where its host wants it."""
    clock = {name: x[place] for name, place in CLOCK.items()}
    step, tick = clock["step"], v[ports.INDEX[twin.tick]] if twin.tick else clock["step"]
    if not (step > 0.0 and _is_count(clock["per_sample"], 1.0, 2.0**31 - 1.0) and _is_count(clock["tick"], 0.0, MOST_TICKS)):
        return False
    if not (step <= tick * (1.0 + 1e-9) and step * clock["per_sample"] >= tick * (1.0 - 1e-9)):
        return False
    if not _is_count(clock["next_sample"] - clock["tick"], 0.0, clock["per_sample"]):
        return False
    if not all(_is_count(clock[flag], 0.0, 1.0) for flag in ("pending", "ramped")):
        return False
    point, close = clock["point"], 1e-3 * tick + 2.0**-50 * clock["point"]
    behind = point - (clock["tick"] * tick + clock["offset"])
    return point == since_start and all(-close <= part <= tick + close for part in (clock["offset"], behind))


def state_problem(twin: Twin, state: dict[str, Any]) -> str:
    """Why no instance can have got into `state` (as Slave saves it); empty if one can.

    Who forges a state must not make a call hang, nor raise, which pythonfmu would make fatal.
    """
    v, x, clock, mode = (state.get(name, ()) for name in ("v", "x", "clock", "mode"))
    if not (_numbers(v, len(ports.VARIABLES)) and _numbers(x, twin.n_states)):
        return "it has other variables"
    if not (isinstance(mode, list) and len(mode) == 4 and mode[0] in MODES and isinstance(mode[1], str)):
        return "it has no mode"
    if mode[2] not in [status.message for status in Status] or not isinstance(mode[3], bool):
        return "it has no status"
    if not _numbers(clock, 4):
        return "its times are none"
    start, point, stop, tolerance = clock
    if not (math.isfinite(start) and math.isfinite(point) and start <= point and start <= stop):
        return "its times are none"
    if not 0.0 < tolerance < math.inf:
        return "its tolerance is none"
    for variable, value in zip(ports.VARIABLES, v, strict=True):
        settable = variable.causality in ("input", "parameter")
        if settable and (value_problem(variable, value, "") or (variable.kind != "Real" and value != int(value))):
            return f"{variable.name} is out of its range"
    if mode[0] == "running" and not mode[2]:
        if not all(math.isfinite(number) for number in (*v, *x)):
            return "a number in it is not finite"
        if not _is_clock(twin, v, x, point - start):
            return "its clock is none"
    return ""
