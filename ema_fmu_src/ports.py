"""The one declaration of every variable of the twins.

HF, ELF and LF share names, types, units, causality and value references; the model descriptions, the FMUs' HTML
pages, the tables, the harness and the tests are made from this module. A variable's value reference is its place in
`VARIABLES`, and the twins' kernels find its value at that place of their flat float64 array `v` (an Integer, a
Boolean or an Enumeration is held there as a float64 too).

Sources: the paper (Quattrocchi, Dalla Vedova, Berri: J. Phys. Conf. Ser. 2526 (2023) 012076) gives the symbols of the
motor, its driver and its faults; every default value is ours, chosen so that SIN and STEP-RAMP stay unsaturated and
SIN4 saturates fully, as in the paper.
"""

from collections.abc import Mapping

from .fidelities import MODELS as MODELS
from .variable import Kind as Kind
from .variable import Variability
from .variable import Variable as Variable

Limits = tuple[float | None, float | None]


def _input(name: str, unit: str, start: float, limits: Limits, description: str, *, nominal: float) -> Variable:
    return Variable(name, "input", "continuous", "Real", unit, start, description, *limits, nominal=nominal)


def _output(name: str, unit: str, description: str, *, nominal: float | None = None) -> Variable:
    return Variable(name, "output", "continuous", "Real", unit, 0.0, description, nominal=nominal)


def _parameter(
    name: str,
    unit: str,
    start: float,
    limits: Limits,
    description: str,
    *,
    kind: Kind = "Real",
    unused_by: tuple[str, ...] = (),
    start_of: Mapping[str, float] | None = None,
    nominal: float | None = None,
    display: str = "",
) -> Variable:
    """A parameter; the nominal value of a Real is the magnitude of its start, unless that is 0."""
    variability: Variability = "tunable" if name.startswith("fault.") else "fixed"
    if kind == "Real" and nominal is None and start != 0.0:
        nominal = abs(start)
    return Variable(
        name, "parameter", variability, kind, unit, start, description, *limits, unused_by, start_of or {},
        nominal=nominal, display=display,
    )  # fmt: skip


def _choice(
    name: str, start: str, items: Mapping[str, int], description: str, *, unused_by: tuple[str, ...] = ()
) -> Variable:
    """An Enumeration: a parameter that has one of the values `items`."""
    values = list(items.values())
    variability: Variability = "tunable" if name.startswith("fault.") else "fixed"
    return Variable(
        name, "parameter", variability, "Enumeration", "", items[start], description, values[0], values[-1], unused_by,
        items=items,
    )  # fmt: skip


