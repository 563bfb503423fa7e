"""Coupled FMUs of every type, in loops and with odd manners, against values known in closed form."""

import logging
import math
import signal
import threading
import time
from pathlib import Path

import fmpy
import numpy as np
import pytest
import xarray as xr
from small import EQUAL_STEPS, NEEDS_STOP, REFUSES_INPUT, REFUSES_OUTPUT, REFUSES_STEP, SLOW, WARNS

from harness.errors import HarnessError
from harness.flight.couple import Connection, System, fly
from harness.flight.initialize import TOLERANCE

ORDERS = pytest.mark.parametrize("order", ["jacobi", "gauss-seidel"])
THROUGH = {"y0": ("u0", "u1"), "y1": ("u0", "u1")}


def coupled(
    components: dict[str, Path], connections: list[tuple[str, str]], parameters: dict[str, float | str], **options
) -> xr.Dataset:
    links = [Connection(source, target) for source, target in connections]
    return fly(System(components, links, parameters), **{"stop": 0.0, "step": 0.1, **options})


@ORDERS
@pytest.mark.parametrize("depends", [None, THROUGH])
def test_a_feedthrough_pair_starts_with_consistent_values(small_fmu, depends, order) -> None:
    """y = 2 u, twice, behind an input of 0.5: 1, then 2, from the first point on, whichever stands first."""
    double = small_fmu("affine", depends=depends)
    for names in (("first", "second"), ("second", "first")):
        run = coupled(
            {name: double for name in names},
            [("first.y0", "second.u0")],
            {f"{name}.a00": 2.0 for name in names},
            stop=0.3,
            inputs={"first.u0": np.full(3, 0.5)},
            record=["first.y0", "second.y0"],
            order=order,
        )
        assert run["first.y0"].values.tolist() == [1.0] * 4
        assert run["second.y0"].values.tolist() == [2.0] * 4


def test_a_chain_across_two_components_and_back_is_no_loop(small_fmu) -> None:
    """a.y0 -> b.u0, b.y0 -> a.u1, a.y1 -> b.u1: no output depends on itself, though the components go round."""
    depends = {"y0": ["u0"], "y1": ["u1"]}
    box = small_fmu("affine", depends=depends)
    parameters = {f"{name}.a{i}{i}": 3.0 for name in "ab" for i in range(2)}
    wires = [("a.y1", "b.u1"), ("a.y0", "b.u0"), ("b.y0", "a.u1")]
    run = coupled(dict.fromkeys("ab", box), wires, parameters, inputs={"a.u0": np.ones(1)}, stop=0.1, record=["b.y1"])
    assert float(run["b.y1"][0]) == 81.0


@pytest.mark.parametrize("gain", [0.5, -3.0, 0.999, 40.0])
def test_a_linear_loop_starts_at_its_solution(small_fmu, gain) -> None:
    """x = g*y + 1, y = g*x + 2: x = (1 + 2g)/(1 - g^2), though going round does not converge for |g| >= 1."""
    box = small_fmu("affine", depends=THROUGH)
    parameters = {"a.a00": gain, "a.b0": 1.0, "b.a00": gain, "b.b0": 2.0}
    wires = [("a.y0", "b.u0"), ("b.y0", "a.u0")]
    run = coupled(dict.fromkeys("ab", box), wires, parameters, record=["a.y0", "b.y0"])
    x, y = (1.0 + 2.0 * gain) / (1.0 - gain**2), (2.0 + gain) / (1.0 - gain**2)
    np.testing.assert_allclose([run["a.y0"][0], run["b.y0"][0]], [x, y], rtol=10 * TOLERANCE)


def test_a_nonlinear_loop_starts_at_its_solution(small_fmu) -> None:
    """x = cos x has the one solution 0.7390851332151607 (Dottie's number)."""
    run = coupled({"a": small_fmu("cosine")}, [("a.y0", "a.u0")], {}, record=["a.y0"])
    assert float(run["a.y0"][0]) == pytest.approx(0.7390851332151607, rel=TOLERANCE)


def test_a_loop_that_is_not_declared_is_found(small_fmu) -> None:
    """The FMU says that its outputs depend on nothing; they do."""
    box = small_fmu("affine", depends={})
    parameters = {"a.a00": 0.5, "a.b0": 1.0, "b.a00": 0.5, "b.b0": 1.0}
    run = coupled(dict.fromkeys("ab", box), [("a.y0", "b.u0"), ("b.y0", "a.u0")], parameters, record=["a.y0"])
    assert float(run["a.y0"][0]) == pytest.approx(2.0, rel=TOLERANCE)


