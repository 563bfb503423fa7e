"""What a replay shows that a user should look at first: units, signs, stops, shifts and lags at their bounds."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from harness.logs.hints import AT_BOUND, Seen, at_bounds
from harness.logs.log import Log
from harness.logs.noise import filled
from harness.logs.observer import shift_bounds
from harness.logs.shown import ON_THE_MOTOR, Shown
from harness.replays.figures import MOST_LAG, Channel

Array = NDArray[np.float64]


APART = 0.005
"""Difference of two channels' shifts [s] that hardly comes of when rows were written; or a row's distance, if less."""


def remarks_of(log: Log, names: Sequence[str], channels: Sequence[Channel], command: Array, end_stop: float) -> list[str]:
    """A line for each; `names`: the ports of the channels; `command`, shape (n_rows,), and `end_stop` in the unit outside of
    a position."""
    seen = Seen(
        [Shown(item.name, item.unit, 1.0) for item in channels],
        np.column_stack([filled(log.time, item.measured) for item in channels]),
        np.column_stack([item.twin for item in channels]),
        command,
        end_stop,
    )
    lines = [ON_THE_MOTOR] if "motor_position" in log.channels and "motor_position" not in seen.names else []
    if beyond := seen.command_beyond():
        lines.append(f"command: {beyond}")
    hints = {name: seen.hint(place, "what the twin makes") for place, name in enumerate(seen.names)}
    lines += [f"{name}: {hint}" for name, hint in hints.items() if hint]
    bounds = shift_bounds(log, names).tolist()
    lines += at_bounds(seen.names, [item.shift for item in channels], bounds)
    lines += _apart(log, [item for item, bound in zip(channels, bounds, strict=True) if bound > 0.0])
    lines += [
        f"{item.name}: the twin's lag is at the bound of what is looked for, {1e3 * item.lag:.3g} ms: it may be more"
        for item in channels
        if abs(item.lag) > AT_BOUND * MOST_LAG
    ]
    return lines


def _apart(log: Log, channels: Sequence[Channel]) -> list[str]:
    """A line if the shifts of two of the channels that may be shifted differ by more than they should."""
    if not channels:
        return []
    first, last = (pick(channels, key=lambda item: item.shift) for pick in (min, max))
    difference = last.shift - first.shift
    if difference <= min(APART, 1.0 / log.rate):
        return []
    return [
        f"{first.name} and {last.name} fit best at shifts {1e3 * difference:.3g} ms apart: "
        f"{in_words(first)}, {in_words(last)}; "
        "a wrong loop or motor does that too, so look at the figures without shifts"
    ]


def in_words(item: Channel) -> str:
    """A channel's shift as what one sees."""
    side = "earlier" if item.shift > 0.0 else "later"
    return f"the log shows {item.name} {1e3 * abs(item.shift):.3g} ms {side} than the twin"
