"""Options that several commands share, and what they become."""

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ema_fmu_src.fidelities import FIDELITIES, Fidelity
from harness.errors import HarnessError

if TYPE_CHECKING:
    from harness.actuators.actuator import Actuator
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
ActuatorOption = Annotated[
    str | None,
    typer.Option(
        "--actuator",
        metavar="NAME_OR_FILE",
        help="An actuator of the library (ema actuator list), a .toml file, or a parameter set of SSP (.ssv).",
    ),
]
JsonFile = Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write runs and errors as JSON.")]
Figures = Annotated[
    Path | None,
    typer.Option("--figures", metavar="DIR", help="Also write each figure of the page, for papers: SVG and PNG."),
]
FmuDir = Annotated[Path | None, typer.Option("--fmus", metavar="DIR", help="Folder of the FMUs.")]
TrialFile = Annotated[
    Path | None,
    typer.Option(
        "--trial-file", metavar="FILE", help="A trial of your own: time, command[, load_torque, supply_voltage]; any format."
    ),
]
Columns = Annotated[
    list[str] | None,
    typer.Option(
        "--column",
        metavar="PORT=COLUMN",
        help="A column by its header word or number, with '[unit]' and words: 'position=4 [mm] motor'; several times.",
    ),
]
WithFiles = Annotated[
    list[Path] | None,
    typer.Option("--with", metavar="FILE2", help="More columns of the same run, joined by time; several times."),
]
Monitor = Annotated[str, typer.Option("--monitor", metavar="FIDELITY", help=f"The model: {', '.join(FIDELITIES)}.")]
Limits = Annotated[
    list[str] | None,
    typer.Option("--limit", metavar="NAME=VALUE", help="A fault at which health is 0, such as friction=2; several times."),
]
Threshold = Annotated[
    float, typer.Option("--threshold", metavar="PART", help="Loss of health from which a fault is alarmed.")
]


def chosen_actuator(name: str | None) -> "Actuator":
    """The actuator of `--actuator`, the default one if none is given.

    HarnessError as from `read_actuator`, or for a `[log]` that no log can be read by.
    """
    from harness.actuators.actuator import DEFAULT
    from harness.actuators.read import read_actuator
    from harness.logs.mapping import check_layout

    if name is None:
        return DEFAULT
    actuator = read_actuator(name)
    check_layout(actuator.log, actuator.output, f"{name}, [log]")
    return actuator


def chosen_parameters(actuator: "Actuator", settings: list[str] | None) -> dict[str, float]:
    """The parameters of `actuator`, over which those of `--set` win; HarnessError as from `parse_settings`."""
    from harness.parameters import check_drive, check_together, parse_settings

    parameters = {**actuator.parameters, **parse_settings(settings or [])}
    check_together(parameters, "--set")
    check_drive(parameters, "--set")
    return parameters


def chosen_limits(actuator: "Actuator", limits: list[str] | None) -> dict[str, float]:
    """The limits of `actuator`, over which those of `--limit` win; HarnessError as from `parse_limits`."""
    from harness.faults import parse_limits

    return {**actuator.limits, **parse_limits(limits or [])}


def save_figures(folder: Path | None, drawn: Callable[[], Mapping[str, Any]], stem: str) -> None:
    """Write what is `drawn`, figures by name, as `--figures` asks for it, and say where; nothing without a folder."""
    from harness.show import figures

    if folder:
        figures.save(folder, drawn(), stem)
        typer.echo(f"figures: {folder}")


def chosen_monitor(
    name: str, settings: list[str] | None, *, estimated: Collection[str], actuator: "Actuator"
) -> tuple[Fidelity, dict[str, float]]:
    """The monitor's fidelity, and the parameters of `actuator` and of `--set` for it.

    HarnessError if one of the ports to be `estimated` is set, other than to its healthy value by the actuator.
    """
    from harness.fidelity import parse_fidelity
    from harness.identification.asked import check_healthy
    from harness.parameters import parse_settings

    model = parse_fidelity(name, "--monitor")
    check_healthy(actuator, parse_settings(settings or []), estimated, setting="--set ", given="--actuator ")
    parameters = chosen_parameters(actuator, settings)
    return model, {port: value for port, value in parameters.items() if port not in estimated}


def chosen_columns(texts: list[str] | None, actuator: "Actuator | None" = None) -> dict[str, str]:
    """Port -> column, unit and words: the actuator's `[log]`, and over it `--column`; HarnessError for what says nothing."""
    from harness.logs.mapping import parse_columns

    return parse_columns(texts or [], actuator.log if actuator else None)


def chosen_trials(
    names: list[str] | None, file: Path | None, actuator: "Actuator | None" = None, *, columns: list[str] | None = None
) -> "list[Trial]":
    """Trials by name and from a file, the paper's three if neither is given; the file has the actuator's units outside.

    HarnessError for a name that is unknown, a file that cannot be read, or one that has the name of a trial.
    """
    from harness.logs.trialfile import read_trial
    from harness.trials import PAPER, trial

    chosen = {flown.name: flown for flown in map(trial, names or [])}
    if columns and not file:
        raise HarnessError("--column: goes with --trial-file, whose columns it names")
    if file:
        output, log = (actuator.output, actuator.log) if actuator else (None, None)
        own = read_trial(file, output, chosen_columns(columns), log)
        if own.name.upper() in chosen:
            raise HarnessError(f"--trial-file {file}: {own.name} is flown already, rename the file")
        chosen[own.name] = own
    return list(chosen.values()) or [trial(name) for name in PAPER]


def end_stop(actuator: "Actuator", parameters: "Mapping[str, float]") -> list[str]:
    """A line if nobody stated the end stops of a rod."""
    from harness.actuators.doubts import unstated_end_stop

    return unstated_end_stop(parameters, actuator.output)


def beyond(trials: "Sequence[Trial]", actuator: "Actuator", parameters: "Mapping[str, float]") -> list[str]:
    """A line for each trial whose command goes beyond the end stops, where the shaft stays."""
    from harness.logs.shown import value_of

    stop, output = value_of("mechanics.end_stop", {**actuator.parameters, **parameters}), actuator.output
    scale, unit = output.scale("position"), output.unit("position")
    lines = []
    for each in trials:
        furthest = float(abs(each.inputs["command"]).max())
        if furthest > stop * (1.0 + 1e-9):
            lines.append(
                f"{each.name}: the command goes to {scale * furthest:.4g} {unit}, beyond the end stop at "
                f"{scale * stop:.4g} {unit} (mechanics.end_stop), where the shaft stays"
            )
    return lines


SMALL = 0.01
"""Part of the travel to the end stops below which a built-in trial says little of a linear actuator."""


def small(trials: "Sequence[Trial]", actuator: "Actuator") -> list[str]:
    """A line if built-in trials, whose angles are a rotary actuator's, hardly move the rod of `actuator`."""
    from harness.trials import BUILT_IN

    if actuator.output.lead is None:
        return []
    stop = actuator.value("mechanics.end_stop")
    largest = {each.name: float(abs(each.inputs["command"]).max()) for each in trials if each.name in BUILT_IN}
    if not largest or max(largest.values()) > SMALL * stop:
        return []
    reached, travel = (1e3 * value * actuator.output.scale("position") for value in (max(largest.values()), stop))
    return [
        f"{', '.join(largest)}: angles of a rotary actuator, here at most {reached:.2g} mm of {travel:.3g} mm to the end "
        "stop; a --trial-file says more"
    ]
