"""The symbols of the equations: what each means, in which unit, and where it comes from.

How names are made of them: a suffix _j is a phase's (j = a, b, c), and without it the symbol is that of all three or of
what they share; _middle is in the middle of a step, _new at its end, _mean over it; a name that starts with per_ is one
over the rest of it. Where sine and cosine of theta_e and of theta_j stand side by side, the latter are `sines`, `cosines`.

Sources: "paper" is Quattrocchi, Dalla Vedova, Berri: J. Phys. Conf. Ser. 2526 (2023) 012076; "Borello" is the dry friction
with a static and a Coulomb limit after L. Borello (Politecnico di Torino); "ours" is this project's. Where none is named,
the definition is the textbooks'.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Symbol:
    """One symbol: unit "" for a record or a choice, "1" for a plain number; `port` is the variable that holds it."""

    name: str
    unit: str
    meaning: str
    definition: str = ""
    source: str = ""
    port: str = ""


_ALL = (
    # angles and motion
    Symbol("theta", "rad", "rotor angle, mechanical", port="motor_position"),
    Symbol("theta_e", "rad", "rotor angle, electrical", "p*theta"),
    Symbol("theta_max", "rad", "the rotor's end stop", "(end_stop + half_play)*G", "ours"),
    Symbol("angle", "rad", "any angle"),
    Symbol("s", "1", "sine of theta_e; s_j of theta_j", "theta_j = theta_e - 2*pi*j/3, j = 0, 1, 2 for a, b, c"),
    Symbol("c", "1", "cosine of theta_e; c_j of theta_j", "as s_j"),
    Symbol("w", "rad/s", "rotor speed, mechanical", "dtheta/dt", port="motor_speed"),
    Symbol("w_e", "rad/s", "rotor speed, electrical", "p*w"),
    Symbol("p", "1", "pole pairs", port="motor.p"),
    Symbol("x", "rad", "gear's angle at the user shaft, before the play", "theta/G"),
    Symbol("position", "rad", "user shaft angle, after the play", port="position"),
    Symbol("G", "1", "gear ratio, motor to user shaft", port="gear.ratio"),
    Symbol("to_tick", "s", "time to the controller's next tick"),
    Symbol("longest", "s", "longest step", port="solver.step"),
    Symbol("half_play", "rad", "half of the play at the user shaft", "gear.backlash*fault.backlash/2", "ours"),
    Symbol("end_stop", "rad", "end stops of the user shaft, at plus and minus", source="ours", port="mechanics.end_stop"),
    Symbol("before", "rad", "rotor angle at the beginning of a step"),
    Symbol("turning", "rad/s", "how fast theta_e turns", "abs(w_e)"),
    Symbol("h", "s", "length of a step; in a search for an event, the shortest so far"),
    Symbol("bits", "1", "resolution of the resolver: 2^bits counts a turn", source="ours", port="sensor.resolver_bits"),
    # mechanics
    Symbol("J", "kg.m2", "inertia of all that moves, motor side", port="mechanics.J"),
    Symbol("C", "N.m.s/rad", "viscous friction coefficient, motor side", port="mechanics.C"),
    Symbol("T_m", "N.m", "motor torque", "sum(k_j*i_j)", port="motor_torque"),
    Symbol("T_L", "N.m", "load torque, motor side", "load_torque/G"),
    Symbol("T_f", "N.m", "dry friction torque; PID [s]: its filter", "mechanics.rotor", "Borello", "friction_torque"),
    Symbol("T_static", "N.m", "limit of the dry friction at rest", source="Borello", port="mechanics.T_static"),
    Symbol("T_coulomb", "N.m", "dry friction of the moving rotor", source="Borello", port="mechanics.T_coulomb"),
    Symbol("loss_opposing", "1", "friction per load torque that opposes the motion", "1/eta_opposing - 1", "ours"),
    Symbol("loss_aiding", "1", "friction per load torque that aids the motion", "1 - eta_aiding", "ours"),
    Symbol("T_asymmetry", "N.m", "half of what dry friction in positive direction has more", port="mechanics.T_asymmetry"),
    Symbol("stiffness", "1/s2", "square of a rotor's angular frequency in a loop"),
    Symbol("direction", "", "a number with the sign of the motion, or of what would start it"),
    # controller
    Symbol("command", "rad", "commanded user shaft angle", port="command"),
    Symbol("K_pos", "1/s", "gain of the position loop", source="paper's structure", port="controller.K_pos"),
    Symbol("K_motor", "1/s", "gain of the position loop, motor side, with its fault", "fault.gain*K_pos*G", "ours"),
    Symbol("speed_limit", "rad/s", "limit of the speed reference", source="ours", port="controller.speed_limit"),
    Symbol("w_ref", "rad/s", "speed reference", "clamp(K_motor*(command - position), +-speed_limit)", "ours"),
    Symbol(
        "K_p",
        "A.s/rad",
        "proportional gain; PID: A/rad; current loop: V/A",
        source="paper's structure",
        port="controller.K_p",
    ),
    Symbol(
        "K_i",
        "A/rad",
        "integral gain; PID: A/(rad.s); current loop: V/(A.s)",
        source="paper's structure",
        port="controller.K_i",
    ),
    Symbol("T_c", "s", "sampling period of the controller", source="ours", port="controller.period"),
    Symbol("xi", "A", "integral part of the control law; current loop: V", "cascade.sampled", "ours", "controller.integral"),
    Symbol("current_limit", "A", "limit of the current reference", source="ours", port="controller.current_limit"),
    Symbol("I_ref", "A", "current reference", "clamp(K_p*(w_ref - w) + xi, +-current_limit)", "ours", "reference_current"),
    Symbol("memory", "", "derivative.Memory"),
    Symbol("last", "", "derivative.Commanded"),
    Symbol("ahead", "A", "feed-forward", "derivative.ahead", "ours"),
    Symbol("forward", "", "derivative.Forward"),
    Symbol("K_d", "A.s2/rad", "gain of the derivative; PID: A.s/rad", port="controller.K_d"),
    Symbol("T_d", "s", "filter of the speed error's derivative", source="ours", port="controller.T_d"),
    Symbol("D", "A", "derivative part of a control law", "derivative.backward", "ours"),
    Symbol("e_d", "rad", "what it is the derivative of; cascade: rad/s"),
    Symbol("r", "rad", "commanded motor position", "G*command"),
    Symbol("dr", "rad", "its change at the last sample"),
    Symbol("samples", "1", "samples so far, at most 2"),
    Symbol("scale", "1", "fault of a gain", port="fault.gain"),
    Symbol("b_weight", "1", "weight of the command in the PID's proportional part", port="controller.pid.b"),
    Symbol("c_weight", "1", "weight of the command in the PID's derivative", port="controller.pid.c"),
    Symbol("speed", "A.s/rad", "feed-forward of the commanded motor speed", port="controller.feedforward_speed"),
    Symbol(
        "acceleration", "A.s2/rad", "feed-forward of the commanded acceleration", port="controller.feedforward_acceleration"
    ),
    Symbol("change", "", "change of a quantity over a sample or a step"),
    Symbol("counts", "1/turn", "feedback in the control law", source="ours", port="sensor.counts"),
    # current loop
    Symbol("T", "s", "period of a sampled loop; of the current loop half a carrier period", "1/(2*carrier_frequency)"),
    Symbol("bandwidth", "rad/s", "of the current loop", port="controller.current.bandwidth"),
    Symbol("K", "V/A", "proportional gain of the current loop", "current_loop.gains", "ours"),
    Symbol("decoupling", "1", "share of the cross voltage fed forward", port="controller.current.decoupling"),
    Symbol("emf_forward", "1", "share of the back-EMF fed forward", port="controller.current.emf_forward"),
    Symbol("dq", "", "frame.Dq, a vector in the rotor's frame"),
    Symbol("loop", "", "current_loop.Loop"),
    Symbol("of", "", "current_loop.Response of a loop"),
    Symbol("passage", "", "current_loop.Passage"),
    Symbol("M_xx", "1", "of the matrix M of a sample or a step", "current_loop", "ours"),
    Symbol("M_xy", "S", "of the matrix M", "current_loop", "ours"),
    Symbol("M_yx", "Ohm", "of the matrix M", "current_loop", "ours"),
    Symbol("M_yy", "1", "of the matrix M", "current_loop", "ours"),
    Symbol("decay_1", "1/s", "decay of the current loop's faster part", "current_loop.response", "ours"),
    Symbol("decay_2", "1/s", "decay of its slower part", "current_loop.response", "ours"),
    Symbol("stiff", "Ohm", "resistance by which the loop opposes an unexpected current", "current_loop.over", "ours"),
    Symbol("share", "1", "where between a step's ends the mean current lies", source="ours"),
    Symbol("follow", "1", "share of the difference from the inverter's voltage that xi takes up in a step", source="ours"),
    Symbol("u", "V", "voltage that is asked for"),
    Symbol("given", "V", "voltage that the inverter gave; modulator.carrier.Given", source="ours"),
    Symbol("aim", "", "averaged.Aim"),
    Symbol(
        "K_aa", "1/H", "of the star in two currents: slope of i_a by the voltage of a about c", "known_edges.pair", "ours"
    ),
    Symbol("K_ab", "1/H", "slope of i_a by the voltage of b about c", "known_edges.pair", "ours"),
    Symbol("K_bb", "1/H", "slope of i_b by the voltage of b about c", "known_edges.pair", "ours"),
    Symbol("M_aa", "1/s", "slope of i_a by i_a", "known_edges.pair", "ours"),
    Symbol("M_ab", "1/s", "slope of i_a by i_b", "known_edges.pair", "ours"),
    Symbol("M_ba", "1/s", "slope of i_b by i_a", "known_edges.pair", "ours"),
    Symbol("M_bb", "1/s", "slope of i_b by i_b", "known_edges.pair", "ours"),
    Symbol("charge", "C", "charge that the supply gives"),
    Symbol("square", "A2.s", "integral of the sum of N_j*i_j^2"),
    Symbol("on", "s", "time for which the upper switch of a leg is to be on", source="ours"),
    Symbol("span", "s", "time over which a leg's changes are known beforehand", source="ours"),
    Symbol("over", "", "known_edges.Integrals over a time"),
    Symbol("current_error", "A", "x of the current loop", "I_ref - i_q, -i_d"),
    Symbol("voltage_error", "V", "y of the current loop", "xi - R*r - D"),
    Symbol("frames", "", "averaged.Frames"),
    Symbol("s_0", "1", "sine of theta_e at a step's beginning; s_1 at its end"),
    Symbol("c_0", "1", "cosine of theta_e at a step's beginning; c_1 at its end"),
    Symbol("s_1", "1", "as s_0"),
    Symbol("c_1", "1", "as c_0"),
    Symbol("plant", "", "averaged.Plant"),
    Symbol("unlike", "", "whether the machine is not the one that the loop was designed for"),
    Symbol("senses", "", "whether a current sensor has a fault"),
    Symbol("sensors", "", "modulator.reference.Sensors"),
    Symbol("target", "A", "what the sensors are to show"),
    Symbol("top", "V", "the most that a leg gives about the mid-point", "utilisation*V_dc/2", "ours"),
    Symbol("injects", "", "whether the modulation is that of space vectors"),
    Symbol("space_vector", "", "as injects"),
    Symbol("rising", "", "whether the carrier rises in this half of its period"),
    Symbol("least", "s", "shortest pulse", port="inverter.minimum_pulse"),
    Symbol("keeps_off", "", "whether the utilisation keeps the legs off the rails"),
    Symbol("edge", "s", "time to a leg's next edge"),
    Symbol("pulse", "", "modulator.carrier.Pulse"),
    Symbol("shown", "A/s", "slope of a current as its sensor shows it"),
    # current control and modulation
    Symbol("i_ref", "A", "current reference of the phases", "-I_ref*sin(theta_j)", "ours"),
    Symbol("delta", "rad", "electrical error of the measured angle, latched at the sample", "p*(measured - theta)", "ours"),
    Symbol("cos", "A", "of a reference", "I_ref*cos(delta)", "ours"),
    Symbol("sin", "A", "of a reference", "I_ref*sin(delta)", "ours"),
    Symbol("offset", "A", "offset of a current sensor", source="ours"),
    Symbol("error", "A", "current error", "i_ref_j - i_j - offset_j"),
    Symbol("band", "A", "half band of the hysteresis", source="ours", port="inverter.hysteresis"),
    Symbol("margin", "A", "how close to the band counts as there", source="ours"),
    Symbol(
        "closing", "A/s", "how fast a leg's error nears the band; 0: not known", "side_j*(di_j/dt - di_ref_j/dt)", "ours"
    ),
    Symbol("slope", "A/s", "slope of a phase current", "g_j*(d_j - v_n)"),
    Symbol("decay", "1/s", "decay of a phase current", "R_j/L_j"),
    # inverter
    Symbol("V_dc", "V", "DC bus voltage", source="paper", port="supply_voltage"),
    Symbol("R_on", "Ohm", "resistance of a switch or a diode that conducts", source="ours", port="inverter.R_on"),
    Symbol("dead_time", "s", "both switches of a leg stay off at a commutation", source="ours", port="inverter.dead_time"),
    Symbol("dead_left", "s", "what is left of a leg's dead time", source="ours"),
    Symbol("side", "1", "commanded side of a leg: +1 upper switch, -1 lower"),
    Symbol("gate", "1", "switch of a leg that conducts: +1 upper, -1 lower, 0 none"),
    Symbol("rail", "1", "rail that a leg is tied to: +1 upper, -1 lower, 0 none"),
    Symbol("open_side", "1", "side whose switch stays open: +1 upper, -1 lower, 0 none", "fault.open_switch", "ours"),
    Symbol("open_switch", "", "number of the switch that stays open", source="ours", port="fault.open_switch"),
    Symbol("number", "1", "number of a leg: 0, 1, 2 for a, b, c"),
    Symbol("v", "V", "voltage of a leg about the mid-point of the bus", "rail_j*V_dc/2"),
    Symbol("v_open", "V", "voltage of a leg's terminal that is tied to no rail", "v_n + e_j"),
    # windings
    Symbol(
        "N", "1", "fraction of a phase's turns that are not shorted", source="paper; that it is not its complement, ours"
    ),
    Symbol(
        "R",
        "Ohm",
        "resistance of a phase; R_j with its shorts",
        "R_j = N_j*R, in a circuit + R_on",
        "paper, Eq. 1",
        "motor.R",
    ),
    Symbol("L", "H", "inductance of a phase; L_j with its shorts", "L_j = N_j^2*L", "ours", "motor.L"),
    Symbol("K_e", "V.s/rad", "back-EMF coefficient of a phase, peak", source="paper", port="motor.K_e"),
    Symbol("zeta", "1", "static eccentricity of the rotor", source="paper", port="fault.zeta"),
    Symbol("phi", "rad", "phase of the eccentricity", source="paper", port="fault.phi"),
    Symbol("z_cos", "1", "eccentricity of a phase", "p*zeta*cos(phi_j)", "paper, Eq. 2; phi_j: windings.Field"),
    Symbol("z_sin", "1", "eccentricity of a phase", "p*zeta*sin(phi_j)", "paper, Eq. 2; phi_j: windings.Field"),
    Symbol("k", "V.s/rad", "back-EMF coefficient of a phase at its angle", "windings.back_emf_coefficient", "paper, Eq. 2"),
    Symbol("e", "V", "back-EMF", "k_j*w", "paper, Eq. 2"),
    Symbol("i", "A", "current of a phase; LF's equivalent current"),
    Symbol("g", "1/H", "inverse inductance of a phase that conducts", "1/L_j"),
    Symbol("d", "V", "voltage that is left for an inductance and the star point", "v_j - R_j*i_j - e_j"),
    Symbol("v_n", "V", "voltage of the star point", "sum(g_j*d_j)/sum(g_j)"),
    # drivers without switching
    Symbol("z", "1", "decay of a current over a step", "h*R_j/L_j"),
    Symbol("X_L", "Ohm", "voltage per change of current over a step, of an inductance", "L_j/h"),
    Symbol("hR", "Ohm.s", "the same by the inductance", "h*R_j"),
    Symbol("y", "S", "change of current over a step per volt", "1/max(L_j/h + R_j/2, R_j)", "ours"),
    Symbol("hold", "V", "leg voltage that holds the current as it is", "e_j + R_j*i_j", "ours"),
    Symbol("need", "V", "leg voltage that takes the current to its reference", "(i_ref_j - i_j)/y_j + hold_j", "ours"),
    Symbol("limited", "", "whether the voltage has limited a current", port="voltage_saturated"),
    Symbol("R_eq", "Ohm", "LF's equivalent resistance", "(2/3)*R*sum(N_j*s_j^2) + R_on", "ours"),
    Symbol("f", "1", "LF's shape function", "(2/3)*sum(N_j*s_j^2*[1 + p*zeta*cos(theta_j - phi)])", "ours"),
    # monitor
    Symbol("q", "A", "equivalent (quadrature) current", "-i_alpha*s + i_beta*c", "paper", "equivalent_current"),
    Symbol("i_filtered", "A", "filtered equivalent current", source="ours", port="equivalent_current_filtered"),
    Symbol("tau", "s", "time constant of the filtered equivalent current", source="ours", port="monitor.tau"),
    Symbol("smoothing", "1", "of the low-pass over a step", "min(1, h/(tau + h/2))", "ours"),
    # records
    Symbol("is_live", "", "whether the supply lets the inverter switch", "V_dc >= inverter.LEAST_SUPPLY", "ours"),
    Symbol("load", "N.m", "load torque on the user shaft", port="load_torque"),
    Symbol("gain", "", "gain of a loop [1/s], or of the current sensors"),
    Symbol("lag", "s", "lag of a loop"),
    Symbol("gains", "", "cascade.Gains"),
    Symbol("ref", "", "modulator.reference.Reference"),
    Symbol("comparator", "", "hysteresis.Comparator"),
    Symbol("leg", "", "inverter.Leg"),
    Symbol("legs", "", "inverter.Leg of the three legs"),
    Symbol("star", "", "windings.Star"),
    Symbol("phases", "", "windings.Series"),
    Symbol("circuit", "", "circuit.Circuit"),
    Symbol("field", "", "windings.Field"),
    Symbol("friction", "", "mechanics.Friction"),
    # plain numbers
    Symbol("value", "", "any number"),
    Symbol("re", "", "real part of a number"),
    Symbol("im", "", "imaginary part of a number"),
    Symbol("low", "", "a lower limit"),
    Symbol("high", "", "an upper limit"),
)
SYMBOLS: dict[str, Symbol] = {symbol.name: symbol for symbol in _ALL}
SUFFIXES = ("_a", "_b", "_c", "_j", "_middle", "_new", "_mean")


def find(name: str) -> Symbol | None:
    """The symbol that a name in the equations is made of; None if there is none."""
    if name in SYMBOLS:
        return SYMBOLS[name]
    for suffix in SUFFIXES:
        if name.endswith(suffix):
            return find(name.removesuffix(suffix))
    return find(name.removeprefix("per_")) if name.startswith("per_") else None
