"""Where things lie in the twins' flat arrays `v` and `x`, made from names.

`v` holds the variables of `ports.VARIABLES`, and `port` their places under their own names: `v[port.fault.N_a]`. `x` is made
of blocks of states; whoever needs a state declares it, with its unit and its meaning, and `places` says where the states of
a block lie: `x[clock.tick]`. Both are constants to numba.

What a twin remembers of its motion comes last in `x`, and twice: as it is now and, while a communication point lies within
a step of the twin's own, as it was at that step's beginning (see `host`).
"""

from collections.abc import Mapping, Sequence
from types import ModuleType
from typing import Any, NamedTuple

from .. import ports


class State(NamedTuple):
    """One place in `x`."""

    name: str
    unit: str
    meaning: str


class Moving(NamedTuple):
    """The part of `x` that is kept twice: its first place, and its size."""

    first: int
    size: int


def namespace(name: str, values: Mapping[str, Any]) -> Any:
    """Names for numbers, as a module: numba takes a module's attributes for constants.

    A named tuple it would build anew wherever one of its fields is read: what reads many takes twice as long to compile.
    """
    made = ModuleType(name)
    vars(made).update(values)
    return made


def places(block: str, states: Sequence[State], *, first: int = 0) -> Any:
    """Places of `states` in `x` by name, one after the other from `first` on."""
    return namespace(block, {state.name: first + place for place, state in enumerate(states)})


def whole(once: Sequence[State], moving: Sequence[State]) -> tuple[State, ...]:
    """All places of `x` in order: the states kept once, those that move, and these again as they were."""
    return (*once, *moving, *(State(f"before.{name}", unit, meaning) for name, unit, meaning in moving))


def _by_name(block: str, references: Mapping[str, int]) -> Any:
    """Value references by name, nested as the dots in the names say."""
    groups: dict[str, dict[str, int]] = {}
    for name, reference in references.items():
        head, _, tail = name.partition(".")
        groups.setdefault(head, {})[tail] = reference
    return namespace(block, {name: group[""] if "" in group else _by_name(name, group) for name, group in groups.items()})


port = _by_name("port", ports.INDEX)
"""Place in `v` of each variable: the port `motor.K_e` is `port.motor.K_e`."""
