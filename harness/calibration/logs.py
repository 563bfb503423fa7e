"""Several logs of one actuator, each with settings of its own; and the logs flown again with what was found."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from harness.actuators.actuator import Actuator
from harness.calibration.bench import Bench
from harness.calibration.result import Calibration
from harness.errors import HarnessError
from harness.flight.twin import Twin
from harness.inference.measured import Measured, measured_from_log
from harness.logs.log import Log
from harness.logs.read import read_log
from harness.parameters import check_drive, check_together, parse_settings
from harness.replays.replay import Replay, replay

ITS_OWN = "::"
"""Between the name of a log and a setting that holds for it alone."""


def parse_own(settings: Sequence[str], logs: Sequence[Path]) -> tuple[dict[str, float], dict[Path, dict[str, float]]]:
    """The parameters of texts NAME=VALUE for all logs, and of LOG::NAME=VALUE for one, by its path.

    LOG is the path as it was given, its last part, or that without its ending. HarnessError for a log that is none or
    several of `logs`, or as from `parse_settings`.
    """
    common, own = [], {path: list[str]() for path in logs}
    for text in settings:
        name, mark, setting = text.partition(ITS_OWN)
        if not mark:
            common.append(text)
            continue
        meant = [path for path in logs if name.strip() in (str(path), path.name, path.stem)]
        if len(meant) != 1:
            given = ", ".join(path.name for path in logs)
            raise HarnessError(f"--set {text}: '{name}' is {'none' if not meant else 'several'} of the logs: {given}")
        own[meant[0]].append(setting)
    return parse_settings(common), {path: parse_settings(texts) for path, texts in own.items() if texts}


def runs_of(
    path: Path, parameters: Mapping[str, float], actuator: Actuator, columns: Mapping[str, str]
) -> list[tuple[Log, Measured]]:
    """The runs of a log and what a fit sees of each; `parameters`: those set for it. HarnessError for an unusable one."""
    check_together(parameters, str(path))
    check_drive(parameters, str(path))
    return [(log, measured_from_log(log, parameters)) for log in read_log(path, columns, actuator.output, parameters)]


def named(measured: Sequence[Measured]) -> list[Measured]:
    """The runs with names that differ: those that are alike are numbered."""
    names = [each.name for each in measured]
    out = []
    for place, each in enumerate(measured):
        same = names[:place].count(each.name)
        out.append(replace(each, name=f"{each.name} {same + 1}") if names.count(each.name) > 1 else each)
    return out


def flown_again(
    found: Calibration,
    bench: Bench,
    logs: Sequence[Log],
    checks: Sequence[tuple[Log, Mapping[str, float]]],
    on_step: Callable[[str], object] = lambda text: None,
) -> Calibration:
    """The calibration with its `logs`, and with `checks`, logs that were not fitted with the parameters set for each, flown
    as `ema replay` flies them with the actuator that was found. HarnessError as from `replay`."""
    decided = [
        replace(log, between=next(iter(curves.run.trials))) if log.between is None else log
        for log, curves in zip(logs, found.curves, strict=True)
    ]
    with Twin(bench.fmus / bench.fidelity.fmu) as twin:

        def flown(log: Log, own: Mapping[str, float]) -> Replay:
            on_step(f"flying {log.name}")
            return replay(log, twin, bench.fidelity, {**found.actuator.parameters, **own})

        return replace(
            found,
            replays=tuple(flown(log, bench.own.get(place, {})) for place, log in enumerate(decided)),
            checks=tuple(flown(log, own) for log, own in checks),
        )
