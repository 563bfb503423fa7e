"""What a master adds to the FMU's own time in a communication step: ours and `fmpy.simulate_fmu`, same outputs recorded.

Our loop alone is timed with functions that do nothing in place of the FMU's. The rest of a run with the FMU is the FMU's own
time, and the rest of FMPy's run is FMPy's share.
"""

import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from numba import cfunc, types

from ema_fmu_src import ports
from harness.fidelity import FIDELITIES
from harness.flight import calls, master
from harness.flight.twin import Twin
from harness.parameters import merged

STEPS, STEP = 5000, 1e-4
OUTPUTS = [port.name for port in ports.OUTPUTS if port.kind == "Real"]


@dataclass(frozen=True)
class Overhead:
    """Seconds a communication step: of the FMU, the compiled master and FMPy's loop; whether all outputs are identical."""

    fidelity: str
    fmu: float
    master: float
    fmpy: float
    identical: bool

    def as_dict(self) -> dict[str, object]:
        return asdict(self) | {"ratio": self.fmpy / self.master}


@cfunc(types.int32(types.intp, types.intp, types.intp, types.intp))
def _no_exchange(component: int, references: int, n: int, values: int) -> int:
    return 0


@cfunc(types.int32(types.intp, types.float64, types.float64, types.int32))
def _no_step(component: int, at: float, size: float, flag: int) -> int:
    return 0


def _median(run: Callable[[], float], repeats: int) -> float:
    return statistics.median(run() for _ in range(repeats))


class _Nothing:
    """Stands in for FMPy's slave: its functions do nothing."""

    component = 0

    class dll:
        pass


for _name in calls.CALLS:
    setattr(_Nothing.dll, _name, (_no_step if _name == "fmi2DoStep" else _no_exchange).ctypes)


def measure(fmus: Path, fidelity: str, *, repeats: int = 5) -> Overhead:
    """Measure one fidelity with the FMU in the folder `fmus`: STEPS steps at a constant command, every Real output recorded.

    Times are medians of `repeats` runs.
    """
    chosen = FIDELITIES[fidelity]
    start: dict[str, Any] = {"command": 0.1, **merged(chosen)}
    with Twin(fmus / chosen.fmu) as twin:
        command = master.Stimuli(master.ValueReferences(real=[ports.INDEX["command"]]), np.full((STEPS + 1, 1), 0.1))
        wanted = master.ValueReferences(real=[ports.INDEX[name] for name in OUTPUTS])
        recorded: list[np.ndarray] = []

        def ours() -> float:
            slave = twin.begin(merged(chosen), {"command": 0.1})
            run = master.run(slave, start=0.0, step=STEP, stimuli=command, wanted=wanted)
            recorded.append(run.outputs)
            return run.wall / STEPS

        def nothing() -> float:
            slave: Any = _Nothing()
            return master.run(slave, start=0.0, step=STEP, stimuli=command, wanted=wanted).wall / STEPS

        total, alone = _median(ours, repeats), _median(nothing, repeats)
    folder = fmpy.extract(str(fmus / chosen.fmu))
    description = fmpy.read_model_description(folder)
    theirs: list[Any] = []

    def fmpys() -> float:
        began = time.perf_counter()
        theirs.append(_simulate(folder, description, start, STEPS))
        return time.perf_counter() - began

    _simulate(folder, description, start, 1)
    setup = _median(lambda: _timed(folder, description, start), repeats)
    loop = (_median(fmpys, repeats) - setup) / STEPS
    same = all(np.array_equal(theirs[-1][name], recorded[-1][:, column]) for column, name in enumerate(OUTPUTS))
    return Overhead(fidelity, total - alone, alone, loop - (total - alone), same)


def _timed(folder: str, description: Any, start: dict[str, Any]) -> float:
    began = time.perf_counter()
    _simulate(folder, description, start, 1)
    return time.perf_counter() - began


def _simulate(folder: str, description: Any, start: dict[str, Any], steps: int) -> Any:
    return fmpy.simulate_fmu(
        folder,
        model_description=description,
        validate=False,
        stop_time=steps * STEP,
        output_interval=STEP,
        start_values=dict(start),
        output=OUTPUTS,
    )
