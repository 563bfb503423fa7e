"""Every output of every fidelity, as hashes of its bits: what a change of the code must leave as it is.

`python tests/recorded.py FMUS` records them anew from the native FMUs in the folder FMUS, after a change that moves results
on purpose; CHANGELOG.md says why. Each output has a hash of its own, so that outputs which are appended disturb nothing.
"""

import hashlib
import json
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import xarray as xr

from harness.fidelity import FIDELITIES
from harness.flight.twin import Twin
from harness.trials import BUILT_IN, Trial, trial

FILE = Path(__file__).with_name("recorded.json")
FAULTED = {
    "fault.friction": 2.0,
    "fault.backlash": 50.0,
    "fault.N_a": 0.8,
    "fault.zeta": 0.1,
    "fault.phi": 0.5,
    "fault.gain": 0.7,
    "fault.magnet": 0.95,
    "fault.resistance": 1.2,
    "fault.jam": 0.01,
    "fault.current_offset_b": 0.1,
    "fault.resolver_offset": 0.05,
    "load_torque": 2.0,
}
BROKEN = {"fault.open_switch": 3.0, "fault.current_offset_a": 0.2, "fault.current_offset_c": -0.1, "load_torque": -1.0}
IN_MOTION = {
    "initial.motor_position": 2.0,
    "initial.motor_speed": 30.0,
    "initial.position": 0.0101,
    "initial.phase_current_a": 0.4,
    "initial.phase_current_b": -0.1,
    "initial.reference_current": 0.5,
    "initial.current_filtered": 0.3,
    "initial.integral": 0.2,
}
SOLD = {
    "controller.structure": 2.0,
    "controller.pid.c": 0.5,
    "controller.feedforward_speed": 0.1,
    "controller.current_control": 2.0,
    "controller.current.decoupling": 0.8,
    "controller.current.emf_forward": 0.2,
    "inverter.modulation": 3.0,
    "inverter.carrier_frequency": 16.3e3,
    "inverter.utilisation": 0.98,
    "sensor.counts": 2000.0,
    "mechanics.T_asymmetry": 0.005,
}
"""A PID, a field-oriented current loop, a carrier that divides no controller period."""
TRIANGLE = {"controller.current_control": 2.0, "inverter.modulation": 2.0, "inverter.minimum_pulse": 1e-6}
UNEVEN = 1.3e-4
"""A communication step [s] that is no multiple of any inner one, so that most points lie within a step."""


@dataclass(frozen=True)
class Case:
    """One run; inputs that ramp are for the native runtime only."""

    trial: str
    fidelity: str
    condition: str = "healthy"
    parameters: Mapping[str, float] = field(default_factory=dict)
    ramps: bool = False
    step: float | None = None

    @property
    def name(self) -> str:
        words = ["ramped" if self.ramps else "held", *([f"{self.step:g} s"] if self.step else [])]
        return " ".join([self.trial, self.fidelity, self.condition, *words])

    def flown(self) -> Trial:
        """The trial with its inputs held or ramping, on the communication steps of the case."""
        whole = trial(self.trial)
        if not self.ramps:
            whole = replace(whole, continuous=frozenset())
        if self.step is None:
            return whole
        times = whole.start + np.arange(int(whole.time[-1] / self.step)) * self.step
        inputs = {name: np.interp(times, whole.time, series) for name, series in whole.inputs.items()}
        return replace(whole, step=self.step, inputs=inputs)

    def fly(self, folder: Path) -> xr.Dataset:
        """The run with the FMUs in `folder`."""
        chosen = FIDELITIES[self.fidelity]
        with Twin(folder / chosen.fmu) as twin:
            return twin.run(self.flown(), {**chosen.parameters, **self.parameters})


def cases() -> Iterator[Case]:
    """All runs that are recorded."""
    for fidelity in FIDELITIES:
        for name in BUILT_IN:
            yield Case(name, fidelity)
            yield Case(name, fidelity, "faulted", FAULTED)
            yield Case(name, fidelity, ramps=True)
        yield Case("SIN", fidelity, "in motion", IN_MOTION)
        yield Case("LOAD-STEP", fidelity, "faulted", FAULTED, step=UNEVEN)
        yield Case("CHIRP", fidelity, ramps=True, step=UNEVEN)
        yield Case("SIN4", fidelity, "sold", SOLD)
        yield Case("LOAD-STEP", fidelity, "sold and faulted", {**SOLD, **FAULTED}, step=UNEVEN)
        yield Case("SIN4", fidelity, "triangle", TRIANGLE, ramps=True)
    yield Case("SIN", "HF", "broken", BROKEN)
    yield Case("LOAD-STEP", "HF", "broken", BROKEN)
    yield Case("STEP-RAMP", "HF", "fixed step", {"solver.event_located": 0.0, "solver.step": 2e-6})
    for fidelity in ("ELF", "ELF+", "LF"):
        yield Case("SIN4", fidelity, "fine step", {"solver.step": 3e-5})
        yield Case("SIN4", fidelity, "slow controller", {"controller.period": 3e-4, "solver.step": 2e-4})


def hashes(run: xr.Dataset) -> dict[str, str]:
    """Output -> hash of its bits (-0 counts as 0)."""
    return {
        str(name): hashlib.sha256((run[name].values.astype(np.float64) + 0.0).tobytes()).hexdigest()[:16]
        for name in run.data_vars
        if name != "command"
    }


def recorded() -> dict[str, dict[str, str]]:
    """Case -> output -> hash, as recorded."""
    content: dict[str, dict[str, str]] = json.loads(FILE.read_text())
    return content


if __name__ == "__main__":
    found = {case.name: hashes(case.fly(Path(sys.argv[1]))) for case in cases()}
    FILE.write_text(json.dumps(found, indent=0) + "\n")
    print(f"{len(found)} runs recorded in {FILE}")
