"""What runs are flown with, and what these runs may tell: a bench that opens models and judges for each."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ema_fmu_src import ports
from ema_fmu_src.fidelities import FIDELITIES, REFERENCE, Fidelity
from harness.actuators.actuator import Actuator
from harness.calibration.between import decided
from harness.errors import HarnessError
from harness.flight.twin import Twin
from harness.inference.flights import Flights
from harness.inference.measured import Measured
from harness.inference.prior import Prior, prior_of
from harness.inference.run import Run, usual_load
from harness.parameters import merged

SCALE = "motor.K_e"
"""The parameter that stands for the scale that it has in common with inertia and friction: it keeps what was known of it,
and the others follow it."""
KNOWN = (SCALE, "mechanics.J")
"""Those of which one that is exact tells the scale."""


@dataclass(frozen=True)
class Bench:
    """What runs are flown with: the folder of the `fmus`, the `fidelity` that is fitted, and the `parameters` set for
    all, by port name, over the actuator's; `own`: those set for the run at a place, over these."""

    fmus: Path
    fidelity: Fidelity
    parameters: Mapping[str, float] = field(default_factory=dict)
    own: Mapping[int, Mapping[str, float]] = field(default_factory=dict)

    def parameters_of(self, place: int, actuator: Actuator) -> dict[str, float]:
        """All parameters that are set for the run at `place`."""
        return {**actuator.parameters, **self.parameters, **self.own.get(place, {})}


def stated_prior(actuator: Actuator, bench: Bench) -> Prior:
    """What the file says; what is set for one run alone is exact there, and so for all."""
    alone = {name for own in bench.own.values() for name in own}
    averaged = bench.fidelity.name != REFERENCE.name
    prior = prior_of(actuator, {**actuator.parameters, **bench.parameters}, averaged=averaged).without(sorted(alone))
    if not any(name in actuator.tolerances for name in prior.names):
        raise HarnessError(
            f"actuator {actuator.name}: no tolerance is stated, so all is exact and there is nothing to calibrate; state "
            "them under [tolerances] of its file, or by --free, such as --free 'mechanics.J=5 %'"
        )
    return prior


@contextmanager
def flown(
    measured: Sequence[Measured], actuator: Actuator, bench: Bench, prior: Prior, on_step: Callable[[str], object]
) -> Iterator[list[Run]]:
    """The runs, ready to be flown."""
    with ExitStack() as stack:

        def run_of(run: Measured, place: int) -> Run:
            given = bench.parameters_of(place, actuator)
            model = stack.enter_context(Flights(bench.fmus, bench.fidelity, run, given))
            judge = None
            if bench.fidelity.name != REFERENCE.name and not run.is_slow:  # what HF adds is lost between slow rows
                judge = stack.enter_context(Flights(bench.fmus, FIDELITIES[REFERENCE.name], run, given))
            made = Run(model, judge)
            made.loads = np.empty((len(run.trial.time), 0))  # a load is logged, or there is none
            return made

        runs = []
        for place, each in enumerate(measured):
            if len(each.trials) > 1:
                on_step(f"{each.name}: what the command does between rows")
            chosen = decided(each, lambda run, place=place: run_of(run, place), prior)  # type: ignore[misc]
            runs.append(run_of(chosen, place))
        yield runs


def saturates(run: Run, parameters: Mapping[str, float], bench: Bench) -> bool:
    """Whether the voltage saturates in a flight of the run."""
    port = ports.VARIABLES[ports.INDEX["voltage_saturated"]]
    with Twin(bench.fmus / bench.fidelity.fmu) as twin:
        values, _ = twin.record(run.measured.trial, merged(bench.fidelity, parameters), [port])
    return bool((values[run.measured.trial.time >= run.measured.time[0]] > 0.5).any())


def scale_is_open(prior: Prior, runs: Sequence[Run], saturated: bool) -> bool:
    """Whether the runs leave open a factor common to torque constant, inertia and friction: unless a load is known, the
    voltage saturates, or one of these is exact. What a fit says of it then is overconfident."""
    return all(name in prior.names for name in KNOWN) and not saturated and not any(map(_loaded, runs))


def _loaded(run: Run) -> bool:
    """Whether a load was logged that is more than nothing."""
    load = run.measured.trial.inputs.get("load_torque")
    return load is not None and bool(np.ptp(load) + abs(load).max() > 4.0 * usual_load(run.model.parameters))
