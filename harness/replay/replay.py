"""A log flown again: the twin flies its command, and is compared with it at its rows."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.errors import HarnessError
from harness.fidelity import Fidelity
from harness.flight.twin import Twin
from harness.logs.log import CHANNELS, Between, Log
from harness.logs.observer import Observer, observer_of, shift_bound
from harness.logs.start import start_of
from harness.logs.stimulus import trials_of
from harness.parameters import merged
from harness.replay.figures import Channel, TrackingError, nrmse, nrmse_20hz, rms, tracking_error

Array = NDArray[np.float64]

MOST_LAG = 0.05
"""Largest lag that is looked for [s], either way."""
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
            "rate": self.log.rate,
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
    flown = {}
    for between, trial in trials_of(log, beyond=shift_bound(log)).items():
        outputs = [port for port in ports.OUTPUTS if port.name in names]
        values, _ = twin.record(trial, merged(fidelity, {**start, **given}), outputs, on_progress=on_progress)
        places = [[port.name for port in outputs].index(name) for name in names]
        flown[between] = _channels(log, observer_of(log, trial, names), names, values[:, places])
    between = min(flown, key=lambda each: sum(channel.nrmse**2 for channel in flown[each]))
    command = log.output.outside("command", log.inputs["command"])
    return Replay(
        log,
        fidelity.name,
        between,
        flown[between],
        _tracking(log, flown[between], given, command),
        (*log.remarks, *_between(flown, between)),
        command,
    )


def _start(log: Log, parameters: Mapping[str, float]) -> dict[str, float]:
    """The parameters initial.*: from the position, or, without one, at rest at the command."""
    if {"position", "motor_position"} & set(log.channels):
        return start_of(log, parameters).initial
    x = float(log.inputs["command"][0])
    ratio = parameters.get("gear.ratio", ports.VARIABLES[ports.INDEX["gear.ratio"]].start)
    return {"initial.position": x, "initial.motor_position": ratio * x}


def _channels(log: Log, observer: Observer, names: Sequence[str], values: Array) -> tuple[Channel, ...]:
    data = np.column_stack([log.channels[name] for name in names])
    there = np.isfinite(data)
    shifts = observer.aligned(values, data, there, shift_bound(log))
    lags = observer.aligned(values, data, there, max(MOST_LAG, shift_bound(log)))
    shown, raw = observer.rows(values, shifts), observer.rows(values, np.zeros(len(names)))
    channels = []
    for place, name in enumerate(names):
        measured, twin, unshifted = (log.output.outside(name, each[:, place]) for each in (data, shown, raw))
        channels.append(
            Channel(
                name,
                log.output.unit(name),
                rms(twin - measured),
                nrmse(measured, twin),
                nrmse_20hz(log.time, measured, twin),
                nrmse(measured, unshifted),
                float(shifts[place]),
                float(lags[place]),
                measured,
                twin,
                unshifted,
            )
        )
    return tuple(channels)


def _tracking(
    log: Log, channels: Sequence[Channel], parameters: Mapping[str, float], command: Array
) -> TrackingError | None:
    """The tracking error of the position, or of the motor's on the user's side; in the unit outside."""
    found = {channel.name: channel for channel in channels}
    unit = log.output.unit("position")
    if position := found.get("position"):
        return tracking_error(command, position.measured, position.twin, position.unshifted, unit)
    if motor := found.get("motor_position"):
        ratio = parameters.get("gear.ratio", ports.VARIABLES[ports.INDEX["gear.ratio"]].start)
        scale = log.output.scale("position") / ratio
        return tracking_error(command, scale * motor.measured, scale * motor.twin, scale * motor.unshifted, unit)
    return None


def _between(flown: Mapping[Between, Sequence[Channel]], best: Between) -> list[str]:
    if len(flown) == 1:
        return []
    misfit = {each: float(np.sqrt(np.mean([channel.nrmse**2 for channel in flown[each]]))) for each in flown}
    others = ", ".join(f"{each.value} {100.0 * misfit[each]:.3g} %" for each in flown if each is not best)
    return [
        f"nothing says what the command does between rows: {best.value} fits best "
        f"({100.0 * misfit[best]:.3g} % of the ranges; {others})"
    ]
