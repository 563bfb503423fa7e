"""What a variable of the twins is, whichever it is: `ports` lists them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Causality = Literal["input", "output", "local", "parameter"]
Variability = Literal["continuous", "discrete", "fixed", "tunable"]
Kind = Literal["Real", "Integer", "Boolean", "Enumeration"]


@dataclass(frozen=True)
class Variable:
    """One FMI scalar variable, the same in every twin.

    `start` is in `unit`; `start_of` holds the twins whose start differs. `minimum` and `maximum` are inclusive; None
    means unbounded. `unused_by` names the twins that accept the variable but do not act on it. `items`: name -> value of an
    Enumeration, in rising order without gaps. `nominal`: a typical magnitude in `unit`, None where 1 is as good as any.
    `display`: the unit in which people read the variable, if it is not that of all variables of its unit.
    """

    name: str
    causality: Causality
    variability: Variability
    kind: Kind
    unit: str
    start: float
    description: str
    minimum: float | None = None
    maximum: float | None = None
    unused_by: tuple[str, ...] = ()
    start_of: Mapping[str, float] = field(default_factory=dict)
    items: Mapping[str, int] = field(default_factory=dict)
    nominal: float | None = None
    display: str = ""

    def text(self, value: float) -> str:
        """`value` of this variable as people write it: the item of an Enumeration, true or false of a Boolean."""
        if self.kind == "Boolean":
            return "true" if value else "false"
        names = [item for item, number in self.items.items() if number == value]
        return names[0] if names else f"{value:g}"

    def start_for(self, model: str) -> float:
        """Start value in `unit` of this variable in the twin `model` ("HF", "ELF" or "LF")."""
        return self.start_of.get(model, self.start)

    def description_for(self, model: str) -> str:
        """Description with a word on what the twin `model` makes of it."""
        return f"{self.description} (no effect in {model})" if model in self.unused_by else self.description
