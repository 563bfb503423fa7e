"""What the command did between the rows of a log that does not say so: what comes nearest to it."""

from collections.abc import Mapping
from dataclasses import replace

from harness.inference.measured import Measured
from harness.logs.log import Between


def nearest(measured: Measured, costs: Mapping[Between, float]) -> Measured:
    """The run with that of its trials alone of which the cost, a sum of squares, is least, and a remark that says so."""
    best, *others = sorted(costs, key=lambda between: costs[between])
    ratios = ", ".join(f"{other.value} is {(costs[other] / costs[best]) ** 0.5:.3g} times as far off" for other in others)
    remark = f"nothing says what the command does between rows: {best.value} fits best ({ratios})"
    return replace(measured, trials={best: measured.trials[best]}, remarks=(*measured.remarks, remark))
