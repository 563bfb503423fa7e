"""Whether the FMUs accept an actuator: each fidelity begins a trial, and what it refuses is told in its own words."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from ema_fmu_src.fidelities import FIDELITIES
from harness.errors import HarnessError
from harness.flight.twin import Twin
from harness.parameters import merged
from harness.trials import trial

STEPS = 500
"""Communication steps of SIN that are flown."""


def refusals(fmus: Path, parameters: Mapping[str, float]) -> dict[str, str]:
    """By fidelity, what its FMU in the folder `fmus` says against these parameters; "" if it flies."""
    whole = trial("SIN")
    short = replace(whole, inputs={name: series[: STEPS + 1] for name, series in whole.inputs.items()})
    told = {}
    for name, fidelity in FIDELITIES.items():
        try:
            with Twin(fmus / fidelity.fmu) as twin:
                twin.run(short, merged(fidelity, parameters))
        except HarnessError as error:
            told[name] = str(error)
        else:
            told[name] = ""
    return told
