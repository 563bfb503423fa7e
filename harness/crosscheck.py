"""Makes the reference results that come with the FMUs: the paper's trial SIN, laid out as the FMI cross-check asks."""

from pathlib import Path

import fmpy
import numpy as np

from ema_fmu_src import ports
from ema_fmu_src.fidelities import MODELS, fmu_name
from ema_fmu_src.fmu import crosscheck
from ema_fmu_src.fmu.description import DEFAULT_TOLERANCE
from harness.errors import HarnessError
from harness.files import results
from harness.trials import Trial, trial

INPUT_EVERY, OUTPUT_EVERY = 20, 100
"""In communication steps: inputs every 2 ms, between which an importer interpolates; results every 10 ms, enough to show a
broken import."""


def make(fmus: Path, out: Path) -> list[Path]:
    """Fly SIN with each FMU in the folder `fmus`; write NAME_in.csv, NAME_ref.csv, NAME_ref.opt into `out`.

    `fmpy.simulate_fmu` flies from the inputs as written, so that any importer can repeat it. Returns the paths. HarnessError
    if FMPy cannot fly an FMU, or if `out` cannot be written.
    """
    results.prepare(out)
    flown = trial("SIN")
    written = []
    for model in MODELS:
        stimuli, expected, options = crosscheck.paths(model, out)
        results.write(stimuli, _inputs(flown))
        results.write(expected, _fly(fmus / fmu_name(model), stimuli, flown))
        results.write(options, _options(flown))
        written += [stimuli, expected, options]
    return written


def _inputs(flown: Trial) -> str:
    times = flown.time[::INPUT_EVERY]
    held = {port.name: np.full(len(times), port.start) for port in ports.INPUTS}
    inputs = held | {name: values[::INPUT_EVERY] for name, values in flown.inputs.items()}
    return results.csv_text({"time": times, **inputs}, quoted=True)


def _fly(fmu: Path, stimuli: Path, flown: Trial) -> str:
    names = [port.name for port in ports.OUTPUTS]
    try:
        run = fmpy.simulate_fmu(
            str(fmu),
            start_time=flown.time[0],
            stop_time=flown.time[-1],
            output_interval=flown.step,
            relative_tolerance=DEFAULT_TOLERANCE,
            input=fmpy.util.read_csv(str(stimuli)),
            output=names,
        )
    except Exception as error:  # noqa: BLE001 - FMPy raises plain Exceptions
        raise HarnessError(f"{fmu}: cannot be flown by FMPy: {error}") from None
    return results.csv_text({name: run[name][::OUTPUT_EVERY] for name in ("time", *names)}, quoted=True)


def _options(flown: Trial) -> str:
    """What the results were made with; there is no absolute tolerance in FMI 2.0."""
    lines = {
        "StartTime": f"{flown.time[0]:g}",
        "StopTime": f"{flown.time[-1]:g}",
        "StepSize": f"{flown.step:g}",
        "RelTol": f"{DEFAULT_TOLERANCE:g}",
        "SolverMethod": "FixedStep",
        "OutputIntervalLength": f"{OUTPUT_EVERY * flown.step:g}",
    }
    return "".join(f"{name},{value}\n" for name, value in lines.items())
