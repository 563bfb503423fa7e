"""HF's machine between two switchings: its states, and a step by the midpoint rule.

Between switchings the equations are smooth and are stepped by the midpoint rule (second order; implicit in the resistances
where they bend the currents within a step). How far a step goes is not said here.
"""

from typing import NamedTuple

from ..physics import inverter, monitor, windings
from ..physics.circuit import damped, mean, mean_square, stopped_at_zero, toward
from ..physics.inverter import Leg
from ..physics.jit import kernel
from ..physics.modulator import hysteresis, reference
from ..physics.phases import Abc, three_phases
from ..physics.trig import clamp, rotate, sincos
from . import actuator, drive, host, layout
from .host import clock, partial, told
from .layout import derived, now, since
from .memory import Moving, State, places, port, whole

OWN = (
    State("ref_cos", "A", "I_ref times the cosine of the latched error of the electrical angle"),
    State("ref_sin", "A", "I_ref times its sine"),
    *(State(f"side_{j}", "1", f"commanded side of leg {j}: +1 upper switch, -1 lower") for j in "abc"),
    *(State(f"dead_left_{j}", "s", f"what is left of the dead time of leg {j}") for j in "abc"),
    *(
        State(f"closing_{j}", "A/s", f"how fast the current error of leg {j} neared the band in the last step")
        for j in "abc"
    ),
    *(State(f"edge_{j}", "s", f"carrier: time to the next edge of leg {j}") for j in "abc"),
    State("peak", "1", "carrier: the number of the peak at which the current loop is sampled next"),
)
"""What HF remembers of its motion beside what all fidelities do."""
STATES = whole(layout.ONCE, (*layout.MOVING, *OWN))
N_STATES = len(STATES)
MOVING = Moving(len(layout.ONCE), len(layout.MOVING) + len(OWN))
own = places("own", OWN, first=len(layout.ONCE) + len(layout.MOVING))

MOST_STEPS = 20000
"""Bound of event-located steps in 1e-4 s, beside those that the longest step asks for; a healthy run takes some 60."""
MARGIN = 4e-3
"""Event-located: a current error this close to the band, as a fraction of it, has reached it. The relative tolerance of an
experiment, if one is given, takes its place, within FINEST and COARSEST."""
FINEST, COARSEST = 1e-5, 0.05
STIFF = 0.05
"""h*R_j/L_j from which a step is implicit in the resistance; below it the explicit midpoint rule is as good and cheaper."""


class Machine(NamedTuple):
    """What stays as it is within a communication step."""

    p: float
    R: float
    tau: float
    N: Abc
    field: windings.Field
    phases: windings.Series
    star: windings.Star
    comparator: hysteresis.Comparator
    open_side: Abc
    sensors: reference.Sensors


class Sums(NamedTuple):
    """Filtered equivalent current, supply charge, copper loss."""

    i_filtered: float
    charge: float
    loss: float


@kernel
def machine(v, x):
    """The machine with its faults."""
    N, R, band = actuator.turns(v), x[derived.R], v[port.inverter.hysteresis]
    tolerance = clamp(x[told.tolerance], FINEST, COARSEST) if x[told.tolerance] > 0.0 else MARGIN
    margin = tolerance * band if v[port.solver.event_located] != 0.0 else 0.0
    sensors = drive.sensors(v)
    phases = windings.series(N, R, v[port.inverter.R_on], v[port.motor.L])
    return Machine(
        v[port.motor.p],
        R,
        v[port.monitor.tau],
        N,
        actuator.field(x),
        phases,
        windings.star(phases),
        hysteresis.Comparator(band, margin, v[port.inverter.dead_time], sensors.gain),
        inverter.open_sides(v[port.fault.open_switch]),
        sensors,
    )


@kernel
def read(x):
    """What moves, from `x`: motion, currents, legs, sums."""
    legs = Abc(
        Leg(x[own.side_a], x[own.dead_left_a], x[own.closing_a]),
        Leg(x[own.side_b], x[own.dead_left_b], x[own.closing_b]),
        Leg(x[own.side_c], x[own.dead_left_c], x[own.closing_c]),
    )
    return actuator.motion(x), actuator.currents(x), legs, Sums(x[now.i_filtered], x[now.charge], x[now.loss])


@kernel
def write(x, motion, i, legs, sums):
    """What moves, into `x`."""
    actuator.write_motion(x, motion)
    actuator.write_currents(x, i)
    x[own.side_a], x[own.dead_left_a], x[own.closing_a] = legs.a
    x[own.side_b], x[own.dead_left_b], x[own.closing_b] = legs.b
    x[own.side_c], x[own.dead_left_c], x[own.closing_c] = legs.c
    x[now.i_filtered], x[now.charge], x[now.loss] = sums