@pytest.mark.parametrize("gain", [1.0, -2.0, 1e6])
def test_a_loop_without_solution_is_refused_with_its_names(small_fmu, gain) -> None:
    """x = g*y, y = x/g + 1: the gain around is 1. And a flag that is its own opposite."""
    box = small_fmu("affine", depends=THROUGH)
    wires = [("a.y0", "b.u0"), ("b.y0", "a.u0")]
    with pytest.raises(HarnessError, match=r"connections .*a\.y0 -> b\.u0.*: no values were found") as caught:
        coupled(dict.fromkeys("ab", box), wires, {"a.a00": gain, "b.a00": 1.0 / gain, "b.b0": 1.0})
    assert "\n" not in str(caught.value) and "b.y0 -> a.u0" in str(caught.value)
    with pytest.raises(HarnessError, match=r"m\.flag -> m\.flag_in: no values were found"):
        coupled({"m": small_fmu("mirror")}, [("m.flag", "m.flag_in")], {})


@ORDERS
@pytest.mark.parametrize("gain", [1.5, -3.0])
def test_a_loop_that_amplifies_is_refused_in_steps_unless_it_is_none_there(small_fmu, gain, order) -> None:
    """Exchanged once a step, an error grows by the gain at every step; not where one FMU delays, later."""
    wires = [("a.y0", "b.u0"), ("b.y0", "a.u0")]
    parameters = {"a.a00": gain, "b.a00": gain, "b.b0": 1.0}
    boxes = dict.fromkeys("ab", small_fmu("affine", depends=THROUGH))
    with pytest.raises(HarnessError, match=rf"b\.y0 -> a\.u0.*: its gain is {abs(gain):.3g};"):
        coupled(boxes, wires, parameters, stop=0.1, order=order)
    boxes["b"] = small_fmu("affine", depends=THROUGH, later={})
    assert len(coupled(boxes, wires, parameters, stop=0.1, order=order).time) == 2


@ORDERS
def test_a_loop_that_does_not_amplify_follows_its_input(small_fmu, order) -> None:
    """x = y/2 + u, y = x/2: x = u/0.75; after a jump of u the error falls by the gain around at every exchange."""
    wires = [("a.y0", "b.u0"), ("b.y0", "a.u0")]
    parameters = {"a.a00": 0.5, "a.a01": 1.0, "b.a00": 0.5}
    jump = np.where(np.arange(60) < 5, 3.0, 6.0)
    boxes = dict.fromkeys("ab", small_fmu("affine", depends=THROUGH))
    run = coupled(boxes, wires, parameters, stop=6.0, inputs={"a.u1": jump}, record=["a.y0"], order=order)
    np.testing.assert_allclose(run["a.y0"][:6], 4.0, rtol=1e-9)
    assert float(run["a.y0"][-1]) == pytest.approx(8.0, rel=1e-9)


@pytest.mark.parametrize("value, told", [(math.inf, "the value is inf at the start"), (math.nan, "the value is nan")])
def test_a_start_that_is_no_number_is_refused(small_fmu, value, told) -> None:
    box = small_fmu("affine", depends=THROUGH)
    with pytest.raises(HarnessError, match=rf"a\.y0 -> b\.u0: {told}"):
        coupled(dict.fromkeys("ab", box), [("a.y0", "b.u0")], {"a.b0": value})


@ORDERS
def test_a_mass_on_a_spring_swings_as_it_should(small_fmu, order) -> None:
    """x = x0 cos(w t), w^2 = k/m = 25; the spring's force is there from the start, and the error is of first order."""
    components = {"mass": small_fmu("mass", depends={}), "spring": small_fmu("affine", depends=THROUGH)}
    wires = [("mass.y0", "spring.u0"), ("spring.y0", "mass.u0")]
    parameters = {"mass.a00": 2.0, "mass.b0": 0.1, "spring.a00": -50.0}
    errors = []
    for n in (500, 1000):
        run = coupled(components, wires, parameters, stop=1.0, step=1.0 / n, record=["mass.y0", "spring.y0"], order=order)
        errors.append(float(np.abs(run["mass.y0"] - 0.1 * np.cos(5.0 * run.time)).max()))
        assert float(run["spring.y0"][0]) == -5.0
    assert errors[0] < 0.01 and 1.8 < errors[0] / errors[1] < 4.2


