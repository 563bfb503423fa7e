"""Native and python runtime, two FMI implementations around the same equations, give the same bits."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ema_fmu_src import ports
from harness.fidelity import FIDELITIES
from harness.trials import PAPER, trial
from harness.twin import Twin

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


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_every_output_to_the_last_bit(fmus: dict[str, Path], python_fmus: dict[str, Path], fidelity: str) -> None:
    chosen = FIDELITIES[fidelity]
    model = chosen.fmu.removeprefix("EMA_").removesuffix(".fmu")
    with Twin(fmus[model]) as native, Twin(python_fmus[model]) as python:
        for name in PAPER:
            held = replace(trial(name), continuous=frozenset())  # inputs that ramp are for the native runtime only
            for faults in ({}, FAULTED):
                one, other = (twin.run(held, {**chosen.parameters, **faults}) for twin in (native, python))
                for variable in ports.OUTPUTS:
                    assert np.array_equal(one[variable.name].values, other[variable.name].values), (name, variable.name)
