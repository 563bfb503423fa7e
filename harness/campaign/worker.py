"""What a Dask worker does: a batch of cases, with FMUs that come by content and stay open."""

import hashlib
import os
import shutil
import tempfile
import threading
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import __version__, ports
from harness.campaign import features
from harness.campaign.plan import Noise
from harness.errors import HarnessError
from harness.fidelity import Fidelity
from harness.trials import Trial
from harness.twin import Twin

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Batch:
    """Cases in a row. `cases`: their numbers; `trial`, `fidelity`: of each, places in `trials` and `fidelities`;
    `parameters` of each; `fmus`: file name -> SHA-256 and content."""

    cases: tuple[int, ...]
    trial: tuple[int, ...]
    fidelity: tuple[int, ...]
    parameters: tuple[dict[str, float], ...]
    trials: tuple[Trial, ...]
    fidelities: tuple[Fidelity, ...]
    fmus: dict[str, tuple[str, bytes]]
    outputs: tuple[str, ...]
    noise: dict[str, Noise]
    every: int
    seed: int


@dataclass(frozen=True)
class Result:
    """`values`, shape (n_cases, n_outputs, n_times), float32; `features` (n_cases, n_features); `failures`: a line for each
    case, empty if it was flown (a failed one's values are NaN); `fmu_seconds`: in the FMUs, all cases."""

    values: NDArray[np.float32]
    features: Array
    failures: list[str]
    fmu_seconds: float


_own = threading.local()
"""Of this thread: open twins by hash (an instance is used by one thread alone), and the array that runs are written to."""


def prepare(batch: Batch) -> str:
    """Fly one step of a batch, so that libraries and compiled code are loaded; the release of this software here."""
    short = [replace(flown, inputs={name: series[:2] for name, series in flown.inputs.items()}) for flown in batch.trials]
    fly(replace(batch, trials=tuple(short), every=1))
    return __version__


def fly(batch: Batch) -> Result:
    """Fly the cases of `batch`, one after another."""
    recorded = _recorded(batch.outputs)
    times = len(batch.trials[0].time[:: batch.every])
    values = np.full((len(batch.cases), len(batch.outputs), times), np.nan, dtype=np.float32)
    found = np.full((len(batch.cases), len(features.names(batch.outputs))), np.nan)
    failures, seconds = [""] * len(batch.cases), 0.0
    for place, case in enumerate(batch.cases):
        flown, fidelity = batch.trials[batch.trial[place]], batch.fidelities[batch.fidelity[place]]
        parameters = batch.parameters[place] | fidelity.parameters
        try:
            twin, buffer = _twin(*batch.fmus[fidelity.fmu]), _buffer((len(flown.time), len(recorded)))
            run, wall = twin.record(flown, parameters, recorded, into=buffer)
            if not np.isfinite(run.sum()):
                raise HarnessError(f"{fidelity.fmu}: an output is no finite number")
        except HarnessError as error:
            failures[place] = str(error)
            continue
        columns = {port.name: run[:, column] for column, port in enumerate(recorded)}
        held = {"command": flown.inputs["command"], "supply_voltage": _supply(flown, parameters)}
        at_rate = {name: np.ascontiguousarray(series[:: batch.every]) for name, series in (columns | held).items()}
        kept = _noisy({name: at_rate[name] for name in batch.outputs}, batch.noise, [batch.seed, case])
        values[place] = np.array(list(kept.values()))
        pairs = parameters.get("motor.p", features.PAIRS)
        found[place] = features.features(kept, at_rate | kept, columns | held, step=flown.step, pairs=pairs)
        seconds += wall
    return Result(values, found, failures, seconds)


def _recorded(outputs: tuple[str, ...]) -> list[ports.Variable]:
    """The outputs that are kept or that features need: Reals first, then Booleans."""
    wanted = [port for port in ports.OUTPUTS if port.name in outputs or port.name in features.NEEDED]
    return sorted(wanted, key=lambda port: port.kind == "Boolean")


def _supply(flown: Trial, parameters: Mapping[str, float]) -> Array:
    name = "supply_voltage"
    if name in flown.inputs:
        return flown.inputs[name]
    held = parameters.get(name, ports.VARIABLES[ports.INDEX[name]].start)
    return np.broadcast_to(held, len(flown.inputs["command"]))


def _noisy(kept: dict[str, Array], noise: Mapping[str, Noise], seed: list[int]) -> dict[str, Array]:
    """The outputs with their noise; the same for the same seed, whatever else is kept and wherever it is flown."""
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
    """The array for a run, the same again for the same shape."""
    buffer: Array = vars(_own).setdefault("buffer", np.empty((0, 0)))
    if buffer.shape != shape:
        buffer = _own.buffer = np.empty(shape)
    return buffer


def _twin(digest: str, content: bytes) -> Twin:
    """The open twin of an FMU by its content."""
    twins: dict[str, Twin] = vars(_own).setdefault("twins", {})
    if digest not in twins:
        if hashlib.sha256(content).hexdigest() != digest:
            raise HarnessError(f"the FMU that came is not the one that was sent: its SHA-256 is not {digest[:12]}...")
        folder = Path(tempfile.mkdtemp(prefix="ema_campaign_"))
        try:
            path = folder / f"{digest[:12]}.fmu"
            path.write_bytes(content)
            twins[digest] = Twin(path)
        except OSError as error:
            raise HarnessError(f"worker {os.getpid()}: {folder} cannot be written: {error.strerror}") from None
        finally:
            shutil.rmtree(folder, ignore_errors=True)
    return twins[digest]