VARIABLES: tuple[Variable, ...] = (
    _input("command", "rad", 0.0, (-1e3, 1e3), "Commanded position of the output (user) shaft", nominal=0.1),
    _input(
        "load_torque",
        "N.m",
        0.0,
        (-1e6, 1e6),
        "External torque on the user shaft; positive opposes positive rotation",
        nominal=10.0,
    ),
    _input("supply_voltage", "V", 48.0, (0.0, 2000.0), "DC bus voltage V_dc", nominal=48.0),
    _output("position", "rad", "User shaft angle, after backlash", nominal=0.1),
    _output("motor_position", "rad", "Rotor angle theta, mechanical", nominal=20.0),
    _output("motor_speed", "rad/s", "Rotor speed w, mechanical", nominal=100.0),
    _output("reference_current", "A", "Controller output I_ref"),
    _output("equivalent_current", "A", "Equivalent single-phase (quadrature) current, instantaneous"),
    _output("equivalent_current_filtered", "A", "Equivalent single-phase current after a low-pass of monitor.tau"),
    _output("phase_current_a", "A", "Current of phase a (LF: inverse Park of its single current)"),
    _output("phase_current_b", "A", "Current of phase b (LF: inverse Park of its single current)"),
    _output("phase_current_c", "A", "Current of phase c (LF: inverse Park of its single current)"),
    _output("back_emf_a", "V", "Back-EMF of phase a", nominal=10.0),
    _output("back_emf_b", "V", "Back-EMF of phase b", nominal=10.0),
    _output("back_emf_c", "V", "Back-EMF of phase c", nominal=10.0),
    _output("motor_torque", "N.m", "Electromagnetic torque on the motor shaft", nominal=0.1),
    _output("friction_torque", "N.m", "Dry friction torque on the motor shaft, opposing the motion", nominal=0.1),
    _output("supply_current", "A", "DC bus current, mean over the last communication step"),
    _output("copper_loss", "W", "Loss in the windings' resistance, mean over the last communication step", nominal=10.0),
    Variable(
        "voltage_saturated",
        "output",
        "discrete",
        "Boolean",
        "",
        0.0,
        "Some phase was voltage-limited during the last communication step: plain ELF has left its range of validity",
    ),
    Variable(
        "controller.integral",
        "local",
        "discrete",
        "Real",
        "A",
        0.0,
        "Integral part of the speed controller (LF has none: the one that carries its current reference on)",
    ),
    _parameter("motor.R", "Ohm", 1.0, (1e-3, 1e3), "Phase resistance, half of the line-to-line R_s"),
    _parameter("motor.L", "H", 0.7e-3, (1e-6, 1.0), "Phase inductance (plain ELF has none)"),
    _parameter("motor.K_e", "V.s/rad", 0.05, (1e-5, 10.0), "Back-EMF coefficient of a phase, peak"),
    _parameter("motor.p", "1", 2, (1, 50), "Pole pairs", kind="Integer"),
    _parameter("mechanics.J", "kg.m2", 6e-5, (1e-8, 10.0), "Inertia of all that moves, on the motor side"),
    _parameter("mechanics.C", "N.m.s/rad", 5e-5, (0.0, 10.0), "Viscous friction coefficient, on the motor side"),
    _parameter("mechanics.T_static", "N.m", 0.06, (0.0, 100.0), "Static (breakaway) friction, on the motor side"),
    _parameter("mechanics.T_coulomb", "N.m", 0.03, (0.0, 100.0), "Coulomb friction, on the motor side"),
    _parameter("mechanics.end_stop", "rad", 0.6, (1e-3, 1e3), "End stops at plus and minus this user shaft angle"),
    _parameter("gear.ratio", "1", 200.0, (1.0, 1e5), "Gear ratio G, motor to user shaft"),
    _parameter("gear.eta_opposing", "1", 0.9, (0.05, 1.0), "Gear efficiency when the load opposes the motion"),
    _parameter("gear.eta_aiding", "1", 0.9, (0.0, 1.0), "Gear efficiency when the load aids the motion"),
    _parameter("gear.backlash", "rad", 1e-4, (0.0, 1.0), "Total play at the user shaft"),
    _parameter("controller.K_pos", "1/s", 40.0, (0.0, 1e4), "Gain of the position loop"),
    _parameter("controller.speed_limit", "rad/s", 2000.0, (0.0, 1e5), "Limit of the speed reference"),
    _parameter("controller.K_p", "A.s/rad", 1.3, (0.0, 1e3), "Proportional gain of the speed loop"),
    _parameter("controller.K_i", "A/rad", 10.0, (0.0, 1e5), "Integral gain of the speed loop", unused_by=("LF",)),
    _parameter("controller.current_limit", "A", 10.0, (0.0, 1e4), "Limit of the current reference"),
    _parameter("controller.period", "s", 1e-4, (1e-6, 0.1), "Sampling period T_c of the controller", unused_by=("LF",)),
    _parameter(
        "inverter.hysteresis",
        "A",
        0.25,
        (1e-3, 1e3),
        "Half band of the current hysteresis",
        unused_by=("ELF", "LF"),
        display="mA",
    ),
    _parameter("inverter.R_on", "Ohm", 0.01, (0.0, 10.0), "On-resistance of a switch or diode (plain ELF has none)"),
    _parameter(
        "inverter.dead_time",
        "s",
        5e-7,
        (0.0, 1e-4),
        "Both switches of a leg stay off for this time at each commutation (ELF: in saturation at a carrier)",
        unused_by=("LF",),
    ),
    _parameter(
        "sensor.resolver_bits",
        "1",
        16,
        (0, 24),
        "Resolver resolution, counts a motor turn = 2^bits; 0 is ideal",
        kind="Integer",
        unused_by=("ELF", "LF"),
    ),
    _parameter("monitor.tau", "s", 1e-3, (1e-4, 10.0), "Time constant of the filtered equivalent current"),
    _parameter(
        "driver.coupled_saturation",
        "",
        0,
        (0, 1),
        "ELF only: couple the phases through the star point in voltage saturation (ELF+)",
        kind="Boolean",
        unused_by=("HF", "LF"),
    ),
    _parameter("solver.step", "s", 1e-4, (1e-9, 1e-2), "Largest inner step", start_of={"HF": 2e-5}),
    _parameter(
        "solver.event_located",
        "",
        1,
        (0, 1),
        "HF only: step from event to event (true) or at fixed steps of solver.step (false)",
        kind="Boolean",
        unused_by=("ELF", "LF"),
    ),
    _parameter("initial.motor_position", "rad", 0.0, (None, None), "Rotor angle at the start", nominal=20.0),
    _parameter("initial.motor_speed", "rad/s", 0.0, (None, None), "Rotor speed at the start", nominal=100.0),
    _parameter(
        "initial.position", "rad", 0.0, (None, None), "User shaft angle at the start, held within the play", nominal=0.1
    ),
    _parameter("initial.phase_current_a", "A", 0.0, (None, None), "Current of phase a at the start"),
    _parameter("initial.phase_current_b", "A", 0.0, (None, None), "Current of phase b at the start; c balances"),
    _parameter("initial.reference_current", "A", 0.0, (None, None), "Current reference before the first sample"),
    _parameter("initial.current_filtered", "A", 0.0, (None, None), "Filtered equivalent current at the start"),
    _parameter(
        "initial.integral", "A", 0.0, (None, None), "Integral part of the controller at the start (LF: of the PID alone)"
    ),
    _parameter("fault.friction", "1", 1.0, (0.0, 20.0), "Scale of T_static and T_coulomb; healthy 1"),
    _parameter("fault.backlash", "1", 1.0, (0.0, 1000.0), "Scale of gear.backlash; healthy 1"),
    _parameter("fault.N_a", "1", 1.0, (0.3, 1.0), "Fraction of turns not shorted in phase a; healthy 1"),
    _parameter("fault.N_b", "1", 1.0, (0.3, 1.0), "Fraction of turns not shorted in phase b; healthy 1"),
    _parameter("fault.N_c", "1", 1.0, (0.3, 1.0), "Fraction of turns not shorted in phase c; healthy 1"),
    _parameter("fault.zeta", "1", 0.0, (0.0, 0.95), "Static rotor eccentricity, motor.p*zeta < 1; healthy 0", nominal=0.1),
    _parameter("fault.phi", "rad", 0.0, (-7.0, 7.0), "Phase of the eccentricity"),
    _parameter("fault.gain", "1", 1.0, (0.0, 10.0), "Scale of controller.K_pos, in a PID of K_p and K_i; healthy 1"),
    _parameter(
        "fault.jam",
        "N.m",
        0.0,
        (0.0, 1e3),
        "Jam: added to the static and Coulomb friction, motor side; healthy 0",
        nominal=0.1,
    ),
    _parameter("fault.magnet", "1", 1.0, (0.1, 1.0), "Magnet demagnetisation: scale of motor.K_e; healthy 1"),
    _parameter("fault.resistance", "1", 1.0, (0.5, 3.0), "Winding temperature: scale of motor.R; healthy 1"),
    _choice(
        "fault.open_switch",
        "none",
        {"none": 0, "a_upper": 1, "a_lower": 2, "b_upper": 3, "b_lower": 4, "c_upper": 5, "c_lower": 6},
        "Inverter switch that stays open, upper or lower of leg a, b or c; healthy none",
        unused_by=("LF",),
    ),
    _parameter(
        "fault.current_offset_a",
        "A",
        0.0,
        (-100.0, 100.0),
        "Offset of the current sensor of phase a; healthy 0",
        unused_by=("LF",),
        nominal=0.1,
        display="mA",
    ),
    _parameter(
        "fault.current_offset_b",
        "A",
        0.0,
        (-100.0, 100.0),
        "Offset of the current sensor of phase b; healthy 0",
        unused_by=("LF",),
        nominal=0.1,
        display="mA",
    ),
    _parameter(
        "fault.current_offset_c",
        "A",
        0.0,
        (-100.0, 100.0),
        "Offset of the current sensor of phase c; healthy 0",
        unused_by=("LF",),
        nominal=0.1,
        display="mA",
    ),
    _parameter(
        "fault.resolver_offset",
        "rad",
        0.0,
        (-4.0, 4.0),
        "Offset of the resolver, motor mechanical angle; healthy 0",
        unused_by=("LF",),
        nominal=0.1,
    ),
    # appended since version 0.1: value references that exist never move
    _output("end_stop_torque", "N.m", "Torque of the end stops on the motor shaft, mean over the last communication step"),
    _output("voltage_saturated_real", "1", "voltage_saturated as a Real, 0 or 1, for hosts that read Reals only"),
    _choice(
        "fault.eccentricity_law",
        "shifted",
        {"shifted": 1, "common": 2},
        "Cosine of the eccentricity in phases b and c: shifted with the phase, or common to all phases",
    ),
    # the drive as sold
    _choice(
        "controller.structure",
        "cascade",
        {"cascade": 1, "pid": 2},
        "Control law: P on position and PI on speed, or PID on the motor's position",
    ),
    _parameter("controller.K_d", "A.s2/rad", 0.0, (0.0, 1e3), "Cascade: gain of the speed error's derivative"),
    _parameter("controller.T_d", "s", 1e-3, (0.0, 10.0), "Cascade: filter of the speed error's derivative"),
    _parameter("controller.pid.K_p", "A/rad", 62.0, (0.0, 1e6), "PID: proportional gain, motor side"),
    _parameter("controller.pid.K_i", "A/(rad.s)", 400.0, (0.0, 1e8), "PID: integral gain, motor side"),
    _parameter("controller.pid.K_d", "A.s/rad", 1.3, (0.0, 1e3), "PID: derivative gain, motor side"),
    _parameter("controller.pid.T_f", "s", 1e-4, (0.0, 10.0), "PID: filter of the derivative"),
    _parameter(
        "controller.pid.b",
        "1",
        52.0 / 62.0,
        (0.0, 10.0),
        "PID: weight of the command in the proportional part; 1: on the error",
    ),
    _parameter(
        "controller.pid.c",
        "1",
        0.0,
        (0.0, 10.0),
        "PID: weight of the command in the derivative; 1: on the error",
        nominal=1.0,
    ),
    _parameter("controller.feedforward_speed", "A.s/rad", 0.0, (0.0, 1e3), "Feed-forward of the commanded motor speed"),
    _parameter(
        "controller.feedforward_acceleration",
        "A.s2/rad",
        0.0,
        (0.0, 1e3),
        "Feed-forward of the commanded motor acceleration",
    ),
    _choice(
        "controller.current_control",
        "ideal",
        {"ideal": 1, "field_oriented": 2},
        "Current control: each phase follows its reference, or a sampled d/q loop; field_oriented goes with a carrier",
    ),
    _parameter(
        "controller.current.bandwidth",
        "rad/s",
        6283.0,
        (1.0, 1e6),
        "Field oriented: bandwidth from which the loop's gains follow, unless both are stated",
    ),
    _parameter(
        "controller.current.K_p",
        "V/A",
        0.0,
        (0.0, 1e5),
        "Field oriented: stated proportional gain; 0: by bandwidth",
        nominal=1.0,
    ),
    _parameter(
        "controller.current.K_i",
        "V/(A.s)",
        0.0,
        (0.0, 1e9),
        "Field oriented: integral gain beside a stated proportional one",
        nominal=1e3,
    ),
    _parameter(
        "controller.current.decoupling",
        "1",
        1.0,
        (0.0, 2.0),
        "Field oriented: share of the cross voltage p*w*L*i fed forward",
        unused_by=("LF",),
    ),
    _parameter("controller.current.emf_forward", "1", 1.0, (0.0, 2.0), "Field oriented: share of the back-EMF fed forward"),
    _choice(
        "inverter.modulation",
        "hysteresis",
        {"hysteresis": 1, "sine_triangle": 2, "space_vector": 3},
        "How the legs are switched: by the current's hysteresis, or at a carrier, by sine or space vector",
    ),
    _parameter(
        "inverter.carrier_frequency", "Hz", 20e3, (100.0, 1e6), "Carrier; the current loop runs at each of its peaks"
    ),
    _parameter(
        "inverter.minimum_pulse",
        "s",
        0.0,
        (0.0, 1e-3),
        "Carrier: shorter pulses are dropped, or lengthened where utilisation keeps off the rails",
        unused_by=("ELF", "LF"),
        nominal=1e-6,
    ),
    _parameter("inverter.utilisation", "1", 1.0, (0.05, 1.0), "Carrier: share of V_dc that the modulation reaches"),
    _parameter(
        "sensor.counts",
        "1/turn",
        0.0,
        (0.0, 1e9),
        "Feedback in the control law, counts a motor turn; 0: by sensor.resolver_bits",
        unused_by=("ELF", "LF"),
        nominal=1e3,
    ),
    _output("measured_motor_position", "rad", "Rotor angle as the controller has last measured it", nominal=20.0),
    _output("measured_current", "A", "Quadrature current as the controller has last measured it"),
    _parameter(
        "mechanics.T_asymmetry",
        "N.m",
        0.0,
        (-100.0, 100.0),
        "Added to the dry friction in positive direction, taken off in negative, on the motor side",
        nominal=0.01,
    ),
    *(
        _parameter(
            f"fault.current_gain_{j}",
            "1",
            1.0,
            (0.1, 10.0),
            f"Gain of the current sensor of phase {j}; healthy 1",
            unused_by=("LF",),
        )
        for j in "abc"
    ),
)

INDEX: dict[str, int] = {variable.name: reference for reference, variable in enumerate(VARIABLES)}
"""Value reference of each name, which is also its place in the kernels' array `v`."""

INPUTS = tuple(variable for variable in VARIABLES if variable.causality == "input")
OUTPUTS = tuple(variable for variable in VARIABLES if variable.causality == "output")
PARAMETERS = tuple(variable for variable in VARIABLES if variable.causality == "parameter")
FAULTS = tuple(variable for variable in PARAMETERS if variable.name.startswith("fault."))


def starts(model: str) -> list[float]:
    """Start values of all variables of the twin `model`, in the order of their value references."""
    return [variable.start_for(model) for variable in VARIABLES]
