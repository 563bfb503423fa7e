"""What the page asks for: a query, held to the rules of the command line, and what is to be flown for it.

Everything in it is a text, as on the command line: `trial=SIN4&fidelity=ELF%2B,LF&set=fault.friction%3D1.5&residuals=1`.
The address of the page is such a query too, so that a link brings back what is shown.
"""

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, replace
from urllib.parse import urlencode

from werkzeug.datastructures import MultiDict

from ema_fmu_src.fidelities import FIDELITIES, MODELS, REFERENCE, Fidelity, highest
from harness.actuators.actuator import Actuator
from harness.actuators.doubts import unstated_end_stop
from harness.actuators.read import library, read_actuator
from harness.errors import unknown
from harness.fidelity import parse_fidelities
from harness.parameters import check_drive, check_together, parse_settings
from harness.show.live.kept import MARK, Kept
from harness.show.live.refused import Refused
from harness.trials import BUILT_IN, Trial, trial

LOWER = [name for name in FIDELITIES if name != REFERENCE.name]
"""Fidelities that follow a slider at once; the reference takes longer."""
SHOWN_FIRST = tuple(
    highest(name for name in LOWER if FIDELITIES[name].model == model) for model in MODELS if model != REFERENCE.model
)
"""Of these, the highest of each model."""
KEYS = ("trial", "actuator", "fidelity", "set", "residuals")
MOST_SETTINGS = 64
LONGEST_TEXT = 200
"""Characters of one value."""


@dataclass(frozen=True)
class Wish:
    """A query, taken apart; `trial`, `actuator`: names or tokens of uploads; `actuator` "" is the server's own."""

    trial: str = "SIN4"
    fidelities: tuple[str, ...] = SHOWN_FIRST
    actuator: str = ""
    settings: tuple[str, ...] = ()
    residuals: bool = False

    @property
    def query(self) -> str:
        """The query that asks for it; what is as at first is left out."""
        first = Wish()
        parts = [("trial", self.trial)] if self.trial != first.trial else []
        parts += [("fidelity", ",".join(self.fidelities))] if self.fidelities != first.fidelities else []
        parts += [("actuator", self.actuator)] if self.actuator else []
        parts += [("set", setting) for setting in self.settings]
        parts += [("residuals", "1")] if self.residuals else []
        return urlencode(parts)


def wish_of(query: MultiDict[str, str]) -> Wish:
    """The wish that a query states; HarnessError for what is unknown, given twice, too long or too much."""
    for key in query:
        if key not in KEYS:
            raise unknown("key in the query:", key[:LONGEST_TEXT], KEYS)
        values = query.getlist(key)
        if key != "set" and len(values) > 1:
            raise Refused(f"{key} is given {len(values)} times; once is needed")
        for value in values:
            if len(value) > LONGEST_TEXT:
                raise Refused(f"{key} has {len(value)} characters; {LONGEST_TEXT} are taken")
    settings = tuple(query.getlist("set"))
    if len(settings) > MOST_SETTINGS:
        raise Refused(f"{len(settings)} parameters are set; {MOST_SETTINGS} are taken")
    names = [setting.partition("=")[0].strip() for setting in settings]
    for name in names:
        if names.count(name) > 1:
            raise Refused(f"{name} is set {names.count(name)} times; once is needed: by its slider or among the parameters")
    first = Wish()
    residuals = query.get("residuals", "0")
    if residuals not in ("0", "1"):
        raise Refused(f"residuals={residuals}: 0 or 1 is needed")
    fidelities = [found.name for found in parse_fidelities(query.get("fidelity", ",".join(first.fidelities)))]
    name = query.get("trial", first.trial)
    return Wish(
        name if MARK in name else name.upper(),
        tuple(name for name in FIDELITIES if name in fidelities),
        query.get("actuator", ""),
        settings,
        residuals == "1",
    )


@dataclass(frozen=True)
class Flight:
    """What is to be flown: `parameters` are those of the actuator, over which `settings` win.

    `command`: the command line that flies it; `remarks`: a line each for what is asked for and does nothing, or is doubtful.
    """

    trial: Trial
    fidelities: tuple[Fidelity, ...]
    actuator: Actuator
    settings: Mapping[str, float]
    command: str
    remarks: tuple[str, ...] = ()

    @property
    def parameters(self) -> dict[str, float]:
        """All that the FMUs are set to."""
        return {**self.actuator.parameters, **self.settings}

    @property
    def reference(self) -> str:
        """Name of the highest fidelity, with which the others are compared."""
        return highest(each.name for each in self.fidelities)

    @property
    def alone(self) -> "Flight":
        """The same with the highest fidelity alone."""
        return replace(self, fidelities=(FIDELITIES[self.reference],))


@dataclass(frozen=True)
class Hangar:
    """What the page may choose from: `own`, the server's actuator, which the command line calls `named`; and uploads."""

    own: Actuator
    named: str | None
    kept: Kept

    def actuators(self) -> dict[str, str]:
        """What a query calls each actuator -> how it is listed; the server's own first."""
        others = [name for name in library() if name != (self.named or self.own.name)]
        return {"": self.own.name, **{name: name for name in others}, **self.kept.named("actuator")}

    def trials(self) -> dict[str, str]:
        """The same of trials."""
        return {**{name: name for name in BUILT_IN}, **self.kept.named("trial")}

    def actuator(self, name: str) -> Actuator:
        """The actuator that a query calls `name`; never a file of this machine that is no upload. HarnessError if none."""
        if name == "":
            return self.own
        if MARK in name:
            return self.kept.actuator(name)
        if name not in library():
            raise unknown("actuator", name, library())
        return read_actuator(name)

    def checked(self, wish: Wish) -> Actuator:
        """The actuator of `wish`, all of which is there and in range, without reading a trial; HarnessError if not."""
        actuator = self.actuator(wish.actuator)
        _ = self.kept.get("trial", wish.trial) if MARK in wish.trial else trial(wish.trial)
        _settings(wish, actuator)
        return actuator

    def flight(self, wish: Wish) -> Flight:
        """What is to be flown for `wish`; HarnessError as the command line refuses it."""
        actuator = self.actuator(wish.actuator)
        flown = self.kept.trial(wish.trial, actuator) if MARK in wish.trial else trial(wish.trial)
        settings = _settings(wish, actuator)
        parameters = {**actuator.parameters, **settings}
        unused = [
            f"{flown.name} gives its own {name}: the {settings[name]:g} that is set is not used"
            for name in flown.inputs
            if name in settings
        ]
        remarks = (*actuator.warnings, *unstated_end_stop(parameters, actuator.output), *unused)
        fidelities = tuple(FIDELITIES[name] for name in wish.fidelities)
        return Flight(flown, fidelities, actuator, settings, self._command(wish, flown), remarks)

    def _command(self, wish: Wish, flown: Trial) -> str:
        words = ["ema", "run"]
        words += ["--trial-file", wish.trial.partition(MARK)[0]] if MARK in wish.trial else [flown.name]
        words += ["--fidelity", ",".join(wish.fidelities), "--reference", highest(wish.fidelities)]
        actuator = wish.actuator.partition(MARK)[0] or self.named
        words += ["--actuator", actuator] if actuator else []
        return shlex.join([*words, *(part for setting in wish.settings for part in ("--set", setting))])


def _settings(wish: Wish, actuator: Actuator) -> dict[str, float]:
    settings = parse_settings(list(wish.settings))
    check_together({**actuator.parameters, **settings}, "--set")
    check_drive({**actuator.parameters, **settings}, "--set")
    return settings
