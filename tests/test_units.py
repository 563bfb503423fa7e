"""Units as users write them: what is converted, and what is refused with a word on what to write.

Truths: SI; a turn is 2*pi rad; data sheets' spellings by hand.
"""

import math
import sys

import pytest

from harness.errors import HarnessError
from harness.parameters import parse_settings
from harness.units import conversion, is_unit, quantity

RPM = 2.0 * math.pi / 60.0
CONVERTED = {
    ("deg", "rad"): math.pi / 180.0,
    ("0.01 deg", "rad"): math.pi / 18000.0,
    ("turn", "rad"): 2.0 * math.pi,
    ("arcmin", "rad"): math.pi / 10800.0,
    ("gon", "rad"): math.pi / 200.0,
    ("º", "rad"): math.pi / 180.0,
    ("mm/turn", "m/turn"): 1e-3,
    ("mm/rad", "m/turn"): 2e-3 * math.pi,
    ("RPM", "rad/s"): RPM,
    ("U/min", "rad/s"): RPM,
    ("Upm", "rad/s"): RPM,
    ("Umdr. / Min", "rad/s"): RPM,
    ("U min^-1", "rad/s"): RPM,
    ("rps", "rad/s"): 2.0 * math.pi,
    ("Nm", "N.m"): 1.0,
    ("mNm", "N.m"): 1e-3,
    ("Ncm", "N.m"): 1e-2,
    ("N-m", "N.m"): 1.0,
    ("N·m", "N.m"): 1.0,
    ("ozf.in", "N.m"): 0.45359237 / 16.0 * 9.80665 * 0.0254,
    ("Nm/A", "N.m/A"): 1.0,
    ("mNm/A", "N.m/A"): 1e-3,
    ("Nms/rad", "N.m.s/rad"): 1.0,
    ("Nms", "N.m.s/rad"): 1.0,
    ("mN.m/rpm", "N.m.s/rad"): 1e-3 / RPM,
    ("gcm2", "kg.m2"): 1e-7,
    ("gcm²", "kg.m2"): 1e-7,
    ("kgm2", "kg.m2"): 1.0,
    ("V/1000 rpm", "V.s/rad"): 1e-3 / RPM,
    ("Vs/rad", "V.s/rad"): 1.0,
    ("rad/s", "1/s"): 1.0,
    ("mΩ", "Ohm"): 1e-3,
    ("µH", "H"): 1e-6,
    ("%", "1"): 1e-2,
    ("kHz", "Hz"): 1e3,
    ("counts/turn", "1/turn"): 1.0,
    ("count/rev", "1/turn"): 1.0,
    ("1/turn", "1/turn"): 1.0,
    ("mA/rad", "A/rad"): 1e-3,
    ("A/deg", "A/rad"): 180.0 / math.pi,
    ("A/(rad.s)", "A/(rad.s)"): 1.0,
    ("A/rad/s", "A/(rad.s)"): 1.0,
    ("mA.s2/rad", "A.s2/rad"): 1e-3,
    ("A.s/rad", "A.s/rad"): 1.0,
    ("Ohm", "V/A"): 1.0,
    ("V/(A.ms)", "V/(A.s)"): 1e3,
}


@pytest.mark.parametrize(("unit", "target"), CONVERTED)
def test_what_is_converted(unit: str, target: str) -> None:
    scale, offset = conversion(unit, target, "here")
    assert (scale, offset) == (pytest.approx(CONVERTED[unit, target], rel=1e-12), 0.0)


