"""The one declaration of every fidelity: the model it is, what makes it that fidelity, how its curves are drawn.

A model has an FMU of its own, EMA_<model>.fmu; a fidelity is a model with some parameters set. File names, orders, titles,
colours and default lists are made from this module: a new fidelity of an existing model is one more row of `FIDELITIES`
and nothing else. Pure data, beside `ports`: no twin is imported, so that whoever reads the table compiles nothing.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field


def fmu_name(model: str) -> str:
    """File name of the FMU of `model`."""
    return f"EMA_{model}.fmu"


@dataclass(frozen=True)
class Fidelity:
    """One fidelity.

    `model` names its twin and its FMU; `parameters` (port name -> value in the port's unit) select it among the fidelities
    of that model. The fidelity that is named after its model sets none, and its `title` is also the FMU's. `rank` orders the
    fidelities by how much they model, 1 the highest. `colour` (hexadecimal) and `dash` (Plotly's name) are those of its
    curves.
    """

    name: str
    model: str
    title: str
    rank: int
    colour: str
    dash: str
    parameters: dict[str, float] = field(default_factory=dict)

    @property
    def fmu(self) -> str:
        """File name of its FMU."""
        return fmu_name(self.model)


FIDELITIES: dict[str, Fidelity] = {
    fidelity.name: fidelity
    for fidelity in (
        Fidelity(
            "HF",
            "HF",
            "High fidelity: switching inverter, hysteresis current control, star-connected three-phase PMSM",
            rank=1,
            colour="#1f6fd6",
            dash="solid",
        ),
        Fidelity(
            "ELF",
            "ELF",
            "Enhanced low fidelity: three phases, no switching; with coupled saturation on request (ELF+)",
            rank=3,
            colour="#d65a1f",
            dash="dash",
        ),
        Fidelity(
            "ELF+",
            "ELF",
            "Enhanced low fidelity with coupled saturation: averaged inverter, star point kept",
            rank=2,
            colour="#16935b",
            dash="dash",
            parameters={"driver.coupled_saturation": 1.0},
        ),
        Fidelity("LF", "LF", "Low fidelity: equivalent single phase", rank=4, colour="#9a4fc2", dash="dashdot"),
    )
}
"""By name, in the order in which they are listed."""

MODELS: tuple[str, ...] = tuple(dict.fromkeys(fidelity.model for fidelity in FIDELITIES.values()))
"""One FMU each."""


def highest(names: Iterable[str]) -> str:
    """The fidelity of the highest rank among `names`."""
    return min(names, key=lambda name: FIDELITIES[name].rank)


REFERENCE = FIDELITIES[highest(FIDELITIES)]
"""What the others are compared with unless another is named."""
SURROGATE = FIDELITIES["ELF+"]
"""What stands in for the reference where many runs are needed and none is named: identification, monitoring, campaigns."""
