"""What a calibration has found."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.actuators.actuator import Actuator
from harness.inference.measured import Measured
from harness.logs.shown import Shown
from harness.replays.replay import Replay

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Parameter:
    """A parameter in its port's unit: what was known before, `start` with the deviation `before`, and now, `value` with
    `sigma`. `freed`: whether the runs tell it; if not, `reason` says what would."""

    name: str
    start: float
    before: float
    value: float
    sigma: float
    freed: bool
    reason: str = ""

    @property
    def unit(self) -> str:
        """The port's."""
        return ports.VARIABLES[ports.INDEX[self.name]].unit

    def as_dict(self) -> dict[str, object]:
        """For JSON."""
        return {key: value for key, value in asdict(self).items() if key != "name"} | {"unit": self.unit}


@dataclass(frozen=True)
class Nuisance:
    """What the bench adds to a `channel`, a port, of a `run`: `kind` one of those of the sensors, in its `unit`."""

    run: str
    channel: str
    kind: str
    value: float
    sigma: float
    unit: str


@dataclass(frozen=True)
class Rest:
    """What the model leaves of a `channel` of a `run`, as fractions of its range, the bench's nuisances taken into account:
    the root mean square of all, and the part that counts against the model. `noise`: deviation of the noise that was found,
    in the port's unit, and the `order` of its autoregression."""

    run: str
    channel: str
    rms: float
    unexplained: float
    noise: float
    order: int


@dataclass(frozen=True)
class Curves:
    """A run as it was fitted, for drawing: `measured` and `fitted`, shape (n_rows, n_channels), in the ports' units."""

    run: Measured = field(repr=False)
    fitted: Array = field(repr=False)
    weight: Array = field(repr=False)

    @property
    def channels(self) -> Sequence[Shown]:
        """How the channels are shown."""
        return list(self.run.shown.values())


@dataclass(frozen=True)
class Inflation:
    """How many times as uncertain the values are as the fit's own noise says: by blocks of time, and by leaving out
    runs; the larger was taken. `scale`: whether the runs were not believed about a common scale of torque constant, inertia
    and friction."""

    blocks: float
    runs: float
    scale: bool

    @property
    def factor(self) -> float:
        """That was taken."""
        return max(self.blocks, self.runs)

    def as_dict(self) -> dict[str, object]:
        """For JSON and TOML."""
        return {"factor": self.factor, "blocks": self.blocks, "runs": self.runs, "scale_open": self.scale}


@dataclass(frozen=True)
class Calibration:
    """The parameters of an actuator from runs known to be healthy.

    `actuator`: that of the start, with what was found: values, tolerances and the table `[calibration]`. `linked`: names of
    `covariance`, shape (n, n), in the ports' units. `complaints`: a line for each channel that is not explained. `replays`,
    `checks`: the logs flown with the calibrated values alone, those that were fitted and those that were not.
    """

    actuator: Actuator
    fidelity: str
    parameters: tuple[Parameter, ...]
    linked: tuple[str, ...]
    covariance: Array = field(repr=False)
    nuisances: tuple[Nuisance, ...]
    rests: tuple[Rest, ...]
    inflation: Inflation
    complaints: tuple[str, ...]
    remarks: tuple[str, ...]
    flights: int
    seconds: float
    curves: tuple[Curves, ...] = field(repr=False)
    replays: tuple[Replay, ...] = ()
    checks: tuple[Replay, ...] = ()

    def parameter(self, name: str) -> Parameter:
        """By port name."""
        return next(item for item in self.parameters if item.name == name)

    @property
    def correlation(self) -> Array:
        """Of `linked`, shape (n, n)."""
        sigmas = np.sqrt(np.diag(self.covariance))
        return self.covariance / np.outer(sigmas, sigmas)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "monitor": self.fidelity,
            "explained": not self.complaints,
            "parameters": {item.name: item.as_dict() for item in self.parameters},
            "covariance": {"names": list(self.linked), "values": self.covariance.tolist()},
            "inflation": self.inflation.as_dict(),
            "nuisances": nested(self.nuisances),
            "left": {
                run: {
                    item.channel: {key: value for key, value in vars(item).items() if key not in ("run", "channel")}
                    for item in self.rests
                    if item.run == run
                }
                for run in dict.fromkeys(item.run for item in self.rests)
            },
            "runs": [item.as_dict() for item in self.replays],
            "checks": [item.as_dict() for item in self.checks],
            "complaints": list(self.complaints),
            "remarks": list(self.remarks),
            "evaluations": self.flights,
            "seconds": self.seconds,
        }


def nested(nuisances: Sequence[Nuisance]) -> Mapping[str, Any]:
    """Run -> channel -> kind -> value, sigma, unit."""
    out: dict[str, dict[str, dict[str, dict[str, object]]]] = {}
    for item in nuisances:
        kinds = out.setdefault(item.run, {}).setdefault(item.channel, {})
        kinds[item.kind] = {"value": item.value, "sigma": item.sigma, "unit": item.unit}
    return out
