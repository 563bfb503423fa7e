"""Flies a twin's kernels directly, without an FMU: for tests of the physics."""

import numpy as np

from ema_fmu_src import ports
from ema_fmu_src.twins import STALE, STATUS, TWINS

OUTPUTS = [variable.name for variable in (*ports.OUTPUTS, ports.VARIABLES[ports.INDEX["controller.integral"]])]
FIRST = ports.INDEX["position"]


class Flight:
    """One twin at a time t [s]; parameters by name, ELF+ as a fidelity of its own."""

    def __init__(self, fidelity: str, **parameters: float) -> None:
        self.twin = TWINS[fidelity.removesuffix("+")]
        self.v = np.array(ports.starts(self.twin.name), dtype=np.float64)
        self.x = np.zeros(self.twin.n_states)
        self.t = 0.0
        self.set(**parameters)
        if fidelity == "ELF+":
            self.v[ports.INDEX["driver.coupled_saturation"]] = 1.0
        status = self.twin.initialize(self.v, self.x)
        assert status == 0, STATUS[status]

    def set(self, **values: float) -> None:
        """Set inputs and parameters; a dot in a name is written as two underscores."""
        for name, value in values.items():
            self.v[ports.INDEX[name.replace("__", ".")]] = value
        self.x[STALE] = 1.0

    def __getitem__(self, name: str) -> float:
        return float(self.v[ports.INDEX[name]])

    def to(self, t: float) -> "Flight":
        """Run to the time t [s] in one communication step."""
        status = self.twin.advance(self.v, self.x, t)
        assert status == 0, STATUS[status]
        self.t = t
        return self

    def fly(self, command, *, n: int, step: float = 1e-4, load=None) -> dict[str, np.ndarray]:
        """n communication steps under command(t) [rad] and load(t) [N.m]; every output at their ends, and the time."""
        rows = np.empty((n, len(OUTPUTS)))
        for k in range(n):
            self.v[ports.INDEX["command"]] = command(k * step)
            if load is not None:
                self.v[ports.INDEX["load_torque"]] = load(k * step)
            self.to((k + 1) * step)
            rows[k] = self.v[FIRST : FIRST + len(OUTPUTS)]
        return {"time": (np.arange(n) + 1) * step, **dict(zip(OUTPUTS, rows.T, strict=True))}
