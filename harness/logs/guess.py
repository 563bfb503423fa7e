"""What a column most likely is, by its word, or by its numbers where it has none; guesses are offered, never taken."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from harness.errors import HarnessError
from harness.files.table import Column, Table
from harness.logs.mapping import KEYS
from harness.units import conversion

_ALIASES = {
    "time": "t time zeit timestamp timestamps temps tiempo elapsed elapsedtime seconds sec times "
    "zeitstempel clock tsec datetime date",
    "command": "command cmd commanded commandedposition setpoint positionsetpoint positioncommand "
    "positioncmd cmdposition poscmd cmdpos target targetposition positiontarget reference "
    "positionreference ref posref thetaref xref positionref demand soll sollwert "
    "sollposition sollweg lagesoll setposition desired desiredposition commandposition "
    "poscommand input consigne sollwinkel winkelsoll winkelsollwert solllage lagesollwert commandangle "
    "anglecommand targetangle angletarget setangle anglesetpoint",
    "position": "position pos actualposition positionactual actualpos posactual positionactualvalue "
    "measuredposition positionmeasured posmeas ist istwert istposition istweg lageist weg "
    "theta angle winkel x stroke displacement travel encoder encoderposition feedback "
    "positionfeedback output extension rodposition shaftangle istwinkel winkelist winkelistwert istlage "
    "lageistwert angleactual actualangle measuredangle outputangle",
    "motor_position": "motorposition motorangle rotorangle rotorposition thetam motorpos mechanicalangle "
    "resolver motorencoder",
    "motor_speed": "motorspeed speed velocity actualspeed actualvelocity speedactual velocityactual "
    "velocityactualvalue omega w wm omegam rotorspeed drehzahl motorvelocity "
    "motordrehzahl geschwindigkeit rpm n speedfeedback vel motorrpm istdrehzahl drehzahlist",
    "equivalent_current": "equivalentcurrent current iq motorcurrent actualcurrent currentactual "
    "currentactualvalue strom motorstrom istrom qcurrent iqmeas iqactual torquecurrent i "
    "curr amps currentmeasured measuredcurrent drivecurrent currentfeedback",
    "equivalent_current_filtered": "equivalentcurrentfiltered iqfiltered currentfiltered filteredcurrent iqfilt "
    "currentaveraged currentactualvalueaveraged averagedcurrent currentavg meancurrent stromgefiltert",
    "phase_current_a": "phasecurrenta ia iu i1 currenta currentu phasecurrentu iphasea iphaseu phaseacurrent",
    "phase_current_b": "phasecurrentb ib iv i2 currentb currentv phasecurrentv iphaseb iphasev phasebcurrent",
    "phase_current_c": "phasecurrentc ic iw i3 currentc currentw phasecurrentw iphasec iphasew phaseccurrent",
    "supply_current": "supplycurrent idc buscurrent dclinkcurrent dccurrent batterycurrent ibus",
    "load_torque": "loadtorque load torqueload externaltorque loadforce force externalforce last "
    "lastmoment kraft tload fload",
    "supply_voltage": "supplyvoltage vdc udc vbus busvoltage dcvoltage dclinkvoltage supply udclink "
    "zwischenkreisspannung batteryvoltage uzk vsupply",
    "temperature": "temperature temp windingtemperature motortemperature temperatur tmotor motortemp housingtemperature",
    "position_error": "positionerror error followingerror followerror trackingerror lagerror schleppfehler poserror poserr",
    "position_demand": "positiondemand demandposition positiondemandvalue profileposition plannedposition "
    "interpolatedposition",
    "run": "run runnumber runid cycle cyclenumber repetition trial lauf zyklus strokenumber",
    "group": "group test testnumber testid series session gruppe batch",
}
"""Words without case, blanks and signs: of CiA 402, of common loggers, German ones."""
ALIASES = {alias: key for key, words in _ALIASES.items() for alias in words.split()}


def plain(word: str) -> str:
    """A word without case, blanks and signs."""
    return re.sub(r"[^a-z0-9]", "", word.lower())


_FILTERED = re.compile(
    r"(?:low[_ -]?pass(?:ed)?|smooth(?:ed)?|filt(?:ered)?|aver(?:aged?)?|avg|mean|gefiltert|gemittelt|lpf|tp)(?![a-z])",
    re.IGNORECASE,
)
"""What says of a current that the drive has filtered it."""
OWN = {plain(key): key for key in KEYS}
_SIGNS = re.compile(r"[^A-Za-z0-9\s_.:()\[\]'\"-]")


def own_key(word: str) -> str:
    """The key whose own name a word is, "" if none; a word with other signs, such as a damaged degree's, is none."""
    return "" if _SIGNS.search(word) else OWN.get(plain(word), "")


