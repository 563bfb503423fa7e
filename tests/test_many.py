"""Many instances of the native FMUs: memory stays flat, threads do not meet."""

import resource
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from fmi import STEP, Instance

from ema_fmu_src import ports

INSTANCES, THREADS = 1000, 8


def resident() -> int:
    """Highest resident memory of this process so far [bytes]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


@pytest.mark.parametrize("model", ports.MODELS)
def test_a_thousand_instances_leave_nothing_behind(fmus: dict[str, Path], tmp_path: Path, model: str) -> None:
    """An instance is some 2 kB; a thousand that leaked, with a state each, would be seen."""
    first = Instance(fmus[model], tmp_path)

    def one() -> None:
        component = first.fmu.component
        first.fmu.instantiate(callbacks=first.callbacks, loggingOn=True)
        first.start()
        first.run(0, 2)
        state = first.fmu.getFMUstate()
        first.fmu.freeFMUstate(state)
        first.fmu.fmi2FreeInstance(first.fmu.component)
        first.fmu.component = component

    for _ in range(50):
        one()
    before = resident()
    for _ in range(INSTANCES):
        one()
    assert resident() - before < 1_000_000
    first.close()


@pytest.mark.parametrize("model", ports.MODELS)
def test_threads_give_what_one_alone_gives(fmus: dict[str, Path], tmp_path: Path, model: str) -> None:
    """Each in its own thread; ctypes lets go of Python's lock in every call."""
    instances = [Instance(fmus[model], tmp_path / str(n)) for n in range(THREADS + 1)]

    def fly(n: int) -> list[list[float]]:
        instance = instances[n]
        instance.start(command=0.01 * (1 + n % THREADS))
        rows = instance.run(0, 300)
        instance.step(300 * STEP, 0.05)
        return [*rows, [instance.get("position")]]

    with ThreadPoolExecutor(THREADS) as pool:
        together = list(pool.map(fly, range(THREADS)))
    assert fly(THREADS) == together[0]  # the ninth instance, alone, under the first one's command
    assert len({str(rows) for rows in together}) == THREADS
    for instance in instances:
        instance.close()
