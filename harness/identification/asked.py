"""What a diagnosis is asked for, checked in one place for the command line and for the library."""

from collections.abc import Collection

from harness.actuators.actuator import DEFAULT, Actuator
from harness.errors import HarnessError


def check_healthy(
    actuator: Actuator, settings: Collection[str], estimated: Collection[str], *, setting: str, given: str
) -> None:
    """HarnessError if a port that is `estimated` is among the `settings`, or is not healthy in the actuator; `setting` and
    `given` begin the lines on each, as it was asked for."""
    for port in estimated:
        if port in settings:
            raise HarnessError(f"{setting}{port}: it is what is estimated; only other parameters can be set")
        if actuator.value(port) != DEFAULT.value(port):
            stated = f"{port} = {actuator.value(port):g}"
            raise HarnessError(f"{given}{actuator.name}: {stated}: it is what is estimated; a healthy actuator is needed")


def check_threshold(threshold: float, name: str) -> None:
    """HarnessError, which begins with `name`, unless it is a part of health."""
    if not 0.0 <= threshold < 1.0:
        raise HarnessError(f"{name}{threshold:g}: 0 up to less than 1 is needed")


def check_tolerance(tolerance: float, name: str, usual: float) -> None:
    """HarnessError, which begins with `name` and names the `usual` one, unless it is a part of a range."""
    if not tolerance > 0.0:
        raise HarnessError(f"{name}{tolerance:g}: more than 0 is needed, such as {usual:g}")
