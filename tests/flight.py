"""Flies a twin's kernels directly, without an FMU: for tests of the physics."""

from collections.abc import Callable, Mapping

import numpy as np

from ema_fmu_src import ports
from ema_fmu_src.twins import STALE, TWINS, Status

WATCHED = [variable.name for variable in ports.VARIABLES if variable.causality in ("output", "local")]
PLACES = [ports.INDEX[name] for name in WATCHED]


class Flight:
    """One twin at a time t [s]; inputs and parameters by their port names, ELF+ as a fidelity of its own."""

    def __init__(self, fidelity: str, values: Mapping[str, float] | None = None) -> None:
        status = self._start(fidelity, values or {})
        assert status == Status.OK, status.message

    @classmethod
    def tried(cls, fidelity: str, values: Mapping[str, float]) -> "Flight | Status":
        """The flight, or the status with which the twin refuses to start."""
        flight = cls.__new__(cls)
        status = flight._start(fidelity, values)
        return flight if status == Status.OK else status

    def _start(self, fidelity: str, values: Mapping[str, float]) -> Status:
        self.twin = TWINS[fidelity.removesuffix("+")]
        self.v = np.array(ports.starts(self.twin.name), dtype=np.float64)
        self.x = np.zeros(self.twin.n_states)
        self.t = 0.0
        self.set(values)
        if fidelity == "ELF+":
            self.v[ports.INDEX["driver.coupled_saturation"]] = 1.0
        return Status(self.twin.initialize(self.v, self.x))

    def set(self, values: Mapping[str, float]) -> None:
        """Set inputs and parameters."""
        for name, value in values.items():
            self.v[ports.INDEX[name]] = value
        self.x[STALE] = 1.0

    def __getitem__(self, name: str) -> float:
        return float(self.v[ports.INDEX[name]])

    def to(self, t: float) -> "Flight":
        """Run to the time t [s] in one communication step."""
        status = Status(self.twin.advance(self.v, self.x, t))
        assert status == Status.OK, status.message
        self.t = t
        return self

    def fly(
        self,
        command: Callable[[float], float],
        *,
        n: int,
        step: float = 1e-4,
        load: Callable[[float], float] | None = None,
        supply: Callable[[float], float] | None = None,
    ) -> dict[str, np.ndarray]:
        """n communication steps under command(t) [rad], load(t) [N.m] and supply(t) [V]; every output at their ends, and the
        time [s]."""
        inputs = {"command": command, "load_torque": load, "supply_voltage": supply}
        given = [(ports.INDEX[name], of) for name, of in inputs.items() if of is not None]
        rows = np.empty((n, len(WATCHED)))
        for k in range(n):
            for place, of in given:
                self.v[place] = of(k * step)
            self.to((k + 1) * step)
            rows[k] = self.v[PLACES]
        return {"time": (np.arange(n) + 1) * step, **dict(zip(WATCHED, rows.T, strict=True))}