NO_ANGLE = ["permille", "0.1 count", "10 counts", "0.1 %", "kcount", "byte", "mm/m", "dimensionless", "1", "ppm", ""]
REFUSED = {
    **{(unit, "rad"): r"is no angle|not a known unit" for unit in NO_ANGLE},
    ("counts", "1"): r"a number without a unit is needed, or one in %",
    ("cps", "rad/s"): r"counts or cycles\? write rps, rad/s or deg/s",
    ("1/s", "rad/s"): r"an angle is missing in it",
    ("s^-1", "rad/s"): r"an angle is missing in it",
    ("min⁻¹", "rad/s"): r"write rpm for 1/min",
    ("Hz", "rad/s"): r"counts periods",
    ("Hz", "1/s"): r"counts periods",
    ("counts/s", "rad/s"): r"state what one of it is",
    ("N.m/A", "V.s/rad"): r"an angle is missing in it",
    ("Grad", "rad"): r"write deg, or gon",
    ("grad", "rad"): r"write deg, or gon",
    ("Arms", "A"): r"write the amplitude",
    ("oz.in", "N.m"): r"for weights write ozf.in",
    ("kg.cm", "N.m"): r"for weights write kgf.cm",
    ("kgcm", "N.m"): r"write kgf.cm for a torque",
    ("mm", "rad"): r"for a linear actuator, state \[output\] lead",
    ("mm/s", "rad/s"): r"for a linear actuator, state \[output\] lead",
    ("NM", "N.m"): r"not a known unit",
    ("nmi", "N.m"): r"not a known unit",
    ("Mrad", "rad"): r"not a known unit",
    ("MA", "A"): r"not a known unit",
    ("9**9**9**9", "m"): r"not a known unit",
    ("rad/s", "Hz"): r"periods in a time are needed, such as \[kHz\]: 1 Hz is 6.2832 rad/s",
    ("1/s", "Hz"): r"periods in a time are needed",
    ("counts", "1/turn"): r"not by turns of the motor; write counts/turn",
    ("pulses/turn", "1/turn"): r"in two ways; write counts/turn",
    ("bit", "1/turn"): r"in two ways; write counts/turn",
    ("A", "A/rad"): r"an angle is missing in it",
    ("A.s", "A.s/rad"): r"an angle is missing in it",
}


@pytest.mark.parametrize(("unit", "target"), REFUSED)
def test_what_is_refused_says_what_to_write(unit: str, target: str) -> None:
    with pytest.raises(HarnessError, match=REFUSED[unit, target]) as refused:
        conversion(unit, target, "here")
    assert str(refused.value).startswith("here: ") and "\n" not in str(refused.value)


def test_a_bandwidth_may_be_in_hertz_and_no_speed_may() -> None:
    """An Hz of a bandwidth is 2*pi rad/s; of a speed it may be electrical, or a frequency of anything."""
    found = parse_settings(["controller.current.bandwidth=1 kHz", "inverter.carrier_frequency=20 kHz"])
    assert found["controller.current.bandwidth"] == pytest.approx(2e3 * math.pi)
    assert found["inverter.carrier_frequency"] == 20e3
    assert parse_settings(["controller.current.bandwidth=6283 rad/s"]) == {"controller.current.bandwidth": 6283.0}
    for setting, told in {
        "controller.speed_limit=100 Hz": "counts periods",
        "controller.current.bandwidth=1000 1/s": "periods in a time are needed",
        "inverter.carrier_frequency=125664 rad/s": "periods in a time are needed",
        "sensor.counts=48 counts": "write counts/turn",
    }.items():
        with pytest.raises(HarnessError, match=told):
            parse_settings([setting])


@pytest.mark.parametrize("text", ["6,480 rpm", "1,234", "6 480 rpm", "6.480,5 rpm", "6'480 rpm"])
def test_numbers_that_can_be_read_in_two_ways(text: str) -> None:
    with pytest.raises(HarnessError, match=r"behind its comma; write|is not a number with a unit"):
        quantity(text, "rad/s", "here")


def test_decimal_commas_that_are_plain() -> None:
    assert quantity("0,160 ohm", "Ohm", "here") == 0.16
    assert quantity("4,5 mm", "m", "here") == pytest.approx(4.5e-3)
    assert quantity("1,2345 V", "V", "here") == 1.2345


def test_what_names_a_unit() -> None:
    assert all(map(is_unit, ("mm/s", "%", "Arms", "Grad", "U/min", "°", "mNm")))
    assert not any(map(is_unit, ("", "-", "1", "position", "time", "enzyme_unit")))


@pytest.mark.parametrize("words", [["replay"], ["identify"], ["columns"], ["run"], ["bench", "speed"]])
def test_help_shows_what_stands_in_brackets(
    words: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Truth: the help texts as they are declared."""
    import typer

    from harness.cli import app, main

    command = typer.main.get_command(app)
    for word in words:
        command = command.commands[word]  # type: ignore[attr-defined]
    declared = " ".join(getattr(option, "help", None) or "" for option in command.params)
    monkeypatch.setenv("COLUMNS", "1000")
    monkeypatch.setattr(sys, "argv", ["ema", *words, "--help"])
    with pytest.raises(SystemExit):
        main()
    shown = capsys.readouterr().out
    assert "[" in declared
    for part in ("[unit]", "[mm]", "[bench]", "[, load_torque"):
        assert (part in declared) <= (part in shown)