@kernel
def set_aside(v, x, motion, i, legs, sums, elapsed):
    """Before a partial step, `elapsed` [s] after the last tick: keep what moves as it is."""
    write(x, motion, i, legs, sums)
    x[clock.offset] = elapsed
    host.back_up(v, x, MOVING)


@kernel
def leave(x, motion, i, legs, sums, elapsed):
    """At a communication point: what moves, into `x`; the time since the last tick, unless a partial step has led here."""
    write(x, motion, i, legs, sums)
    if x[partial.pending] == 0.0:
        x[clock.offset] = elapsed


@kernel
def sample(v, x, motion, i, t):
    """The controller's sample at time `t` [s], through its sensors: writes the reference, returns the motion with sine and
    cosine made anew."""
    p = v[port.motor.p]
    seen = drive.look(v, motion.theta, motion.position)
    I_ref = drive.control(v, x, t, seen, motion.w)
    s_off, c_off = sincos(p * (seen.angle - motion.theta))
    x[own.ref_cos], x[own.ref_sin] = I_ref * c_off, I_ref * s_off
    s, c = sincos(p * motion.theta)
    drive.show(v, x, seen.motor_position, i, s * c_off + c * s_off, c * c_off - s * s_off)
    return actuator.Motion(motion.theta, motion.w, motion.position, s, c, motion.T_f, motion.stop)


@kernel
def _sum_up(m, sums, rail, i, i_mean, i_new, s, c, h):
    """The sums after a step h; s, c at its middle, i_mean the mean currents over it."""
    N = m.N
    loss = sums.loss + h * m.R * (
        N.a * mean_square(i.a, i_new.a) + N.b * mean_square(i.b, i_new.b) + N.c * mean_square(i.c, i_new.c)
    )
    q = monitor.quadrature_current(i_mean, s, c)
    i_filtered = monitor.low_pass(sums.i_filtered, q, monitor.smoothing(h, m.tau))
    charge = sums.charge + 0.5 * h * (rail.a * i_mean.a + rail.b * i_mean.b + rail.c * i_mean.c)
    return Sums(i_filtered, charge, loss)


@kernel
def midpoint(v, x, m, motion, i, legs, sums, circuit, load, h):
    """A step h by the midpoint rule: the middle from the slopes at the beginning, the step from the slopes at the middle.

    Where the resistances bend the currents within the step (STIFF), it is implicit in them. What is summed up takes that
    bend into account: third order, at one step a commutation.
    """
    s, c = rotate(motion.s, motion.c, 0.5 * m.p * motion.w * h)
    sines, cosines = three_phases(s, c)
    k = windings.back_emf_coefficients(m.N, m.field, sines, cosines)
    slope, g = circuit.slope, circuit.g
    stiff = h * m.star.decay > STIFF
    if stiff:
        middle = toward(m.star, i, slope, 0.5 * h)
    else:
        middle = Abc(i.a + 0.5 * h * slope.a, i.b + 0.5 * h * slope.b, i.c + 0.5 * h * slope.c)
    w_mean, theta, w, position, T_f, stop = actuator.move(v, x, motion, windings.torque(k, middle), load, h)
    e = windings.back_emf(k, w_mean)
    if stiff:
        d, g = windings.inductor_voltages(circuit.v, m.star.R, i, e), damped(m.star, g, h)
        v_n = windings.star_point(d, g, windings.per_sum(g))
    else:
        d = windings.inductor_voltages(circuit.v, m.star.R, middle, e)
        v_n = windings.star_point(d, g, circuit.per_g)
    i_new = Abc(i.a + h * g.a * (d.a - v_n), i.b + h * g.b * (d.b - v_n), i.c + h * g.c * (d.c - v_n))
    legs = inverter.aged(legs, h)
    if circuit.gate.a * circuit.gate.b * circuit.gate.c == 0.0:
        i_new = stopped_at_zero(legs, m.open_side, circuit.is_live, i, i_new, g)
    if stiff:
        i_mean = windings.mean_currents(i, i_new, m.phases, h)
    else:
        i_mean = Abc(mean(i.a, middle.a, i_new.a), mean(i.b, middle.b, i_new.b), mean(i.c, middle.c, i_new.c))
    sums = _sum_up(m, sums, circuit.rail, i, i_mean, i_new, s, c, h)
    s, c = rotate(motion.s, motion.c, m.p * (theta - motion.theta))
    return actuator.Motion(theta, w, position, s, c, T_f, stop), i_new, legs, sums


@kernel
def tick(x):
    """End a controller period."""
    x[clock.tick] += 1.0


@kernel
def mark(x, limited):
    """Whether the voltage limits, as it is found now."""
    x[now.limited] = 1.0 if limited else 0.0
    x[since.limited] += x[now.limited]
