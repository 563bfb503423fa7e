"""HF at a carrier: the sampled current loop, and legs whose edges are known beforehand.

A step is half a carrier period, or a part of it up to the controller's tick. In it the back-EMF is that of its middle, so
that the currents are those of a linear circuit from edge to edge, second order and without a search; the rotor then moves
once, under the mean torque.
"""

from ..physics import current_loop, events, inverter, known_edges, monitor, stability, windings
from ..physics.circuit import connect, damped, mean_square, stopped_at_zero
from ..physics.frame import Dq, to_frame, to_phases
from ..physics.jit import kernel
from ..physics.known_edges import Integrals
from ..physics.modulator import carrier, reference
from ..physics.phases import Abc, three_phases
from ..physics.trig import rotate
from . import actuator, drive, host, switched
from .host import clock, inputs
from .layout import now
from .memory import port
from .status import Status
from .switched import MOST_STEPS, STIFF, own


@kernel
def _peak(v, x, loop, sensors, motion, i, legs, V_dc):
    """A peak of the carrier: the current loop's sample, through its sensors. Writes xi and the limit, returns the legs and
    the times to their edges in the half period that begins."""
    p, T = v[port.motor.p], loop.T
    seen = drive.look(v, motion.theta, motion.position)
    s, c = rotate(motion.s, motion.c, p * (seen.angle - motion.theta))
    i_dq = to_frame(reference.measured(i, sensors), s, c)
    xi, I_ref = Dq(x[now.xi_d], x[now.xi_q]), x[now.I_ref]
    u = current_loop.voltages(loop, I_ref, xi, i_dq, motion.w, p * motion.w)
    s, c = rotate(s, c, 0.5 * p * motion.w * T)
    given = carrier.modulate(to_phases(u, s, c), drive.top(v, V_dc), drive.injects(v))
    v_dq = to_frame(given.v, s, c) if given.limited else u
    x[now.xi_d], x[now.xi_q] = current_loop.integrated(loop, I_ref, xi, i_dq, u, v_dq)
    switched.mark(x, given.limited or not inverter.live(V_dc))
    rising = int(x[own.peak]) & 1 == 0
    x[own.peak] += 1.0
    least, keeps_off = v[port.inverter.minimum_pulse], v[port.inverter.utilisation] < 1.0
    half, per_V = (0.5 * T, T / V_dc) if V_dc > 0.0 else (0.0, 0.0)
    a = carrier.pulse(half + given.v.a * per_V, rising, T, least, keeps_off)
    b = carrier.pulse(half + given.v.b * per_V, rising, T, least, keeps_off)
    c = carrier.pulse(half + given.v.c * per_V, rising, T, least, keeps_off)
    dead_time = v[port.inverter.dead_time]
    legs = Abc(carrier.begun(legs.a, a, dead_time), carrier.begun(legs.b, b, dead_time), carrier.begun(legs.c, c, dead_time))
    return legs, Abc(a.edge, b.edge, c.edge)


@kernel
def _segment(m, i, legs, circuit, e, h):
    """The currents after a time h in which no voltage changes, and their mean: second order in what the resistances bend,
    as by the midpoint rule, which would solve the star twice; implicit in them where they bend much (STIFF)."""
    slope, g = circuit.slope, circuit.g
    if h * m.star.decay > STIFF:
        d, g = windings.inductor_voltages(circuit.v, m.star.R, i, e), damped(m.star, g, h)
        v_n = windings.star_point(d, g, windings.per_sum(g))
        i_new = Abc(i.a + h * g.a * (d.a - v_n), i.b + h * g.b * (d.b - v_n), i.c + h * g.c * (d.c - v_n))
        i_mean = windings.mean_currents(i, i_new, m.phases, h)
    else:
        bend = windings.bend(m.star, g, circuit.per_g, slope)
        half, sixth = 0.5 * h, h * h * (1.0 / 6.0)
        i_new = Abc(
            i.a + h * (slope.a - half * bend.a), i.b + h * (slope.b - half * bend.b), i.c + h * (slope.c - half * bend.c)
        )
        i_mean = Abc(
            i.a + half * slope.a - sixth * bend.a,
            i.b + half * slope.b - sixth * bend.b,
            i.c + half * slope.c - sixth * bend.c,
        )
    if circuit.gate.a * circuit.gate.b * circuit.gate.c == 0.0:
        i_new = stopped_at_zero(legs, m.open_side, circuit.is_live, i, i_new, g)
    return i_new, i_mean


@kernel
def _tied(m, legs, V_dc, span):
    """Whether each leg is tied to the rail of its side, and the resistances bend the currents little."""
    dead = legs.a.dead_left > 0.0 or legs.b.dead_left > 0.0 or legs.c.dead_left > 0.0
    has_open = m.open_side.a != 0.0 or m.open_side.b != 0.0 or m.open_side.c != 0.0
    return not dead and not has_open and inverter.live(V_dc) and span * m.star.decay <= STIFF


