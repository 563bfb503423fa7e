"""A log flown again: the twin flies its command, and is compared with it at its rows."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.errors import HarnessError
from harness.fidelity import Fidelity
from harness.flight.twin import Twin
from harness.logs.hints import percent
from harness.logs.log import CHANNELS, Between, Log
from harness.logs.observer import Observer, observer_of, shift_bounds
from harness.logs.shown import Shown, shown, value_of
from harness.logs.start import start_of
from harness.logs.stimulus import trials_of
from harness.parameters import merged
from harness.replays.figures import MOST_LAG, Channel, TrackingError, nrmse, nrmse_20hz, rms, tracking_error
from harness.replays.remarks import remarks_of

Array = NDArray[np.float64]

LEAST_SECONDS, MOST_SECONDS = 0.05, 1000.0
"""Shortest and longest log that is flown [s]."""


@dataclass(frozen=True)
class Replay:
    """A log and what a twin makes of its command.

    `between`: what the command did between rows, as stated or as it fits best; `command`, shape (n_rows,), in the unit of
    the tracking error. `tracking_error`: None if no position was measured.
    """

    log: Log
    fidelity: str
    between: Between
    channels: tuple[Channel, ...]
    tracking_error: TrackingError | None
    remarks: tuple[str, ...]
    command: Array = field(repr=False)

    def as_dict(self) -> dict[str, object]:
        """For JSON."""
        return {
            "run": self.log.name,
            "group": self.log.group,
            "fidelity": self.fidelity,
            "rate": _rate(self.log.rate),
            "rows": len(self.log.time),
            "command": self.between.value,
            "channels": {channel.name: channel.as_dict() for channel in self.channels},
            "tracking_error": asdict(self.tracking_error) if self.tracking_error else None,
            "remarks": list(self.remarks),
        }


def replay(
    log: Log,
    twin: Twin,
    fidelity: Fidelity,
    parameters: Mapping[str, float] | None = None,
    *,
    on_progress: Callable[[int], object] | None = None,
) -> Replay:
    """Fly the log's command with `twin`, the FMU of `fidelity`, and `parameters` by port name; compare channel by channel.

    Where nothing says what the command does between rows, each way is flown, and the one that comes nearest is kept.
    HarnessError if the log is too short or too long, or as from Twin.
    """
    seconds = float(log.time[-1] - log.time[0])
    if not LEAST_SECONDS <= seconds <= MOST_SECONDS:
        raise HarnessError(f"{log.source}: lasts {seconds:g} s; {LEAST_SECONDS:g} s to {MOST_SECONDS:g} s can be flown")
    given = dict(parameters or {})
    names = tuple(name for name in CHANNELS if name in log.channels)
    start = _start(log, given)
    as_shown = [shown(name, names, log.output, given) for name in names]
    flown = {}
    for between, trial in trials_of(log, beyond=float(shift_bounds(log, names).max())).items():
        outputs = [port for port in ports.OUTPUTS if port.name in names]
        values, _ = twin.record(trial, merged(fidelity, {**start, **given}), outputs, on_progress=on_progress)
        places = [[port.name for port in outputs].index(name) for name in names]
        flown[between] = _channels(log, observer_of(log, trial, names), names, as_shown, values[:, places])
    between = min(flown, key=lambda each: sum(channel.nrmse**2 for channel in flown[each]))
    command = log.output.outside("command", log.inputs["command"])
    stop = log.output.scale("position") * value_of("mechanics.end_stop", given)
    return Replay(
        log,
        fidelity.name,
        between,
        flown[between],
        _tracking(flown[between], command),
        (*log.remarks, *_between(flown, between), *remarks_of(log, names, flown[between], command, stop)),
        command,
    )


def _start(log: Log, parameters: Mapping[str, float]) -> dict[str, float]:
    """The parameters initial.*: from the position, or, without one, at rest at the command."""
    if {"position", "motor_position"} & set(log.channels):
        return start_of(log, parameters).initial
    x = float(log.inputs["command"][0])
    return {"initial.position": x, "initial.motor_position": value_of("gear.ratio", parameters) * x}


def _channels(
    log: Log, observer: Observer, names: Sequence[str], as_shown: Sequence[Shown], values: Array
) -> tuple[Channel, ...]:
    data = np.column_stack([log.channels[name] for name in names])
    there = np.isfinite(data)
    bounds = shift_bounds(log, names)
    shifts = observer.aligned(values, data, there, bounds)
    lags = observer.aligned(values, data, there, np.maximum(MOST_LAG, bounds))
    at_best, raw = observer.rows(values, shifts), observer.rows(values, np.zeros(len(names)))
    channels = []
    for place, own in enumerate(as_shown):
        measured, twin, unshifted = (own.scale * each[:, place] for each in (data, at_best, raw))
        rows = log.rows_of(names[place])
        channels.append(
            Channel(
                own.name,
                own.unit,
                _rate(log.rate_of(names[place])),
                rms(twin - measured),
                nrmse(measured, twin),
                nrmse_20hz(log.time[rows], measured[rows], twin[rows]),
                nrmse(measured, unshifted),
                float(shifts[place]),
                float(lags[place]),
                measured,
                twin,
                unshifted,
            )
        )
    return tuple(channels)


def _rate(rate: float) -> float:
    """Without the last digits of times that are no binary fractions."""
    return float(f"{rate:.9g}")


def _tracking(channels: Sequence[Channel], command: Array) -> TrackingError | None:
    """The tracking error of the position, in its unit; None without one."""
    for item in channels:
        if item.name == "position":
            return tracking_error(command, item.measured, item.twin, item.unshifted, item.unit)
    return None


def _between(flown: Mapping[Between, Sequence[Channel]], best: Between) -> list[str]:
    if len(flown) == 1:
        return []
    misfit = {each: float(np.sqrt(np.mean([channel.nrmse**2 for channel in flown[each]]))) for each in flown}
    others = ", ".join(f"{each.value} {percent(misfit[each])}" for each in flown if each is not best)
    return [
        f"nothing says what the command does between rows: {best.value} fits best "
        f"({percent(misfit[best])} of the ranges; {others})"
    ]
