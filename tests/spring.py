"""An FMU that is none of ours, to couple an EMA with: a spring-damper load, made by pythonfmu."""

import sys
from pathlib import Path

from pythonfmu.builder import FmuBuilder

STIFFNESS, TAU = 200.0, 5e-3  # N.m/rad, s
SOURCE = f'''
import math
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Load(Fmi2Slave):
    """A spring in series with a damper: dT/dt = (stiffness*position - T)/tau, exact for a held position."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.position = 0.0
        self.torque = 0.0
        self.register_variable(Real("position", causality=Fmi2Causality.input, start=0.0))
        self.register_variable(Real("torque", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.torque += ({STIFFNESS} * self.position - self.torque) * (1.0 - math.exp(-step_size / {TAU}))
        return True
'''


def build(folder: Path) -> Path:
    """The FMU, in `folder`: input position [rad], output torque [N.m]."""
    script = folder / "load_fmu.py"
    script.write_text(SOURCE)
    search_path = list(sys.path)
    try:
        return Path(FmuBuilder.build_FMU(script, dest=folder))
    finally:
        sys.path[:] = search_path