@dataclass(frozen=True)
class Guess:
    """What a column looks like: a key, and the unit as it is written or as its numbers suggest ("" for the port's own)."""

    column: Column
    key: str
    unit: str

    @property
    def flag(self) -> str:
        """The option that accepts the guess."""
        name = self.column.called
        unit = f" [{self.unit}]" if self.unit else ""
        return f"--column '{self.key}={name}{unit}'"

    @property
    def is_readable(self) -> bool:
        """Whether its unit is one that the reader takes for its key, or is left to the user."""
        return self.unit in ("", OPEN) or any(_takes(self.unit, target) for target in TARGETS[self.key])


WIDE, FAST = 2.5, 1500.0
"""Ranges of an angle [rad] and of a motor speed [rad/s] from which they are more likely in degrees and in rpm."""
OPEN = "UNIT"
"""In place of a unit that neither the header nor the numbers tell; a reader refuses it."""
OPEN_MEANS = (
    "UNIT stands where nothing tells: deg, rpm, A, ...; or mm and mm/s, if --actuator names a linear actuator's file"
)
_ANGLE = re.compile(r"angle|winkel|theta", re.IGNORECASE)
_LENGTH = re.compile(r"weg|stroke|travel|displacement|rod|extension|hub", re.IGNORECASE)
ALIKE, RELATED = 0.9, 0.3
"""Correlations of a column with what a position's slope is, or a speed's, from which it may be a speed, or a current."""
_PER_MINUTE = re.compile(r"1?/min|min\^?-1", re.IGNORECASE)
TARGETS: dict[str, tuple[str, ...]] = {
    "time": ("s",), "supply_voltage": ("V",), "load_torque": ("N.m", "N"), "temperature": ("degC",),
    "motor_speed": ("rad/s", "m/s"), "run": ("",), "group": ("",),
    **dict.fromkeys(("command", "position", "motor_position", "position_error", "position_demand"), ("rad", "m")),
    **dict.fromkeys((key for key in KEYS if "current" in key), ("A",)),
}  # fmt: skip
"""Key -> units of which a column's has to be one kind: a shaft's, or a rod's."""


def _takes(unit: str, target: str) -> bool:
    try:
        conversion(unit, target, "")
    except HarnessError:
        return False
    return True


def guesses(table: Table, *, linear: bool = False) -> list[Guess]:
    """A guess for each column that looks like something, each key once, in the columns' order."""
    found = [(column, _by_word(column)) for column in table.columns]
    if not any(key in ("command", "position", "motor_position") for _, key in found):
        nameless = [column for column in table.columns if _is_nameless(column)]
        found = _by_numbers(nameless, next((column for column, key in found if key == "time"), None)) + found
    taken: dict[str, Guess] = {}
    for column, key in found:
        if key and key not in taken and (not column.labels or key in ("run", "group")):
            taken[key] = Guess(column, key, _unit(column, key, linear=linear))
    return sorted(taken.values(), key=lambda guess: guess.column.number)


def _is_nameless(column: Column) -> bool:
    return not column.name or column.name.rpartition(".")[2].isdigit()


def _by_word(column: Column) -> str:
    leaf = column.name.rpartition(".")[2]
    for word in (column.name, leaf, f"{leaf}_{column.unit}"):
        key = OWN.get(plain(word)) or ALIASES.get(plain(word))
        if not key and _FILTERED.search(word):
            bare = plain(_FILTERED.sub("", word))
            key = "equivalent_current_filtered" if ALIASES.get(bare) == "equivalent_current" else ""
        if key == "position" and _counts(column):
            return "run"
        if key:
            return key
    return ""


