"""What a replay shows that a user should look at first: units, signs, stops, shifts and lags at their bounds."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from harness.logs.hints import AT_BOUND, Seen, at_bounds
from harness.logs.log import Log
from harness.logs.noise import filled
from harness.logs.observer import shift_bounds
from harness.logs.shown import ON_THE_MOTOR, Shown
from harness.replay.figures import MOST_LAG, Channel

Array = NDArray[np.float64]


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
    lines += at_bounds(seen.names, [item.shift for item in channels], shift_bounds(log, names).tolist())
    lines += [
        f"{item.name}: the twin's lag is at the bound of what is looked for, {1e3 * item.lag:.3g} ms: it may be more"
        for item in channels
        if abs(item.lag) > AT_BOUND * MOST_LAG
    ]
    return lines