@ORDERS
def test_every_type_passes(small_fmu, order) -> None:
    """Two mirrors behind one another: the number rises by 2, the flag is turned twice, the text gets two marks."""
    types = ("number", "mode", "flag", "text")
    run = coupled(
        dict.fromkeys("ab", small_fmu("mirror")),
        [(f"a.{name}", f"b.{name}_in") for name in types],
        {"a.number_in": 5, "a.mode_in": "fast", "a.flag_in": True, "a.text_in": "grüße"},
        stop=0.2,
        inputs={"a.number_in": np.array([5.0, -7.0])},
        record=["b.number", "b.mode", "b.flag", "b.length"],
        order=order,
    )
    assert run["b.number"].values.tolist() == [7, 7, -5] and run["b.number"].dtype == np.int64
    assert run["b.mode"].values.tolist() == [3] * 3
    assert run["b.flag"].values.tolist() == [True] * 3 and run["b.flag"].dtype == bool
    assert run["b.length"].values.tolist() == [len("grüße!".encode())] * 3


def test_an_integer_becomes_a_real(small_fmu) -> None:
    wires = [Connection("a.number", "b.u0", 0.5)]
    system = System(
        {"a": small_fmu("mirror"), "b": small_fmu("affine", depends=THROUGH)}, wires, {"a.number_in": 6, "b.a00": 1.0}
    )
    assert fly(system, stop=0.1, step=0.1, record=["b.y0"])["b.y0"].values.tolist() == [3.5, 3.5]


@pytest.mark.parametrize(
    "wires, inputs, told",
    [
        ([("a.y0", "b.u0"), ("a.y1", "b.u0")], {}, r"b\.u0: gets its value from a\.y0 and from a\.y1"),
        ([("a.y0", "b.u0")], {"b.u0": np.ones(1)}, r"b\.u0: gets its value from the inputs that are given and from a\.y0"),
        ([("a.y0", "b.y1")], {}, r"b\.y1: is no input but an output"),
        ([("a.y0", "b.a00")], {}, r"b\.a00: is no input but a parameter"),
        ([("a.y0", "m.number_in")], {}, r"a\.y0 -> m\.number_in: Real cannot become Integer"),
        ([("m.text", "a.u0")], {}, r"String cannot become Real"),
        ([("a.y2", "b.u0")], {}, r"unknown variable of a 'y2'"),
        ([], {"m.number_in": np.array([0.5])}, r"m\.number_in: its value 0, 0\.5, is no Integer"),
        ([], {"m.flag_in": np.array([2.0])}, r"is no Boolean"),
        ([], {"m.text_in": np.array([2.0])}, r"a String cannot change over time"),
        ([], {"a.u0": np.array([np.nan])}, r"a\.u0: its value 0, nan, is no finite number"),
        ([], {"a.u0": np.array(1.0)}, r"1 values are given, 1 are needed"),
    ],
)
def test_wiring_that_makes_no_sense_is_refused(small_fmu, wires, inputs, told) -> None:
    box = small_fmu("affine")
    with pytest.raises(HarnessError, match=told) as caught:
        coupled({"a": box, "b": box, "m": small_fmu("mirror")}, wires, {}, stop=0.1, inputs=inputs)
    assert "\n" not in str(caught.value)


def test_a_factor_is_for_reals(small_fmu) -> None:
    system = System(dict.fromkeys("ab", small_fmu("mirror")), [Connection("a.number", "b.number_in", 2.0)])
    with pytest.raises(HarnessError, match=r"factor 2: .* only 1 into others"):
        fly(system, stop=0.1, step=0.1)


@pytest.mark.parametrize(
    "components, inputs, told",
    [
        ([], {}, "one component at least"),
        (["a.b"], {}, r"component 'a\.b': a name without a dot"),
        (["a"], {"a.u0": ["high"]}, r"a\.u0: an array of numbers is needed"),
    ],
)
def test_what_is_no_system_is_refused(small_fmu, components, inputs, told) -> None:
    with pytest.raises(HarnessError, match=told):
        coupled(dict.fromkeys(components, small_fmu("affine")), [], {}, stop=0.1, inputs=inputs)


def test_ctrl_c_ends_a_coupled_run_soon(small_fmu) -> None:
    """100 s of an FMU that takes 1 ms a step; the interrupt comes in its midst."""
    timer = threading.Timer(0.3, signal.raise_signal, [signal.SIGINT])
    began = time.monotonic()
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        coupled({"c": small_fmu("clock")}, [], {"c.manners": SLOW}, stop=1e4)
    assert time.monotonic() - began < 20.0


@pytest.mark.parametrize(
    "name, value, told",
    [
        ("text_in", 3.0, "a text is needed"),
        ("text_in", "a\0b", "a text is needed"),
        ("number_in", 2.5, "a whole number is needed"),
        ("number_in", math.nan, "a whole number is needed"),
        ("number_in", 2.0**31, "a whole number is needed"),
        ("flag_in", 0.5, "0 or 1 is needed"),
        ("mode_in", "none", "off, slow, fast is needed"),
    ],
)
def test_start_values_of_another_type_are_refused(small_fmu, name, value, told) -> None:
    with pytest.raises(HarnessError, match=rf"{name} = .*{told}"):
        coupled({"m": small_fmu("mirror")}, [], {f"m.{name}": value})


