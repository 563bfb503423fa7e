"""Fidelities as users name them, and where their FMUs are; `ema_fmu_src.fidelities` declares them."""

from pathlib import Path

from ema_fmu_src.fidelities import FIDELITIES, Fidelity
from harness.errors import HarnessError, unknown

FMU_DIR = Path(__file__).resolve().parent.parent / "fmus"
"""Where `ema build` puts the FMUs and every command looks for them."""


def file_stem(name: str) -> str:
    """The name of a fidelity, or of a schedule of several, as part of a file's name."""
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


def parse_fidelity(text: str, option: str) -> Fidelity:
    """The one fidelity that `text`, given for `option`, names; HarnessError for none, several, or an unknown one."""
    found = parse_fidelities(text)
    if len(found) != 1:
        raise HarnessError(f"{option} {text}: one fidelity is needed, of {', '.join(FIDELITIES)}")
    return found[0]
