"""The provenance of what a command writes: what it reads is what its parameters name, by one rule for all commands."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from harness.cli.guarded import read_now

if TYPE_CHECKING:
    from ema_fmu_src.fidelities import Fidelity
    from harness.actuators.actuator import Actuator
    from harness.provenance import Provenance


def provenance(
    actuator: "Actuator | None" = None,
    *,
    fmus: Path | None = None,
    fidelities: "Iterable[Fidelity]" = (),
    also: Iterable[Path] = (),
) -> "Provenance":
    """The record of the command that runs now.

    FMUs are those of `fidelities` in the folder `fmus`, and those that the command line names; inputs all other files that
    it names, and those in `also`, which its files name.
    """
    from harness.provenance import provenance as record

    named = [*read_now(), *also]
    flown = [fmus / name for name in dict.fromkeys(each.fmu for each in fidelities)] if fmus else []
    return record(
        fmus=[*(path for path in named if path.suffix.lower() == ".fmu"), *flown],
        inputs=[path for path in named if path.suffix.lower() != ".fmu"],
        actuator=actuator.identity if actuator else None,
    )


def write_json(path: Path, content: "Mapping[str, Any]", record: "Provenance") -> None:
    """Write `content` as JSON with its provenance, which stands beside what an actuator file's own `[provenance]` says."""
    from harness.files import results

    results.write_json(path, {**content, "provenance": {**content.get("provenance", {}), **record.as_dict()}})
