"""Data sheets' words, and the formulas that turn them into the ports' parameters.

Each formula is told with its numbers, in the origin of the value. What is stated as a parameter wins; where it, or two words
of the sheet, differ by more than 5 %, a warning names both.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ema_fmu_src import ports
from harness.actuators.actuator import Output
from harness.actuators.values import Stated, stated, stated_for
from harness.errors import HarnessError, unknown
from harness.parameters import check_unit

WORDS: dict[str, str] = {
    "terminal_resistance": "Ohm",
    "terminal_inductance": "H",
    "torque_constant": "N.m/A",
    "speed_constant": "rad/s/V",
    "back_emf_constant": "V.s/rad",
    "no_load_current": "A",
    "no_load_speed": "rad/s",
    "coulomb_friction": "N.m",
    "viscous_friction": "N.m.s/rad",
    "nominal_voltage": "V",
    "rotor_inertia": "kg.m2",
    "gear_inertia": "kg.m2",
    "pole_pairs": "1",
    "travel_constant": "rad/m",
}
"""Word -> unit of a number without one. Resistance, inductance and speed constant are line to line; the torque constant is
over the equivalent current; gear_inertia is seen from the motor; the travel constant is the motor's angle over the
rod's travel, gear and screw together."""
MAY_BE_ZERO = ("no_load_current", "coulomb_friction", "viscous_friction", "gear_inertia")
CLOSE = 0.05
"""Relative difference that contradicts."""
SINE = 2.0 / math.sqrt(3.0)
"""1/k_n over K_t of a sine motor whose speed constant is over the line-to-line amplitude, about 1.155; 1 for block form."""


@dataclass
class Sheet:
    """What a data sheet gives: `values` by port, and for each port the formula and the words it comes from."""

    values: dict[str, Stated] = field(default_factory=dict)
    formulas: dict[str, str] = field(default_factory=dict)
    words: dict[str, list[str]] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    def add(self, port: str, found: Stated, formula: str, *words: str) -> None:
        """Note a value with the formula that gives it."""
        unit = ports.VARIABLES[ports.INDEX[port]].unit
        self.values[port], self.words[port] = found, list(words)
        self.formulas[port] = f"{formula} = {found.value:.5g}{'' if unit == '1' else f' {unit}'}"


def from_sheet(table: Mapping[str, Any], given: Mapping[str, Stated], where: str, output: Output) -> Sheet:
    """The parameters that follow from the words in `table`, beside those `given` in the ports' units; `output` has the lead.

    HarnessError, beginning with `where`, for an unknown word, a value in a wrong unit or out of range, or words without
    those that they need.
    """
    words: dict[str, Stated] = {}
    for word, value in table.items():
        if word not in WORDS:
            raise unknown(f"key in {where}:", word, WORDS)
        if word == "pole_pairs" and isinstance(value, str):
            check_unit(ports.VARIABLES[ports.INDEX["motor.p"]], value, f"{where} {word}")
        words[word] = stated(value, WORDS[word], f"{where} {word}")
        if words[word].value < 0.0 or (words[word].value == 0.0 and word not in MAY_BE_ZERO):
            raise HarnessError(f"{where} {word}: more than 0 is needed, not {words[word].value:g} {WORDS[word]}")
    sheet = Sheet()
    _windings(sheet, words)
    _constants(sheet, words)
    _moved(sheet, words)
    _travel(sheet, words, where, output)
    _friction(sheet, words, given, where)
    for port, found in sheet.values.items():
        stated_for(ports.VARIABLES[ports.INDEX[port]], found.value, Output(), f"{where}, {port}")
        if port in given and port not in ("mechanics.T_coulomb", "mechanics.C"):
            _compare(
                sheet, f"{port} = {given[port].value:g} is stated", given[port].value, sheet.formulas[port], found.value
            )
    return sheet


