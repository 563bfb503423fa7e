"""Flies a twin's kernels directly, without an FMU: for tests of the physics."""

from collections.abc import Callable, Mapping

import numpy as np

from ema_fmu_src import ports
from ema_fmu_src.twins import STALE, TWINS, Status

WATCHED = [variable.name for variable in ports.VARIABLES if variable.causality in ("output", "local")]


class Flight:
    """One twin at a time t [s]; inputs and parameters by their port names, ELF+ as a fidelity of its own."""

    def __init__(self, fidelity: str, values: Mapping[str, float] | None = None) -> None:
        self.twin = TWINS[fidelity.removesuffix("+")]
        self.v = np.array(ports.starts(self.twin.name), dtype=np.float64)
        self.x = np.zeros(self.twin.n_states)
        self.t = 0.0
        self.set(values or {})
        if fidelity == "ELF+":
            self.v[ports.INDEX["driver.coupled_saturation"]] = 1.0
        status = self.twin.initialize(self.v, self.x)
        assert status == Status.OK, status.message

    def set(self, values: Mapping[str, float]) -> None:
        """Set inputs and parameters."""
        for name, value in values.items():
            self.v[ports.INDEX[name]] = value
        self.x[STALE] = 1.0

    def __getitem__(self, name: str) -> float:
        return float(self.v[ports.INDEX[name]])

    def to(self, t: float) -> "Flight":
        """Run to the time t [s] in one communication step."""
        status = self.twin.advance(self.v, self.x, t)
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
    ) -> dict[str, np.ndarray]:
        """n communication steps under command(t) [rad] and load(t) [N.m]: outputs and locals at their ends, and the time."""
        places = [ports.INDEX[name] for name in WATCHED]
        rows = np.empty((n, len(places)))
        for k in range(n):
            self.v[ports.INDEX["command"]] = command(k * step)
            if load is not None:
                self.v[ports.INDEX["load_torque"]] = load(k * step)
            self.to((k + 1) * step)
            rows[k] = self.v[places]
        return {"time": (np.arange(n) + 1) * step, **dict(zip(WATCHED, rows.T, strict=True))}