def test_a_string_that_is_too_long_is_refused_by_name(small_fmu) -> None:
    wires, text = [("a.text", "b.text_in")], "x" * 5000
    with pytest.raises(HarnessError, match=r"a\.text, at 0 s: its text is longer than 4095 bytes"):
        coupled(dict.fromkeys("ab", small_fmu("mirror")), wires, {"a.text_in": text}, stop=0.1)
    with pytest.raises(HarnessError, match=r"a\.text: a String cannot be recorded"):
        coupled({"a": small_fmu("mirror")}, [], {}, record=["a.text"])


@pytest.mark.parametrize("stop, points", [(0.25, [0.0, 0.1, 0.2, 0.25]), (0.3, [0.0, 0.1, 0.2, 0.3]), (0.07, [0.0, 0.07])])
def test_the_last_step_reaches_the_stop_time(small_fmu, stop, points) -> None:
    """As FMPy does: a shorter last step where the FMU takes one."""
    clock = small_fmu("clock")
    theirs = fmpy.simulate_fmu(str(clock), stop_time=stop, output_interval=0.1, output=["y1"], validate=False)
    np.testing.assert_allclose(theirs["time"], points, rtol=1e-15)
    run = coupled({"c": clock}, [], {"c.manners": NEEDS_STOP}, stop=stop, record=["c.y0", "c.y1"])
    np.testing.assert_allclose(run.time, points, rtol=1e-15)
    assert float(run.time[-1]) == float(run["c.y0"][-1]) == pytest.approx(stop, rel=1e-15)
    assert float(run["c.y1"][-1]) == pytest.approx(stop, rel=1e-15)


def test_a_stop_between_steps_is_refused_where_steps_are_equal(small_fmu) -> None:
    clock = small_fmu("clock", variable_steps=False)
    with pytest.raises(
        HarnessError, match=r"stop 0\.25 s is no multiple of the step 0\.1 s, and c \(clock\.fmu\).*0\.2 s or 0\.3 s"
    ):
        coupled({"c": clock}, [], {}, stop=0.25)
    run = coupled({"c": clock}, [], {"c.manners": EQUAL_STEPS}, stop=0.7, record=["c.y1"])  # 0.7/0.1 is not 7 in doubles
    assert len(run.time) == 8


@pytest.mark.parametrize(
    "stop, step, told",
    [
        (1.0, 0.0, "step 0 s"),
        (1.0, math.nan, "step nan"),
        (-1.0, 0.1, "stop -1 s"),
        (math.inf, 0.1, "stop inf"),
        (1.0, 1e-12, "1e[+]09 steps"),
    ],
)
def test_times_that_cannot_be_flown(small_fmu, stop, step, told) -> None:
    with pytest.raises(HarnessError, match=told):
        coupled({"c": small_fmu("clock")}, [], {}, stop=stop, step=step)


@ORDERS
@pytest.mark.parametrize(
    "manners, told",
    [
        (REFUSES_INPUT, r"^c\.u0, at 0 s: input 2 refused: 3 N$"),
        (REFUSES_OUTPUT, r"^c\.y1, at 0 s: fmi2GetReal returned fmi2Error$"),
        (REFUSES_STEP, r"^c, at 0 s: step of 0\.1 s refused$"),
    ],
)
def test_the_one_that_failed_is_named(small_fmu, order, manners, told) -> None:
    """The last of three; its message has the arguments of printf in it."""
    box = small_fmu("affine", depends=THROUGH)
    wires = [("a.y0", "b.u0"), ("b.y0", "c.u0"), ("c.y1", "a.u1")]
    parameters = {"a.b0": 3.0, "b.a00": 1.0, "c.manners": manners}
    with pytest.raises(HarnessError, match=told):
        coupled(dict.fromkeys("abc", box), wires, parameters, stop=0.2, order=order)


def test_a_warning_at_the_start_is_passed_on_and_refuses_nothing(small_fmu, caplog) -> None:
    box = small_fmu("affine", depends=THROUGH)
    with caplog.at_level(logging.WARNING):
        run = coupled({"a": box, "b": box}, [], {"a.manners": WARNS, "a.a00": 2.5, "a.b0": 4.0}, stop=0.1, record=["a.y0"])
    assert run["a.y0"].values.tolist() == [4.0, 4.0]
    assert [record.getMessage() for record in caplog.records] == ["affine.fmu: gain 2.5 of affine has 7 digits"]