def _by_numbers(columns: Sequence[Column], times: Column | None = None) -> list[tuple[Column, str]]:
    """Without words: the first column that only rises is the time, the next is commanded, what is most like it follows."""
    rising = times or next(
        (c for c in columns if len(c.values) > 1 and not c.labels and bool(np.all(np.diff(c.values) > 0.0))), None
    )
    if rising is None:
        return []
    rest = [c for c in columns if c is not rising and not c.labels and _varies(c)]
    found = [(rising, "time")]
    if rest:
        command = rest[0]
        found.append((command, "command"))
        others = [c for c in rest[1:] if not np.array_equal(c.values, command.values)]
        likeness = [_likeness(command.values, c.values) for c in others]
        if likeness and max(likeness) > 0.5:
            position = others.pop(int(np.argmax(likeness)))
            found += [(position, "position"), *_by_slopes(position.values, rising.values, others)]
    return found


def _by_slopes(position: np.ndarray, time: np.ndarray, columns: Sequence[Column]) -> list[tuple[Column, str]]:
    """The column that is like the position's slope, and, if one is left beside it, that which goes with it."""
    if len(time) != len(position) or not bool(np.all(np.diff(time) > 0.0)):
        return []
    slope = np.gradient(position, time)
    speed = max(columns, key=lambda each: _correlation(slope, each.values), default=None)
    if speed is None or _correlation(slope, speed.values) < ALIKE:
        return []
    rest = [each for each in columns if each is not speed]
    of_speed = (speed.values, np.gradient(speed.values, time))
    if len(rest) != 1 or max(_correlation(each, rest[0].values) for each in of_speed) < RELATED:
        return [(speed, "motor_speed")]
    return [(speed, "motor_speed"), (rest[0], "equivalent_current")]


def _correlation(one: np.ndarray, other: np.ndarray) -> float:
    if len(one) != len(other):
        return 0.0
    both = np.isfinite(one) & np.isfinite(other)
    if both.sum() < 3 or np.ptp(one[both]) == 0.0 or np.ptp(other[both]) == 0.0:
        return 0.0
    return abs(float(np.corrcoef(one[both], other[both])[0, 1]))


def _counts(column: Column) -> bool:
    """Whether it holds whole numbers in long rows of the same, as a stroke's number does."""
    finite = column.values[np.isfinite(column.values)]
    whole = finite.size > 1 and bool(np.all(finite == np.rint(finite)))
    return whole and int(np.count_nonzero(np.diff(finite))) < 0.1 * finite.size


def _varies(column: Column) -> bool:
    finite = column.values[np.isfinite(column.values)]
    return finite.size > 1 and bool(np.ptp(finite) > 0.0)


def _likeness(one: np.ndarray, other: np.ndarray) -> float:
    alike = _correlation(one, other)
    if alike == 0.0:
        return 0.0
    both = np.isfinite(one) & np.isfinite(other)
    spread = np.ptp(one[both]) / np.ptp(other[both])
    return alike * float(min(spread, 1.0 / spread)) ** 0.5


def _unit(column: Column, key: str, *, linear: bool) -> str:
    """The unit as written, or the one that the word and the numbers tell, OPEN where they leave it open.

    `linear`: whether the actuator is known to have a rod. Numbers that may be SI units are only taken for them where a word
    says what they are.
    """
    if column.unit and key == "motor_speed" and not any(_takes(column.unit, target) for target in TARGETS[key]):
        return "rpm" if _PER_MINUTE.fullmatch(column.unit.strip()) else column.unit
    if column.unit or column.labels or key in ("run", "group"):
        return column.unit
    values = column.values[np.isfinite(column.values)]
    if values.size < 2:
        return ""
    spread = float(np.ptp(values))
    if key == "time":
        step = float(np.median(np.abs(np.diff(values))))
        return "ms" if 0.5 <= step <= 50.0 and values[0] < 1e9 else ("us" if 50.0 < step <= 5e4 and values[0] < 1e9 else "")
    small = OPEN if _is_nameless(column) else ""
    if key in ("position", "command", "position_demand", "position_error"):
        if linear or _LENGTH.search(column.name):
            return "mm" if spread > 0.5 else small
        return small if spread <= WIDE else "deg" if _ANGLE.search(column.name) else OPEN
    if key == "motor_speed":
        return "rpm" if spread > FAST else small
    if "current" in key:
        return "mA" if spread > 500.0 else small
    return ""