def _windings(sheet: Sheet, words: Mapping[str, Stated]) -> None:
    """R = R_tt/2, L = L_tt/2: two phases in series lie between two terminals."""
    for word, port, symbol in (("terminal_resistance", "motor.R", "R"), ("terminal_inductance", "motor.L", "L")):
        if word in words:
            sheet.add(port, words[word].times(0.5), f"{symbol}_tt/2 = {words[word].value:.5g}/2", word)


def torque_constant(words: Mapping[str, Stated]) -> tuple[Stated, str, tuple[str, ...]] | None:
    """K_t [N.m/A], how it comes about, and the words it comes from: as stated, or 1/k_n; None if there is neither."""
    if "torque_constant" in words:
        return words["torque_constant"], "", ("torque_constant",)
    if "speed_constant" in words:
        k_n = words["speed_constant"]
        tolerance = None if k_n.relative is None else k_n.relative / k_n.value
        return Stated(1.0 / k_n.value, tolerance), f"K_t = 1/k_n = 1/{k_n.value:.5g}, ", ("speed_constant",)
    if "back_emf_constant" in words:
        return words["back_emf_constant"], "K_t = k_e, ", ("back_emf_constant",)
    return None


def _constants(sheet: Sheet, words: Mapping[str, Stated]) -> None:
    """K_e = K_t/1.5: T = 1.5*K_e*I with the equivalent current I."""
    found = torque_constant(words)
    if found is None:
        return
    K_t, how, used = found
    sheet.add("motor.K_e", K_t.times(1.0 / 1.5), f"{how}K_t/1.5 = {K_t.value:.5g}/1.5", *used)
    k_e = {"k_e": words["back_emf_constant"].value} if "back_emf_constant" in words else {}
    if "speed_constant" in words:
        k_e["1/k_n"] = 1.0 / words["speed_constant"].value
    if len(k_e) == 2:
        _compare(sheet, f"back_emf_constant is {k_e['k_e']:.4g} V.s/rad", k_e["k_e"], "1/speed_constant", k_e["1/k_n"])
    if "torque_constant" not in words:
        return
    for name, value in k_e.items():
        ratio = value / K_t.value
        if abs(ratio - 1.0) > CLOSE and abs(ratio / SINE - 1.0) > CLOSE:
            sheet.warnings.append(
                f"torque constant {K_t.value:.4g} N.m/A and {name} {value:.4g} V.s/rad: their ratio {ratio:.3f} is neither "
                f"1 (block) nor {SINE:.3f} (sine, line to line), within {100 * CLOSE:g} %; the torque constant is taken"
            )


def _moved(sheet: Sheet, words: Mapping[str, Stated]) -> None:
    """J, p and V as they are stated."""
    inertias = [word for word in ("rotor_inertia", "gear_inertia") if word in words]
    if inertias:
        J = Stated(sum(words[word].value for word in inertias), _sum_of(words[word].tolerance for word in inertias))
        sheet.add("mechanics.J", J, " + ".join(f"J_{word.removesuffix('_inertia')}" for word in inertias), *inertias)
    for word, port in (("pole_pairs", "motor.p"), ("nominal_voltage", "supply_voltage")):
        if word in words:
            sheet.add(port, words[word], word, word)


def _travel(sheet: Sheet, words: Mapping[str, Stated], where: str, output: Output) -> None:
    """G = k_x*lead/(2*pi): a turn of the user shaft is a lead of the rod."""
    if "travel_constant" not in words:
        return
    k_x = words["travel_constant"]
    if output.lead is None:
        raise HarnessError(
            f"{where} travel_constant: [output] lead is needed beside it; where only gear and screw together are known, any "
            'will do, such as "5 mm"'
        )
    told = f"k_x*lead/(2*pi) = {k_x.value:.5g}*{output.lead:.5g}/(2*pi)"
    sheet.add("gear.ratio", k_x.times(output.scale("position")), told, "travel_constant")


def _sum_of(widths: Any) -> float | None:
    known = [width for width in widths if width is not None]
    return sum(known) if known else None


