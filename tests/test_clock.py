"""The host's clock: which steps follow the last one, in both runtimes.

The host's time is the truth: a step goes from the last communication point to time + step (FMI 2.0.5, section 4.2.2), so
that differences between the clocks do not add up.
"""

from collections.abc import Callable

import numpy as np
import pytest
from fmi import DISCARD, ERROR, STEP, Instance, refused

from ema_fmu_src import ports

END = 2.5  # s
STEPS = round(END / STEP)
MODELS = pytest.mark.parametrize("model", ports.MODELS)


def flown(instance: Instance, times: list[float], sizes: list[float]) -> float:
    """The position at the end of these steps."""
    instance.start(stop_time=END)
    for time, size in zip(times, sizes, strict=True):
        instance.step(time, size)
    assert instance.messages == []
    return instance.get("position")


@MODELS
def test_a_clock_of_single_precision(open_fmu: Callable[..., Instance], model: str) -> None:
    """That adds up its steps, and one that multiplies; the last step ends at the stop time."""
    exact = flown(open_fmu(model), [k * STEP for k in range(STEPS)], [STEP] * STEPS)
    added = np.cumsum(np.full(STEPS + 200, np.float32(STEP)), dtype=np.float32) - np.float32(STEP)
    added = added[added < END - 0.5 * STEP]
    multiplied = (np.arange(STEPS) * np.float32(STEP)).astype(np.float32)
    for clock in (added, multiplied):
        times = [float(time) for time in clock]
        sizes = [STEP] * (len(times) - 1) + [END - times[-1]]
        assert flown(open_fmu(model), times, sizes) == pytest.approx(exact, rel=1e-6)


@MODELS
def test_a_clock_of_double_precision_that_adds_up(open_fmu: Callable[..., Instance], model: str) -> None:
    exact = flown(open_fmu(model), [k * STEP for k in range(STEPS)], [STEP] * STEPS)
    times = [0.0]
    for _ in range(STEPS - 1):
        times.append(times[-1] + STEP)
    assert flown(open_fmu(model), times, [STEP] * STEPS) == pytest.approx(exact, rel=1e-9)


@MODELS
def test_differences_do_not_add_up(open_fmu: Callable[..., Instance], model: str) -> None:
    """A host whose clock goes wrong by a thousandth of each step: after 2000 steps the FMU is where that clock is."""
    late = open_fmu(model)
    late.start()
    time = 0.0
    for _ in range(2000):
        late.step(time, STEP)
        time += STEP * 1.0009
    last = 1999 * STEP * 1.0009 + STEP
    whole = open_fmu(model)
    whole.start()
    for k in range(2000):
        whole.step(k * last / 2000, last / 2000)
    assert late.get("position") == pytest.approx(whole.get("position"), rel=1e-6)


@pytest.mark.parametrize("start", [0.0, 2.5, 1e6])
@pytest.mark.parametrize("off", [-1e-3, -0.2 * STEP, 0.2 * STEP, 1e-3])
def test_a_step_elsewhere_is_refused(runtime: str, instance: Instance, start: float, off: float) -> None:
    instance.start(start_time=start)
    instance.step(start)
    point = start + STEP
    refused(ERROR if runtime == "native" else DISCARD, instance.step, point + off)
    assert "follow the last" in instance.messages[0][1]
    instance.step(point)


@pytest.mark.parametrize("start", [0.0, 2.5, 1e6])
def test_the_last_place_is_rounding(instance: Instance, start: float) -> None:
    instance.start(start_time=start)
    time = start
    for k in range(1, 100):
        instance.step(float(np.nextafter(time, np.inf if k % 2 else -np.inf)))
        time = start + k * STEP
    assert instance.messages == []
