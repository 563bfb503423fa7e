"""How far HF steps: to the next event that changes the voltage of a leg, or always as far."""

from . import inverter
from .jit import kernel
from .modulator import carrier, hysteresis
from .phases import Abc

SHORTEST = 1e-9
"""Shortest step that is aimed at an event [s]: 0.1 mA of the current's slope."""


@kernel
def _event(h, comparator, leg_j, error_j, gate_j, rail_j, i_j, slope_j, shown_j, decay_j):
    """The earlier of `h` and the next change of a leg's voltage."""
    h = hysteresis.time_to_band(h, comparator, leg_j, error_j, gate_j, i_j, slope_j, shown_j, decay_j)
    return inverter.time_to_commutation(h, leg_j, gate_j, rail_j, i_j, slope_j)


@kernel
def step_to_event(comparator, star, ref, w_e, i, legs, error, circuit, s, c, longest):
    """The legs with the speeds of their errors, and the event-located step: to the next event, at most `longest`."""
    slope, gate, rail, gain = circuit.slope, circuit.gate, circuit.rail, comparator.gain
    shown = Abc(gain.a * slope.a, gain.b * slope.b, gain.c * slope.c)
    legs = Abc(
        hysteresis.approach(legs.a, ref, shown.a, w_e, s.a, c.a),
        hysteresis.approach(legs.b, ref, shown.b, w_e, s.b, c.b),
        hysteresis.approach(legs.c, ref, shown.c, w_e, s.c, c.c),
    )
    h = _event(longest, comparator, legs.a, error.a, gate.a, rail.a, i.a, slope.a, shown.a, star.R.a * star.g.a)
    h = _event(h, comparator, legs.b, error.b, gate.b, rail.b, i.b, slope.b, shown.b, star.R.b * star.g.b)
    h = _event(h, comparator, legs.c, error.c, gate.c, rail.c, i.c, slope.c, shown.c, star.R.c * star.g.c)
    return legs, min(longest, max(h, SHORTEST))


@kernel
def _edge(h, leg_j, edge_j, dead_time, gate_j, rail_j, i_j, slope_j):
    """The earlier of `h` and the next change of a leg's voltage. A current that comes to zero is aimed beyond it, for what
    bends it on its way would leave a rest of it, which takes a step of its own: one in five of them."""
    if edge_j < h:
        h = carrier.time_to_change(h, leg_j, edge_j, dead_time, gate_j, i_j, slope_j)
    change = inverter.time_to_commutation(h, leg_j, gate_j, rail_j, i_j, slope_j)
    return change + SHORTEST if change < h and change != leg_j.dead_left else change


@kernel
def step_to_edge(legs, edge, dead_time, i, circuit, longest):
    """The step of legs whose edges are known: to the next change of a leg's voltage, at most `longest`."""
    slope, gate, rail = circuit.slope, circuit.gate, circuit.rail
    h = _edge(longest, legs.a, edge.a, dead_time, gate.a, rail.a, i.a, slope.a)
    h = _edge(h, legs.b, edge.b, dead_time, gate.b, rail.b, i.b, slope.b)
    h = _edge(h, legs.c, edge.c, dead_time, gate.c, rail.c, i.c, slope.c)
    return min(longest, max(h, SHORTEST))


@kernel
def fixed_step(longest, to_tick):
    """The fixed rule: `longest`, the last one before the controller's tick taking up what rounding has left."""
    return to_tick if to_tick < 1.5 * longest else longest
