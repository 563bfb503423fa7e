"""What a worker does, wherever it runs: it flies batches of cases, with FMUs that are sent by content and stay open."""

import contextlib
import hashlib
import os
import threading
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness import scratch
from harness.campaigns import features
from harness.campaigns.batch import Batch, Result, Shared, blank
from harness.campaigns.names import names
from harness.campaigns.plan import Noise
from harness.errors import HarnessError
from harness.fidelity import Fidelity
from harness.flight.twin import Twin
from harness.parameters import merged
from harness.trials import Trial

Array = NDArray[np.float64]


SUPPLY = float(ports.VARIABLES[ports.INDEX["supply_voltage"]].start)
"""Supply voltage [V] of a run that sets none."""


_own = threading.local()
"""Of this thread: open twins by hash (an instance is used by one thread alone), and the array that runs are written to."""
_shared: dict[str, Shared] = {}
"""Of this process: digest of a campaign -> what its cases share."""


def know(shared: Shared) -> None:
    """Hold what all cases of a campaign share, for the batches that come."""
    _shared[shared.digest] = shared


def forget(digest: str) -> None:
    """Let go of what the cases of a campaign share."""
    _shared.pop(digest, None)


def warm(shared: Shared) -> None:
    """Load the compiled code and the FMUs, by a short run with each fidelity."""
    first = shared.trials[0]
    short = replace(first, inputs={name: series[:2] for name, series in first.inputs.items()})
    for fidelity in shared.fidelities:
        with contextlib.suppress(HarnessError):  # each case will say so
            _fly_case(shared, short, fidelity, {}, 0)


def fly_batch(batch: Batch) -> Result:
    """Fly the cases of `batch`, one after another."""
    shared = _shared[batch.digest]
    result = blank(len(batch), len(shared.outputs), shared.times, len(names(shared.outputs)))
    seconds = 0.0
    for place, case in enumerate(batch.cases):
        trial, fidelity = shared.trials[batch.trial[place]], shared.fidelities[batch.fidelity[place]]
        parameters = dict(zip(batch.names, batch.values[place].tolist(), strict=True))
        try:
            kept, row, wall = _fly_case(shared, trial, fidelity, parameters, case)
        except HarnessError as error:
            result.failures[place] = str(error)
            continue
        except MemoryError:
            result.failures[place] = f"{fidelity.fmu}: no memory is left on the worker for a run of {len(trial.time)} steps"
            continue
        result.values[place], result.features[place] = kept, row
        seconds += wall
    return replace(result, fmu_seconds=seconds)


def _fly_case(
    shared: Shared, trial: Trial, fidelity: Fidelity, parameters: dict[str, float], case: int
) -> tuple[list[Array], list[float], float]:
    """The outputs that are kept, their features, and seconds inside the FMU; HarnessError if the case cannot be flown."""
    recorded = _recorded(shared.outputs)
    twin = _twin(fidelity.fmu, *shared.fmus[fidelity.fmu])
    buffer = _buffer((len(trial.inputs["command"]), len(recorded)))
    run, wall = twin.record(trial, merged(fidelity, parameters), recorded, into=buffer)
    columns = {port.name: shared.output.outside(port.name, run[:, column]) for column, port in enumerate(recorded)}
    at_rate = {name: np.ascontiguousarray(series[:: shared.every]) for name, series in columns.items()}
    kept = _noisy({name: at_rate[name] for name in shared.outputs}, shared.noise, [shared.seed, case])
    seen = at_rate | kept | {"command": shared.output.outside("command", trial.inputs["command"][:: shared.every])}
    supply = trial.inputs.get("supply_voltage", parameters.get("supply_voltage", SUPPLY))
    pairs = parameters.get("motor.p", features.PAIRS)
    row = features.features(kept, seen, columns, supply, step=trial.step, pairs=pairs)
    if not np.isfinite(row).all():  # they are made of all that is kept
        raise HarnessError(f"{fidelity.fmu}: an output is no finite number")
    return list(kept.values()), row, wall


def _recorded(outputs: tuple[str, ...]) -> list[ports.Variable]:
    """The outputs that are kept or that features need: Reals first, then Booleans."""
    wanted = [port for port in ports.OUTPUTS if port.name in outputs or port.name in features.NEEDED]
    return sorted(wanted, key=lambda port: port.kind == "Boolean")


def _noisy(kept: dict[str, Array], noise: Mapping[str, Noise], seed: list[int]) -> dict[str, Array]:
    """The outputs with their noise; the same for the same seed, whatever else is kept and wherever the case is flown."""
    noisy = {}
    for name, series in kept.items():
        if name in noise:
            sigma = noise[name].sigma * (float(np.ptp(series)) if noise[name].relative else 1.0)
            rng = np.random.default_rng([*seed, ports.INDEX[name]])
            noisy[name] = series + sigma * rng.standard_normal(len(series))
        else:
            noisy[name] = series
    return noisy


def _buffer(shape: tuple[int, int]) -> Array:
    """The array that a run is written to; the same one again for the same shape."""
    buffer: Array = vars(_own).setdefault("buffer", np.empty((0, 0)))
    if buffer.shape != shape:
        buffer = _own.buffer = np.empty(shape)
    return buffer


def _twin(name: str, digest: str, content: bytes) -> Twin:
    """The open twin of the FMU `name`, by its content."""
    twins: dict[str, Twin] = vars(_own).setdefault("twins", {})
    if digest not in twins:
        if hashlib.sha256(content).hexdigest() != digest:
            raise HarnessError(f"the FMU that came is not the one that was sent: its SHA-256 is not {digest[:12]}...")
        with scratch.folder("campaign") as folder:
            try:
                path = folder / name
                path.write_bytes(content)
                twins[digest] = Twin(path)
            except OSError as error:
                raise HarnessError(f"worker {os.getpid()}: {folder} cannot be written: {error.strerror}") from None
    return twins[digest]
