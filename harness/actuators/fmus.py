"""An actuator as the FMUs take it in: plain data for their builder, and the record that it left in them."""

import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from harness.actuators.actuator import DEFAULT as DEFAULT_ACTUATOR
from harness.actuators.actuator import Actuator, Output
from harness.actuators.ssvfile import LEAD

if TYPE_CHECKING:
    from ema_fmu_src.fmu.variant import Variant

RECORD = "resources/build.json"
"""Archive name of the record of what an FMU was built from."""


def variant(actuator: Actuator) -> "Variant":
    """The actuator for the builder of FMUs and SSP packages; the default one is the builder's own default."""
    from ema_fmu_src.fmu.variant import DEFAULT, Variant

    if actuator.is_default and actuator.name == DEFAULT_ACTUATOR.name:
        return DEFAULT
    about = {"actuator_sha256": actuator.sha256}
    if actuator.output.lead is not None:
        about[LEAD] = f"{actuator.output.lead!r} m"
    return Variant(actuator.name, actuator.description, dict(actuator.parameters), about, rod(actuator.output))


def rod(output: Output) -> str:
    """What the ports' units of the user shaft are at a rod, as a host has to convert them; "" for a shaft."""
    if output.lead is None:
        return ""
    travel, force = output.scale("position"), output.scale("load_torque")
    return f"linear: 1 rad of the user shaft is {travel:.9g} m of the rod, and 1 N.m of load_torque {force:.9g} N"


def record_of(path: Path) -> dict[str, str]:
    """The record of what the FMU at `path` was built from; empty if it has none or is no FMU."""
    try:
        with zipfile.ZipFile(path) as fmu:
            return dict(json.loads(fmu.read(RECORD)))
    except (OSError, KeyError, ValueError, zipfile.BadZipFile):
        return {}


def belongs_to_another(record: Mapping[str, str], actuator: Actuator) -> bool:
    """Whether an FMU with this record starts as an actuator that is neither `actuator` nor the default one."""
    return bool(record.get("starts")) and record.get("actuator_sha256") != actuator.sha256
