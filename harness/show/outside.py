"""Results as their users see them: a linear actuator's positions in m and its load in N; the actuator in every run."""

from dataclasses import replace

import xarray as xr

from harness.actuators.actuator import Actuator
from harness.comparison import Comparison
from harness.flight.experiment import Experiment
from harness.flight.switch import Jump


def run_of(run: xr.Dataset, actuator: Actuator) -> xr.Dataset:
    """A run in the actuator's units outside, with its name and hash among the attributes."""
    return actuator.output.shown(run).assign_attrs(actuator=actuator.name, actuator_sha256=actuator.sha256)


def experiment_of(experiment: Experiment, actuator: Actuator) -> Experiment:
    """An experiment in the actuator's units outside: runs, comparisons and jumps."""
    return replace(
        experiment,
        runs={key: run_of(run, actuator) for key, run in experiment.runs.items()},
        comparisons=[_comparison(item, actuator) for item in experiment.comparisons],
        jumps=[_jump(item, actuator) for item in experiment.jumps],
        partial=None if experiment.partial is None else run_of(experiment.partial, actuator),
    )


def _comparison(item: Comparison, actuator: Actuator) -> Comparison:
    output = actuator.output
    return replace(item, unit=output.unit(item.variable), max_abs=item.max_abs * output.scale(item.variable))


def _jump(item: Jump, actuator: Actuator) -> Jump:
    return replace(item, values={name: value * actuator.output.scale(name) for name, value in item.values.items()})
