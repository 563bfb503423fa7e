"""What a channel looks like that a model does not explain. The factor that was put on it is the truth."""

import math

import numpy as np
import pytest

from harness.actuators.actuator import Output
from harness.logs.hints import Seen, at_bounds, percent, scaled, sized
from harness.logs.shown import Shown, shown

T = np.linspace(0.0, 2.0, 400)
CURVE = np.sin(5.0 * T)


@pytest.mark.parametrize(
    "unit, factor, says",
    [
        ("rad", 180.0 / math.pi, "degrees instead of rad?"),
        ("rad", -180.0 / math.pi, "degrees instead of rad and the other sign?"),
        ("rad", 1e3, "mrad instead of rad?"),
        ("rad", 30.0 / math.pi, ""),
        ("m", 1e3, "mm instead of m?"),
        ("m", 1e-3, "is the twin's in mm?"),
        ("m", 180.0 / math.pi, ""),
        ("rad/s", 30.0 / math.pi, "rpm instead of rad/s?"),
        ("A", 1e3, "mA instead of A?"),
        ("A", 30.0 / math.pi, ""),
        ("A", -1.0, "the other sign?"),
        ("A", 1.2, ""),
    ],
)
def test_units_are_those_of_the_quantity(unit, factor, says):
    found = scaled(factor * CURVE, CURVE, unit, "the twin's")
    assert found.endswith(says) and bool(found) == bool(says)


def test_a_thousandfold_is_one_though_the_curves_are_not_alike():
    """A real current hardly looks like a twin's; of a thousand times its size it is in mA all the same."""
    other = 0.3 * CURVE + np.random.default_rng(0).standard_normal(T.size)
    assert "mA instead of A" in sized(1e3 * other, CURVE, "A", "the twin's") and not sized(other, CURVE, "A", "the twin's")
    assert not scaled(1e3 * other, CURVE, "A", "the twin's") and not sized(60.0 * other, CURVE, "rad", "the twin's")


def test_beyond_the_stops_comes_before_what_a_saturated_twin_would_suggest():
    """+-5 mm against stops at 0.477 mm: ten times what the twin does is no unit."""
    seen = Seen([Shown("position", "m", 1.0)], 5e-3 * CURVE[:, None], np.clip(5e-3 * CURVE, -4.77e-4, 4.77e-4)[:, None],
                5e-3 * CURVE, 4.77e-4)  # fmt: skip
    assert "beyond the end stops at 0.000477 m" in seen.hint(0) and "beyond" in seen.command_beyond()


def test_a_position_on_the_motor_is_the_users_unless_that_is_there():
    rod, given = Output(0.01), {"gear.ratio": 20.0}
    assert shown("motor_position", ["motor_position"], rod, given) == Shown("position", "m", 0.01 / (2.0 * math.pi) / 20.0)
    assert shown("motor_position", ["motor_position", "position"], rod, given) == Shown("motor_position", "rad", 1.0)
    assert shown("motor_position", ["motor_position"], Output(), given) == Shown("position", "rad", 1.0 / 20.0)


def test_a_shift_near_its_bound_is_named_and_none_without_a_bound():
    (line,) = at_bounds(["position", "equivalent_current"], [0.0098, 0.002], [0.01, 0.01])
    assert line.startswith("position is shifted in time by 9.8 ms")
    assert not at_bounds(["position"], [0.0], [0.0])


@pytest.mark.parametrize(
    "part, digits, text",
    [(1.1, 2, "110 %"), (0.1234, 3, "12.3 %"), (12.345, 3, "1230 %"), (0.9996, 2, "100 %"), (None, 3, "-")],
)
def test_percentages_have_no_exponents(part, digits, text):
    assert percent(part, digits) == text
