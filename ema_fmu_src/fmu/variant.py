"""An FMU of a certain actuator: a name, and start values of its own, given as plain data."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field

from .. import ports


@dataclass(frozen=True)
class Variant:
    """What makes the FMUs of one actuator: its `name` ("" for the default one), its `description`, its start values.

    `starts`: name of a parameter or an input -> start value in the port's unit; the rest start as the ports say. `about`:
    further texts that the FMU's record keeps, such as where the actuator came from. `output`: a text that says what the
    ports' units of the user shaft mean at its output, if that is no shaft.
    """

    name: str = ""
    description: str = ""
    starts: Mapping[str, float] = field(default_factory=dict)
    about: Mapping[str, str] = field(default_factory=dict)
    output: str = ""

    def start(self, variable: ports.Variable, model: str) -> float:
        """Start value of `variable` in the twin `model`."""
        return float(self.starts.get(variable.name, variable.start_for(model)))

    def model_name(self, model: str) -> str:
        """The FMU's modelName."""
        return f"EMA_{model} {self.name}".rstrip()

    def title(self, title: str) -> str:
        """The FMU's description, of which the twin's own is `title`."""
        if not self.name:
            return title
        own = f"{self.name} ({self.description})" if self.description else self.name
        return "; ".join(filter(None, [title, f"start values of the actuator {own}", self.output]))

    @property
    def digest(self) -> str:
        """SHA-256 of all that goes into the FMU; "" for the default actuator."""
        if not self.name:
            return ""
        whole = [self.name, self.description, dict(self.starts), dict(self.about), self.output]
        return hashlib.sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest()

    @property
    def record(self) -> dict[str, str]:
        """What the record of an FMU says of its actuator."""
        return {"actuator": self.name, "starts": self.digest, **self.about}


DEFAULT = Variant()
"""The actuator of the ports' defaults."""


def checked(variant: Variant) -> Variant:
    """`variant`; ValueError for a start that is of no parameter or input, or out of the port's range."""
    for name, value in variant.starts.items():
        if name not in ports.INDEX or ports.VARIABLES[ports.INDEX[name]].causality not in ("input", "parameter"):
            raise ValueError(f"the actuator {variant.name}: {name} is no parameter and no input")
        variable = ports.VARIABLES[ports.INDEX[name]]
        low = -float("inf") if variable.minimum is None else variable.minimum
        high = float("inf") if variable.maximum is None else variable.maximum
        if not (low <= value <= high and abs(value) < float("inf")):
            raise ValueError(f"the actuator {variant.name}: {name} = {value:g} is out of range, {low:g} to {high:g}")
    if variant.starts and not variant.name:
        raise ValueError("an actuator with start values of its own needs a name")
    return variant