def _friction(sheet: Sheet, words: Mapping[str, Stated], given: Mapping[str, Stated], where: str) -> None:
    """What is stated; else half of K_t*I_0 is Coulomb friction, and the other half viscous at the no-load speed."""
    for word, port in (("coulomb_friction", "mechanics.T_coulomb"), ("viscous_friction", "mechanics.C")):
        if word in words:
            sheet.add(port, words[word], word, word)
            if port in given:
                _compare(sheet, f"{port} = {given[port].value:g} is stated", given[port].value, word, words[word].value)
    if "no_load_speed" in words and "no_load_current" not in words:
        raise HarnessError(f"{where} no_load_speed: no_load_current is needed beside it")
    if "no_load_current" in words:
        _no_load(sheet, words, given, where)
    if "mechanics.T_coulomb" in sheet.values and "mechanics.T_static" not in given:
        T_coulomb = given.get("mechanics.T_coulomb", sheet.values["mechanics.T_coulomb"])
        sheet.add("mechanics.T_static", T_coulomb, "T_coulomb, for no breakaway torque is stated", "coulomb_friction")


def _no_load(sheet: Sheet, words: Mapping[str, Stated], given: Mapping[str, Stated], where: str) -> None:
    """T_0 = K_t*I_0 = T_coulomb + C*w_0: halves, or what a stated part leaves for the other."""
    found = torque_constant(words)
    if found is not None:
        K_t = found[0]
    elif "motor.K_e" in given:
        K_t = given["motor.K_e"].times(1.5)
    else:
        raise HarnessError(f"{where} no_load_current: torque_constant, speed_constant or motor.K_e is needed beside it")
    T_0, w_0 = K_t.value * words["no_load_current"].value, words.get("no_load_speed")
    product = f"K_t*I_0 = {K_t.value:.5g}*{words['no_load_current'].value:.5g}"
    told = f"T_0 = {product} = {T_0:.5g} N.m"
    known = {name: given.get(port, sheet.values.get(port)) for name, port in
             (("T", "mechanics.T_coulomb"), ("C", "mechanics.C"))}  # fmt: skip
    T, C = known["T"], known["C"]
    if w_0 is None:
        if T is None:
            sheet.add("mechanics.T_coulomb", Stated(T_0), product, "no_load_current")
            if C is None:
                how = "all of K_t*I_0 is Coulomb friction without a no_load_speed"
                sheet.add("mechanics.C", Stated(0.0), how, "no_load_current")
        return
    if T is None:
        share = T_0 / 2.0 if C is None else max(0.0, T_0 - C.value * w_0.value)
        how = "T_0/2" if C is None else f"T_0 - C*w_0, at least 0, C*w_0 = {C.value * w_0.value:.5g} N.m"
        sheet.add("mechanics.T_coulomb", Stated(share), f"{told}; {how}", "no_load_current")
    if C is None:
        rest = T_0 / 2.0 if T is None else max(0.0, T_0 - T.value)
        how = "T_0/2/w_0" if T is None else "(T_0 - T_coulomb)/w_0, at least 0"
        told_C = f"T_0 = {product}; {how}, w_0 = {w_0.value:.5g} rad/s"
        sheet.add("mechanics.C", Stated(rest / w_0.value), told_C, "no_load_current", "no_load_speed")
    T_now, C_now = (given.get(port, sheet.values.get(port)) for port in ("mechanics.T_coulomb", "mechanics.C"))
    if T_now is not None and C_now is not None:
        torque = T_now.value + C_now.value * w_0.value
        _compare(sheet, f"friction at no load, T_coulomb + C*w_0, is {torque:.4g} N.m", torque, told, T_0)


def _compare(sheet: Sheet, one: str, value: float, other: str, found: float) -> None:
    """A warning if the two differ by more than CLOSE."""
    if abs(value - found) > CLOSE * max(abs(value), abs(found)):
        away = f"off by {100.0 * (value / found - 1.0):+.0f} %" if found else "which is 0"
        sheet.warnings.append(f"{one}, {away} from the sheet's: {other}")
