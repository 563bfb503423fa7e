"""FMU states of the native runtime: they hold everything, travel between processes, and foreign, damaged and forged bytes
are refused."""

import ctypes
import math
import random
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from fmi import ERROR, OUTPUT_REALS, STEP, Instance, refused
from fmpy.fmi1 import FMICallException

from ema_fmu_src import ports
from ema_fmu_src.twins import CLOCK, TWINS

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


HEAD, CHECKSUM_AT = 64, 56
"""Bytes of a serialised state before its numbers: magic, size, GUID, checksum (saved.c)."""
V, AFTER_X = HEAD // 8, ("slope", "slope", "slope", "start", "point", "stop", "tolerance")


def place(model: str, name: str) -> int:
    """Which of the 8-byte words of a serialised state holds a variable, a state of the clock, or what follows them."""
    if name in ports.INDEX:
        return V + ports.INDEX[name]
    first = V + len(ports.VARIABLES)
    if name in CLOCK:
        return first + CLOCK[name]
    return first + TWINS[model].n_states + AFTER_X.index(name.removeprefix("experiment."))


def forged(data: bytes, word: int, value: float) -> bytes:
    """A state with another number in it, and the checksum that makes it look whole."""
    made = bytearray(data)
    struct.pack_into("<d", made, 8 * word, value)
    checksum = 14695981039346656037
    for byte in made[HEAD:]:
        checksum = (checksum ^ byte) * 1099511628211 % 2**64
    struct.pack_into("<Q", made, CHECKSUM_AT, checksum)
    return bytes(made)


@pytest.mark.parametrize(
    "name, value, told",
    [
        *(("step", value, "clock") for value in (0.0, -1e-4, 1e-300, 1e300)),
        ("step", math.nan, "finite"),
        *(("tick", value, "clock") for value in (-1.0, 0.5, 0.0, 2.0**53, 1e300)),
        ("tick", math.nan, "finite"),
        ("tick", math.inf, "finite"),
        *(("per_sample", value, "clock") for value in (0.0, -1.0, 0.5, 1e300)),
        *(("offset", value, "clock") for value in (-1.0, 1.0, 1e300)),
        *((flag, 2.0, "clock") for flag in ("pending", "ramped")),
        *(("next_sample", value, "clock") for value in (-1.0, 0.5, 1e18)),
        ("point", 1e6, "clock"),
        ("experiment.point", 1e6, "clock"),
        ("experiment.point", math.nan, "times"),
        ("experiment.start", math.inf, "times"),
        ("experiment.stop", math.nan, "times"),
        ("experiment.tolerance", 0.0, "tolerance"),
        ("experiment.slope", math.nan, "slopes"),
        ("experiment.slope", 1.0, "slopes"),
        ("solver.step", 1e-300, "range"),
        ("controller.period", math.nan, "range"),
        ("motor.p", 2.5, "range"),
        ("fault.open_switch", 7.0, "range"),
        ("supply_voltage", -1.0, "range"),
        ("motor_speed", math.nan, "finite"),
    ],
)
def test_forged_states_are_refused(instance: Instance, name: str, value: float, told: str) -> None:
    model = instance.fmu.modelIdentifier.removeprefix("EMA_")
    instance.start()
    instance.run(0, 7)
    data = instance.fmu.serializeFMUstate(instance.fmu.getFMUstate())
    refused(ERROR, instance.fmu.deSerializeFMUstate, forged(data, place(model, name), value))
    assert told in instance.messages[-1][1]
    state = instance.fmu.getFMUstate()  # and one in memory, which the host can write to
    ctypes.memmove(state, forged(data, place(model, name), value), len(data))
    refused(ERROR, instance.fmu.setFMUstate, state)
    assert told in instance.messages[-1][1]
    instance.fmu.setFMUstate(instance.fmu.deSerializeFMUstate(data))
    instance.run(7, 10)


def test_no_forged_number_makes_a_step_hang(instance: Instance) -> None:
    """Any number of a state, replaced by any other: it is refused, or a step from it ends."""
    instance.start()
    instance.run(0, 7)
    instance.step(7 * STEP, 3e-5)
    data = instance.fmu.serializeFMUstate(instance.fmu.getFMUstate())
    draw = random.Random(1)
    values = (0.0, -0.0, 5e-324, 1e-300, 1e-9, -1.0, 1.0, 3.0, 1e6, 1e18, 1e300, -1e300, math.nan, math.inf, -math.inf)
    taken, answers = 0, set()
    for word in range(V, len(data) // 8):
        for value in draw.sample(values, 5):
            began = time.monotonic()
            try:
                instance.fmu.setFMUstate(instance.fmu.deSerializeFMUstate(forged(data, word, value)))
                taken += 1
                instance.step(instance.fmu.getRealStatus(2), STEP)
            except FMICallException as error:
                answers.add(error.status)
            assert time.monotonic() - began < 5.0, word
    assert taken > 100 and answers == {ERROR}
    instance.fmu.setFMUstate(instance.fmu.deSerializeFMUstate(data))
    instance.step(7 * STEP + 3e-5)
