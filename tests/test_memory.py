"""The memory of the twins: every place in `x` has one name, and `v` is addressed by the ports' own names."""

import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from ema_fmu_src import ports
from ema_fmu_src.twins import SLOPES, STALE, TOLERANCE, TWINS, elf, hf, host, layout, lf
from ema_fmu_src.twins.memory import Moving, port

TWIN_OF = {"HF": hf, "ELF": elf, "LF": lf}
BLOCKS = (host.told, host.clock, host.partial, layout.derived, layout.law, layout.since, layout.now)
PLAIN = """
import json
from flight import Flight
rows = {}
for fidelity in ("HF", "ELF+", "LF"):
    flight = Flight(fidelity, {"fault.N_a": 0.8, "fault.zeta": 0.1, "supply_voltage": 30.0})
    flown = flight.fly(lambda t: 0.02, n=12, step=1.3e-4)
    rows[fidelity] = [float(value).hex() for name in sorted(flown) for value in flown[name]]
print(json.dumps(rows))
"""


def names(block: ModuleType) -> dict[str, int]:
    return {name: place for name, place in vars(block).items() if isinstance(place, int)}


def test_ports_lie_at_their_value_references() -> None:
    for name, reference in ports.INDEX.items():
        place = port
        for part in name.split("."):
            place = getattr(place, part)
        assert place == reference


@pytest.mark.parametrize("model", ports.MODELS)
def test_every_place_has_one_name(model: str) -> None:
    """The blocks in order make up the part kept once and the part that moves; this comes again as it was."""
    module = TWIN_OF[model]
    blocks = (*BLOCKS, module.own) if module is hf else BLOCKS
    found = [(place, name) for block in blocks for name, place in names(block).items()]
    first, size = module.MOVING
    assert [place for place, _ in sorted(found)] == list(range(first + size))
    assert [name for _, name in sorted(found)] == [state.name for state in module.STATES[: first + size]]
    before = [f"before.{state.name}" for state in module.STATES[first : first + size]]
    assert [state.name for state in module.STATES[first + size :]] == before
    assert TWINS[model].n_states == len(module.STATES) == first + 2 * size
    assert all(state.meaning for state in module.STATES)
    assert isinstance(module.MOVING, Moving)


def test_what_the_host_writes_lies_apart() -> None:
    assert len({STALE, TOLERANCE, *SLOPES.values()}) == 2 + len(ports.INPUTS)
    assert set(SLOPES) == {variable.name for variable in ports.INPUTS}


def test_plain_python_gives_the_bits_of_the_compiled_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    """Through samples, whole steps and steps on trial."""
    flown = []
    for disabled in ("0", "1"):
        monkeypatch.setenv("NUMBA_DISABLE_JIT", disabled)
        command = [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}){PLAIN}"]
        flown.append(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    assert flown[0] == flown[1] != ""
