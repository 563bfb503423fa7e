"""The four fidelities: which FMU each is, and the parameters that make it so."""

from dataclasses import dataclass, field
from pathlib import Path

from harness.errors import HarnessError, unknown


@dataclass(frozen=True)
class Fidelity:
    """A name in tables, its FMU's file name, and the parameters that select it."""

    name: str
    fmu: str
    parameters: dict[str, float] = field(default_factory=dict)


FIDELITIES = {
    "HF": Fidelity("HF", "EMA_HF.fmu"),
    "ELF": Fidelity("ELF", "EMA_ELF.fmu"),
    "ELF+": Fidelity("ELF+", "EMA_ELF.fmu", {"driver.coupled_saturation": 1.0}),
    "LF": Fidelity("LF", "EMA_LF.fmu"),
}
FMU_DIR = Path(__file__).resolve().parent.parent / "fmus"
"""Where `ema build` puts the FMUs and `ema run` looks for them."""


def file_stem(name: str) -> str:
    """The name of a fidelity, or of a plan of several, as part of a file's name."""
    return name.replace("+", "plus").replace(":", "_").replace("@", "_at_")


def parse_fidelities(text: str) -> list[Fidelity]:
    """Fidelities from a comma-separated list such as "HF,ELF+"; HarnessError for an unknown or missing name."""
    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names:
        raise HarnessError(f"no fidelity given; known: {', '.join(FIDELITIES)}")
    for name in names:
        if name not in FIDELITIES:
            raise unknown("fidelity", name, FIDELITIES)
    return [FIDELITIES[name] for name in dict.fromkeys(names)]
