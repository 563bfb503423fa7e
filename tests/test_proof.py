"""The fidelities against each other on the built FMUs: what the paper reports, and what faults do in all of them."""

import numpy as np
import pytest

from ema_fmu_src.fidelities import FIDELITIES
from harness.flight.experiment import Experiment, fly
from harness.parameters import parse_settings
from harness.trials import trial

ALL = list(FIDELITIES.values())


@pytest.fixture(scope="module")
def paper(fmus) -> Experiment:
    """The paper's three trials, unfaulted, at default parameters."""
    trials = [trial(name) for name in ("SIN", "SIN4", "STEP-RAMP")]
    return fly(trials, ALL, FIDELITIES["HF"], fmus=fmus["HF"].parent, parameters={})


def nrmse(experiment: Experiment, name: str, fidelity: str, variable: str) -> float:
    found = [
        item.nrmse
        for item in experiment.comparisons
        if (item.trial, item.candidate, item.variable) == (name, fidelity, variable)
    ]
    assert len(found) == 1
    assert found[0] is not None
    return found[0]


@pytest.mark.parametrize("name", ["SIN", "STEP-RAMP"])
@pytest.mark.parametrize("fidelity", ["ELF", "ELF+", "LF"])
def test_unsaturated_trials_agree(paper, name, fidelity):
    """The paper: outside saturation the simpler models reproduce HF almost exactly (Figures 5 and 6)."""
    assert nrmse(paper, name, fidelity, "position") < 0.002
    assert nrmse(paper, name, fidelity, "motor_speed") < 0.003


def test_saturation_separates_elf_and_not_elf_plus(paper):
    """The paper, Figure 7: in SIN4 plain ELF leaves HF; ELF+ (ours) does not."""
    assert nrmse(paper, "SIN4", "ELF", "position") > 0.05
    assert nrmse(paper, "SIN4", "ELF+", "position") < 0.003
    assert nrmse(paper, "SIN4", "LF", "position") < 0.05


def test_saturation_is_reported(paper):
    """SIN stays unsaturated in every fidelity; SIN4 saturates in every one."""
    for fidelity in ALL:
        assert not paper.runs["SIN", fidelity.name].voltage_saturated.any(), fidelity.name
        assert paper.runs["SIN4", fidelity.name].voltage_saturated.any(), fidelity.name


@pytest.mark.parametrize("setting", ["N_a=0.7", "zeta=0.1", "friction=2", "backlash=50", "gain=0.7"])
def test_a_fault_moves_every_fidelity_the_same_way(paper, fmus, setting):
    """The change of position and speed from healthy to faulted points the same way in HF, ELF+ and LF.

    The measure is the cosine between the changes; the trial is the paper's STEP-RAMP.
    """
    parameters = parse_settings([f"fault.{setting}"])
    flown = [FIDELITIES[name] for name in ("HF", "ELF+", "LF")]
    faulted = fly([trial("STEP-RAMP")], flown, FIDELITIES["HF"], fmus=fmus["HF"].parent, parameters=parameters)
    for variable in ("position", "motor_speed"):
        change = {
            fidelity.name: faulted.runs["STEP-RAMP", fidelity.name][variable].values
            - paper.runs["STEP-RAMP", fidelity.name][variable].values
            for fidelity in flown
        }
        size = np.linalg.norm(change["HF"])
        assert size > 1e-4 * np.linalg.norm(paper.runs["STEP-RAMP", "HF"][variable].values)
        for name in ("ELF+", "LF"):
            cosine = float(change["HF"] @ change[name] / (size * np.linalg.norm(change[name])))
            assert cosine > 0.9, (variable, name, cosine)
