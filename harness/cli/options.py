"""Options that several commands share, and what they become."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harness.errors import HarnessError

if TYPE_CHECKING:
    from harness.trials import Trial

Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="A parameter or fault for all runs, such as fault.N_a=0.9; or load_torque or supply_voltage, "
        "held at that value where the trial does not give its own. May be given several times.",
    ),
]
JsonFile = Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write runs and errors as JSON.")]
FmuDir = Annotated[Path | None, typer.Option("--fmus", metavar="DIR", help="Folder of the FMUs.")]
TrialFile = Annotated[
    Path | None,
    typer.Option(
        "--trial-file", metavar="FILE.csv", help="A trial of your own: time, command[, load_torque, supply_voltage]."
    ),
]


def chosen_trials(names: list[str] | None, file: Path | None) -> "list[Trial]":
    """Trials by name and from a file, the paper's three if neither is given; HarnessError for one that is not there."""
    from harness.trials import PAPER, read_trial, trial

    chosen = {flown.name: flown for flown in map(trial, names or [])}
    if file:
        own = read_trial(file)
        if own.name.upper() in chosen:
            raise HarnessError(f"--trial-file {file}: {own.name} is flown already, rename the file")
        chosen[own.name] = own
    return list(chosen.values()) or [trial(name) for name in PAPER]
