"""A commented actuator file to begin with: it reads back as the default actuator until a line is changed."""

import json

from ema_fmu_src import ports
from harness.actuators.sheet import WORDS
from harness.faults import FAULTS

EXAMPLES = {
    "terminal_resistance": "0.16 ohm",
    "terminal_inductance": "0.257 mH",
    "torque_constant": "70.6 mN.m/A",
    "speed_constant": "135 rpm/V",
    "back_emf_constant": "7.4 mV/rpm",
    "no_load_current": "0.507 A",
    "no_load_speed": "6480 rpm",
    "coulomb_friction": "5 mN.m",
    "viscous_friction": "4e-4 mN.m/rpm",
    "nominal_voltage": "48 V",
    "rotor_inertia": "170 g.cm2 +- 5 %",
    "gear_inertia": "12.9 g.cm2",
    "pole_pairs": 8,
    "travel_constant": "6669 rad/m",
}
"""A value for each word of a data sheet."""

HEAD = """\
# An actuator for --actuator: take away the # of a line and put in what you know. Anything not stated keeps the default.
# A number is in the port's unit; a text may have a unit and a tolerance: "600 g.cm2 +- 5 %".
# ema actuator show prints what comes of it.
name = {name}
description = ""

# What a motor's data sheet says, in its words; what is under [parameters] wins.
[sheet]
{sheet}

# By port, with the defaults; ema ports lists them all, also faults and the state at the start.
[parameters]
{parameters}

# Half widths of 95 % intervals around values that are not exact, wherever the values come from; ema calibrate frees these.
[tolerances]
# "mechanics.C" = "30 %"
# "mechanics.T_coulomb" = "5 mN.m"

# A linear actuator: its travel a revolution of the user shaft. Outside, position and command are then in m, the load in N;
# under [parameters], "mechanics.end_stop" and "gear.backlash" may be lengths. State "gear.ratio" too, or travel_constant
# under [sheet] (the motor's angle over the travel), and "mechanics.end_stop": their defaults are a rotary actuator's.
[output]
# lead = "5 mm"

# Your logs: PORT = "COLUMN [unit] words", COLUMN a header word, a number from 1, or a path in a .mat file.
[log]
# time = "1 [ms]"
# command = "2 [mm] held"
# position = "4 [mm]"
# equivalent_current = "6 [mA]"

# The values of faults at which health is 0.
[limits]
{limits}

# Who wrote this, when, from what; under sources, where a number comes from.
[provenance]
# by = "..."
# date = 2026-01-31
# files = ["data-sheet.pdf"]
# sources = {{ "motor.R" = "data sheet, page 3" }}
"""


def template(name: str) -> str:
    """The text of the file, for an actuator of that name."""
    sheet = "\n".join(f"# {word} = {json.dumps(EXAMPLES[word])}" for word in WORDS)
    own = [port for port in ports.PARAMETERS if not port.name.startswith(("initial.", "fault."))]
    parameters = "\n".join(map(_line, (ports.VARIABLES[ports.INDEX["supply_voltage"]], *own)))
    limits = "\n".join(f"# {fault.name} = {fault.limit:g}" for fault in FAULTS.values())
    return HEAD.format(name=json.dumps(name, ensure_ascii=False), sheet=sheet, parameters=parameters, limits=limits)


def _line(port: ports.Variable) -> str:
    """A port with its default, unit and meaning, as a comment."""
    text = port.text(port.start)
    value = json.dumps(text) if port.items else text if port.kind == "Boolean" else repr(port.start)
    about = f"[{port.unit}] {port.description}" if port.unit not in ("", "1") else port.description
    others = "".join(f"; {model}: {start:g}" for model, start in port.start_of.items())
    return f'# "{port.name}" = {value}  # {about}{others}'