@kernel
def _any_segment(m, i, legs, edge, e, V_dc, left, over):
    """To the next edge, within a time `left`, whatever the legs do: currents, legs, times to their edges, integrals, and how
    long that took."""
    dead_time, N = m.comparator.dead_time, m.N
    circuit = connect(legs, m.open_side, m.star, i, e, V_dc)
    h = events.step_to_edge(legs, edge, dead_time, i, circuit, left)
    legs = inverter.aged(legs, h)
    i_new, i_mean = _segment(m, i, legs, circuit, e, h)
    legs, edge = carrier.passed(legs, edge, h, dead_time)
    q, rail = over.i, circuit.rail
    over = Integrals(
        Abc(q.a + h * i_mean.a, q.b + h * i_mean.b, q.c + h * i_mean.c),
        over.charge + 0.5 * h * (rail.a * i_mean.a + rail.b * i_mean.b + rail.c * i_mean.c),
        over.square
        + h * (N.a * mean_square(i.a, i_new.a) + N.b * mean_square(i.b, i_new.b) + N.c * mean_square(i.c, i_new.c)),
    )
    return i_new, legs, edge, over, h


@kernel
def _segments(m, pair, i, legs, edge, e, V_dc, span):
    """From edge to edge over a time `span` with a steady back-EMF: currents, legs, times to their edges, integrals, and how
    many segments there were that were not foreseen."""
    over, t, segments, dead_time = Integrals(Abc(0.0, 0.0, 0.0), 0.0, 0.0), 0.0, 0, m.comparator.dead_time
    while t < span:
        if _tied(m, legs, V_dc, span):
            h, i, over = known_edges.pass_over(pair, legs, edge, dead_time, i, e, m.N, V_dc, span - t, over)
            legs, edge = carrier.passed(inverter.aged(legs, h), edge, h, dead_time)
            if h >= span - t:
                break
            t += h
        i, legs, edge, over, h = _any_segment(m, i, legs, edge, e, V_dc, span - t, over)
        t = span if h >= span - t else t + h
        segments += 1
    return i, legs, edge, over, segments


@kernel
def _step(v, x, m, pair, motion, i, legs, edge, sums, V_dc, load, h):
    """A step h: the currents from edge to edge, then the rotor."""
    s, c = rotate(motion.s, motion.c, 0.5 * m.p * motion.w * h)
    sines, cosines = three_phases(s, c)
    k = windings.back_emf_coefficients(m.N, m.field, sines, cosines)
    w_ahead = actuator.w_ahead(v, x, motion, windings.torque(k, i), load, h)
    i, legs, edge, over, segments = _segments(m, pair, i, legs, edge, windings.back_emf(k, w_ahead), V_dc, h)
    per_h = 1.0 / h
    i_mean = Abc(over.i.a * per_h, over.i.b * per_h, over.i.c * per_h)
    _, theta, w, position, T_f, stop = actuator.move(v, x, motion, windings.torque(k, i_mean), load, h)
    q = monitor.quadrature_current(i_mean, s, c)
    sums = switched.Sums(
        monitor.low_pass(sums.i_filtered, q, monitor.smoothing(h, m.tau)),
        sums.charge + over.charge,
        sums.loss + m.R * over.square,
    )
    s, c = rotate(motion.s, motion.c, m.p * (theta - motion.theta))
    return actuator.Motion(theta, w, position, s, c, T_f, stop), i, legs, edge, sums, segments


@kernel
def _parts(T, longest):
    """A half carrier period T in as many equal parts as come nearest to the longest step."""
    return T / max(1.0, float(int(T / longest + 0.5)))


@kernel
def run(v, x, t):
    """Run to time `t` [s]. Returns a Status."""
    T_c = v[port.controller.period]
    m, loop = switched.machine(v, x), drive.read_loop(x)
    pair = known_edges.pair(m.star)
    longest = _parts(loop.T, x[clock.step])
    most = MOST_STEPS * max(1.0, T_c / 1e-4) + 2.0 * T_c / longest
    close = host.CLOSE * longest
    motion, i, legs, sums = switched.read(x)
    edge = Abc(x[own.edge_a], x[own.edge_b], x[own.edge_c])
    elapsed = x[clock.offset]
    steps = 0
    while True:
        begun = x[clock.tick] * T_c + elapsed
        left = t - begun
        if left <= close:
            break
        if x[clock.tick] == x[clock.next_sample]:
            motion = switched.sample(v, x, motion, i, x[clock.tick] * T_c)
            x[clock.next_sample] += 1.0
            steps = 0
        V_dc = max(0.0, host.input_at(v, x, inputs.supply_voltage, begun))
        to_peak = x[own.peak] * loop.T - begun
        if to_peak <= close:
            legs, edge = _peak(v, x, loop, m.sensors, motion, i, legs, V_dc)
            to_peak += loop.T
        h = min(T_c - elapsed, to_peak if to_peak < longest + close else longest)
        h = stability.for_turn(h, m.p * abs(motion.w))
        if h == 0.0 or steps > most:
            return Status.STIFF if h == 0.0 else Status.STUCK
        partial_step = h > left + close
        if partial_step:
            x[own.edge_a], x[own.edge_b], x[own.edge_c] = edge
            switched.set_aside(v, x, motion, i, legs, sums, elapsed)
            h = left
        load = host.input_at(v, x, inputs.load_torque, begun + 0.5 * h)
        motion, i, legs, edge, sums, segments = _step(v, x, m, pair, motion, i, legs, edge, sums, V_dc, load, h)
        steps += segments
        if partial_step:
            break
        elapsed += h
        if elapsed >= T_c - close:
            elapsed = 0.0
            switched.tick(x)
    x[own.edge_a], x[own.edge_b], x[own.edge_c] = edge
    switched.leave(x, motion, i, legs, sums, elapsed)
    return Status.OK
