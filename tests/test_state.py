"""FMU states of the native runtime: they hold everything, travel between processes, and foreign bytes are refused."""

import ctypes
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from fmi import ERROR, OUTPUT_REALS, STEP, Instance, refused

SAVED_AT = 0.7137  # s: no tick of the controller and no whole step
CONTINUE = """
import sys, tempfile
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from fmi import OUTPUT_REALS, Instance
with tempfile.TemporaryDirectory() as folder:
    instance = Instance(Path(sys.argv[2]), Path(folder))
    instance.start()
    instance.fmu.setFMUstate(instance.fmu.deSerializeFMUstate(sys.stdin.buffer.read()))
    for k in range(30):
        instance.step(0.7137 + k * 1e-4)
        print(*[value.hex() for value in instance.fmu.getReal(OUTPUT_REALS)])
    instance.close()
"""


@pytest.fixture(params=["native"])
def runtime(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def to_saved_at(instance: Instance) -> None:
    instance.start(command=0.1)
    instance.run(0, 5000)
    instance.set("command", -0.3)
    instance.set("fault.friction", 1.7)
    instance.run(5000, 7136)
    instance.step(0.7136, 5e-5)
    instance.step(0.71365, 5e-5)


def go_on(instance: Instance) -> list[str]:
    rows = []
    for k in range(30):
        instance.step(SAVED_AT + k * STEP)
        rows.append(" ".join(value.hex() for value in instance.fmu.getReal(OUTPUT_REALS)))
    return rows


def test_a_state_between_ticks_goes_on_here_and_in_another_process(instance: Instance, built: dict[str, Path]) -> None:
    to_saved_at(instance)
    state = instance.fmu.getFMUstate()
    data = instance.fmu.serializeFMUstate(state)
    first = go_on(instance)
    instance.set("command", 0.4)
    instance.step(SAVED_AT + 30 * STEP, 0.01)
    instance.fmu.setFMUstate(state)
    assert go_on(instance) == first
    model = instance.fmu.modelIdentifier.removeprefix("EMA_")
    arguments = [sys.executable, "-c", CONTINUE, str(Path(__file__).parent), str(built[model])]
    done = subprocess.run(arguments, input=data, capture_output=True, check=True)
    assert done.stdout.decode().splitlines() == first
    instance.fmu.freeFMUstate(state)


def test_a_state_can_be_written_over(instance: Instance) -> None:
    instance.start()
    state = instance.fmu.getFMUstate()
    before = state.value
    instance.run(0, 10)
    instance.fmu.fmi2GetFMUstate(instance.fmu.component, ctypes.byref(state))
    assert state.value == before
    first = instance.run(10, 20)
    instance.fmu.setFMUstate(state)
    assert instance.run(10, 20) == first
    instance.fmu.freeFMUstate(state)
    assert state.value is None


def test_foreign_truncated_and_damaged_bytes_are_refused(open_fmu: Callable[..., Instance]) -> None:
    elf, lf = open_fmu("ELF"), open_fmu("LF")
    for one in (elf, lf):
        one.start()
        one.run(0, 5)
    state = elf.fmu.getFMUstate()
    data = elf.fmu.serializeFMUstate(state)
    refused(ERROR, lf.fmu.deSerializeFMUstate, data)
    assert "of another FMU" in lf.messages[-1][1]
    refused(ERROR, lf.fmu.setFMUstate, state)
    for size in (0, 1, 40, len(data) - 1):
        refused(ERROR, elf.fmu.deSerializeFMUstate, data[:size])
        assert f"{size} bytes" in elf.messages[-1][1]
    for place in range(0, len(data), 13):
        damaged = bytearray(data)
        damaged[place] ^= 0x40
        refused(ERROR, elf.fmu.deSerializeFMUstate, bytes(damaged))
        assert "refused" in elf.messages[-1][1]
    elf.fmu.setFMUstate(elf.fmu.deSerializeFMUstate(data))
    elf.run(5, 10)
    lf.run(5, 10)
