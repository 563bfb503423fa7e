"""Random calls, legal and not, through ctypes: no crash, and after any refusal the instance still works.

Truth: a short run after a reset gives, to the last bit, what a fresh instance gives.
"""

import ctypes
import math
import random
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from fmi import OUTPUT_REALS, STEP, Instance
from hypothesis import given, settings
from hypothesis import strategies as st

from ema_fmu_src import ports

CALLS = 70
EXAMPLES = 60
"""CALLS x EXAMPLES x 3 twins = 12,600 calls."""
POOL = [0.0, 1.0, -1.0, 0.1, 1e-4, 3e-5, 1e9, -1e300, math.nan, math.inf, -math.inf, 5e-324]


class Fuzzer:
    """Makes one random call after another on an instance, from a seed."""

    def __init__(self, instance: Instance, seed: int) -> None:
        self.library = ctypes.CDLL(instance.fmu.dll._name)  # function objects of our own beside FMPy's
        self.c = ctypes.c_void_p(instance.fmu.component)
        self.random = random.Random(seed)
        self.time = 0.0
        self.states: list[ctypes.c_void_p] = []
        self.bytes = b""
        self.kinds: list[Callable[[], int]] = [
            self.real, self.real, self.integer, self.boolean, self.string, self.derivatives, self.step, self.step,
            self.step, self.life, self.life, self.life, self.take, self.put, self.free, self.serialise, self.restore,
            self.status, self.log, self.experiment, self.unsupported,
        ]  # fmt: skip

    def call(self, name: str, *arguments: object) -> int:
        """The library's own function, past FMPy's wrappers, which raise on every refusal."""
        function = getattr(self.library, name)
        function.argtypes, function.restype = None, ctypes.c_int
        kinds = {float: ctypes.c_double, int: ctypes.c_size_t}
        return int(function(self.c, *(kinds[type(value)](value) if type(value) in kinds else value for value in arguments)))

    def value(self) -> float:
        return self.random.choice([*POOL, self.random.uniform(-2.0, 2.0)])

    def references(self) -> tuple[ctypes.Array[ctypes.c_uint] | None, int]:
        n = self.random.choice([0, 1, 1, 1, 2, 5])
        if self.random.random() < 0.1:
            return None, n
        pick = [self.random.choice([self.random.randrange(len(ports.VARIABLES) + 2), 2**32 - 1]) for _ in range(n)]
        return (ctypes.c_uint * max(n, 1))(*pick), n

    def _typed(self, kind: type, name: str, convert: Callable[[float], object]) -> int:
        references, n = self.references()
        values = (kind * max(n, 1))(*(convert(self.value()) for _ in range(n)))
        place = None if self.random.random() < 0.1 else values
        return self.call(f"fmi2{self.random.choice(['Set', 'Get'])}{name}", references, n, place)

    def real(self) -> int:
        return self._typed(ctypes.c_double, "Real", float)

    def _small(self, value: float) -> int:
        return int(max(-(2**31), min(2**31 - 1, value))) if math.isfinite(value) else 7

    def integer(self) -> int:
        return self._typed(ctypes.c_int, "Integer", self._small)

    def boolean(self) -> int:
        return self._typed(ctypes.c_int, "Boolean", self._small)

    def string(self) -> int:
        return self._typed(ctypes.c_char_p, "String", lambda value: str(value).encode())

    def derivatives(self) -> int:
        references, n = self.references()
        orders = (ctypes.c_int * max(n, 1))(*(self.random.choice([0, 1, 1, 2]) for _ in range(n)))
        values = (ctypes.c_double * max(n, 1))(*(self.value() for _ in range(n)))
        name = self.random.choice(["fmi2SetRealInputDerivatives", "fmi2GetRealOutputDerivatives"])
        return self.call(name, references, n, orders, values)

    def step(self) -> int:
        time, size = self.time, self.random.choice([STEP, 3e-5, 1e-3])
        if self.random.random() < 0.2:
            time, size = self.value(), self.value()  # a step of 1e9 s is refused: it would take its time
        status = self.call("fmi2DoStep", time, size, 1)
        self.time = time + size if status == 0 else self.time
        return status

    def life(self) -> int:
        name = self.random.choice(["EnterInitializationMode", "ExitInitializationMode", "EnterInitializationMode",
                                   "ExitInitializationMode", "Terminate", "Reset", "CancelStep"])  # fmt: skip
        if name == "Reset":
            self.time = 0.0
        return self.call(f"fmi2{name}")

    def experiment(self) -> int:
        flags = [self.random.randrange(2) for _ in range(2)]
        start = self.random.choice([0.0, 0.0, self.value()])
        status = self.call("fmi2SetupExperiment", flags[0], self.value(), start, flags[1], self.value())
        self.time = start if status == 0 else self.time
        return status

    def take(self) -> int:
        state = self.random.choice([ctypes.c_void_p(), *self.states])
        status = self.call("fmi2GetFMUstate", ctypes.byref(state))
        if status == 0 and state not in self.states:
            self.states.append(state)
        return status

    def put(self) -> int:
        state = self.random.choice([ctypes.c_void_p(), *self.states])
        status = self.call("fmi2SetFMUstate", state)
        last = ctypes.c_double()
        if status == 0 and self.call("fmi2GetRealStatus", 2, ctypes.byref(last)) == 0:
            self.time = last.value
        return status

    def free(self) -> int:
        if not self.states:
            return self.call("fmi2FreeFMUstate", None)
        state = self.states.pop(self.random.randrange(len(self.states)))
        return self.call("fmi2FreeFMUstate", ctypes.byref(state))

    def serialise(self) -> int:
        if not self.states:
            return self.call("fmi2SerializeFMUstate", None, None, 0)
        state = self.random.choice(self.states)
        size = ctypes.c_size_t()
        self.call("fmi2SerializedFMUstateSize", state, ctypes.byref(size))
        buffer = (ctypes.c_char * size.value)()
        given = self.random.choice([size.value, size.value, size.value - 1, 0])
        status = self.call("fmi2SerializeFMUstate", state, buffer, given)
        if status == 0:
            self.bytes = bytes(buffer)
        return status

    def restore(self) -> int:
        data = bytearray(self.bytes)
        if data and self.random.random() < 0.5:
            data[self.random.randrange(len(data))] ^= 1 << self.random.randrange(8)
        size = self.random.choice([len(data), len(data), len(data) // 2])
        state = ctypes.c_void_p()
        status = self.call("fmi2DeSerializeFMUstate", bytes(data), size, ctypes.byref(state))
        if status == 0:
            self.states.append(state)
        return status

    def status(self) -> int:
        kinds: dict[str, type] = dict.fromkeys(["", "Integer", "Boolean"], ctypes.c_int)
        kinds |= {"Real": ctypes.c_double, "String": ctypes.c_char_p}
        name, kind = self.random.choice(list(kinds.items()))
        place = None if self.random.random() < 0.2 else ctypes.byref(kind())
        return self.call(f"fmi2Get{name}Status", self.random.randrange(-1, 6), place)

    def log(self) -> int:
        names = [self.random.choice([b"logAll", b"logStatusError", b"%s%n", b""]) for _ in range(2)]
        array = (ctypes.c_char_p * 2)(*names)
        return self.call("fmi2SetDebugLogging", self.random.randrange(2), self.random.choice([0, 1, 2]), array)

    def unsupported(self) -> int:
        one = (ctypes.c_uint * 1)(3)
        number = (ctypes.c_double * 1)()
        return self.call("fmi2GetDirectionalDerivative", one, 1, one, 1, number, number)

    def run(self, calls: int) -> int:
        """Makes `calls` random calls; returns how many were refused."""
        refused = sum(self.random.choice(self.kinds)() != 0 for _ in range(calls))
        while self.states:
            self.free()
        return refused


@pytest.fixture(params=["native"])
def runtime(request: pytest.FixtureRequest) -> str:
    return str(request.param)


class Last(list[tuple[int, str]]):
    """Keeps the last messages only."""

    def append(self, item: tuple[int, str]) -> None:
        self[:] = [*self[-50:], item]


Fuzzed = dict[str, tuple[Instance, list[list[float]]]]


@pytest.fixture(scope="module")
def fuzzed(fmus: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Fuzzed]:
    """An instance of each twin, and what a short run of it gives when it is fresh."""
    made = {}
    for model, path in fmus.items():
        instance = Instance(path, tmp_path_factory.mktemp(model))
        instance.messages = Last()
        instance.start()
        made[model] = (instance, instance.run(0, 5))
    yield made
    for instance, _ in made.values():
        instance.close()


@pytest.mark.parametrize("model", ports.MODELS)
@settings(max_examples=EXAMPLES, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32))
def test_random_calls(fuzzed: Fuzzed, model: str, seed: int) -> None:
    instance, fresh = fuzzed[model]
    instance.fmu.reset()
    refused = Fuzzer(instance, seed).run(CALLS)
    assert 0 < refused < CALLS
    assert len(OUTPUT_REALS) == len(fresh[0])
    instance.fmu.reset()
    instance.start()
    assert instance.run(0, 5) == fresh
