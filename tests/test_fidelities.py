"""The one declaration of the fidelities, and what is made from it."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from ema_fmu_src import ports
from ema_fmu_src.fidelities import FIDELITIES, MODELS, REFERENCE, SURROGATE, fmu_name, highest
from ema_fmu_src.twins import TWINS
from harness.parameters import merged
from harness.show.curves import lines_of


def test_the_table_is_consistent() -> None:
    """Names are the keys, ranks are an order, every model has a fidelity of its own name, which sets nothing."""
    assert all(name == fidelity.name for name, fidelity in FIDELITIES.items())
    assert len({fidelity.rank for fidelity in FIDELITIES.values()}) == len(FIDELITIES)
    for model in MODELS:
        assert FIDELITIES[model].model == model and not FIDELITIES[model].parameters
        assert FIDELITIES[model].title == TWINS[model].title and FIDELITIES[model].fmu == fmu_name(model)
    assert tuple(TWINS) == MODELS == ports.MODELS
    selections = [(fidelity.model, tuple(fidelity.parameters.items())) for fidelity in FIDELITIES.values()]
    assert len(set(selections)) == len(FIDELITIES)
    for fidelity in FIDELITIES.values():
        assert fidelity.parameters.keys() <= {port.name for port in ports.PARAMETERS}
        assert re.fullmatch("#[0-9a-f]{6}", fidelity.colour) and fidelity.title


def test_the_reference_is_the_highest_and_the_surrogate_is_not_the_reference() -> None:
    assert REFERENCE.rank == min(fidelity.rank for fidelity in FIDELITIES.values())
    assert SURROGATE in FIDELITIES.values() and SURROGATE != REFERENCE
    assert highest([SURROGATE.name, REFERENCE.name]) == REFERENCE.name


def test_the_parameters_of_a_fidelity_win() -> None:
    """With other values it would be another fidelity; what is given is left as it is."""
    given = {"driver.coupled_saturation": 0.0, "fault.friction": 2.0}
    assert merged(FIDELITIES["ELF+"], given) == {"driver.coupled_saturation": 1.0, "fault.friction": 2.0}
    assert merged(FIDELITIES["ELF"], given) == given
    assert given["driver.coupled_saturation"] == 0.0 and merged(FIDELITIES["ELF"]) == {}


def test_every_name_has_a_line_and_schedules_have_different_ones() -> None:
    names = [*FIDELITIES, "HF:ELF+@0.6", "ELF+:HF@1.2", "reference"]
    lines = lines_of(names)
    assert list(lines) == names and len({line.colour for line in lines.values()}) == len(names)
    for fidelity in FIDELITIES.values():
        assert (lines[fidelity.name].colour, lines[fidelity.name].dash) == (fidelity.colour, fidelity.dash)
    assert lines_of(f"{n}:HF@1" for n in range(100))["99:HF@1"].colour


@pytest.mark.parametrize(
    "module, absent",
    [
        ("ema_fmu_src.fidelities", ["numba", "numpy", "ema_fmu_src.twins", "ema_fmu_src.physics"]),
        ("harness.comparison", ["plotly", "dash", "fmpy", "numba"]),
        ("harness.files.results", ["plotly", "dash", "fmpy", "numba"]),
        ("harness.budgets", ["plotly", "dash"]),
        ("harness.flight.experiment", ["plotly", "dash"]),
        ("harness.cli", ["plotly", "dash", "fmpy", "numba", "numpy", "scipy", "xarray", "distributed"]),
    ],
)
def test_a_module_does_not_import_what_it_does_not_need(module: str, absent: list[str]) -> None:
    """Comparing needs no figures, and help comes at once: heavy libraries are imported where they are used."""
    program = f"import sys; import {module}; print(*sorted(set({absent!r}) & set(sys.modules)))"
    folder = Path(__file__).resolve().parent.parent
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=folder)
    assert found.stdout.split() == []
