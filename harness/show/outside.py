"""Results as their users see them: a linear actuator's positions in m and its load in N; the actuator in every run."""

from dataclasses import replace

import xarray as xr

from harness.actuators.actuator import Actuator
from harness.comparison import Comparison
from harness.flight.experiment import Experiment
from harness.flight.switch import Jump
from harness.provenance import Provenance


def run_of(run: xr.Dataset, actuator: Actuator, record: Provenance | None = None) -> xr.Dataset:
    """A run in the actuator's units outside; its attributes have the actuator's name and hash, and the `record` as JSON."""
    about = {"actuator": actuator.name, "actuator_sha256": actuator.sha256}
    return actuator.output.shown(run).assign_attrs(about | ({"provenance": record.as_text()} if record else {}))


def experiment_of(experiment: Experiment, actuator: Actuator, record: Provenance | None = None) -> Experiment:
    """An experiment in the actuator's units outside, with that provenance: runs, comparisons and jumps."""
    return replace(
        experiment,
        runs={key: run_of(run, actuator, record) for key, run in experiment.runs.items()},
        comparisons=[_comparison(item, actuator) for item in experiment.comparisons],
        jumps=[_jump(item, actuator) for item in experiment.jumps],
        partial=None if experiment.partial is None else run_of(experiment.partial, actuator, record),
    )


def _comparison(item: Comparison, actuator: Actuator) -> Comparison:
    output = actuator.output
    return replace(item, unit=output.unit(item.variable), max_abs=item.max_abs * output.scale(item.variable))


def _jump(item: Jump, actuator: Actuator) -> Jump:
    return replace(item, values={name: value * actuator.output.scale(name) for name, value in item.values.items()})
