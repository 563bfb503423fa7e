"""Hysteresis current control: a comparator in each leg, and when it will next turn."""

from typing import NamedTuple

from ..inverter import Leg
from ..jit import kernel
from ..phases import Abc


class Comparator(NamedTuple):
    """The comparators' settings; `margin` is how close to the band counts as there, `gain` that of the current sensors."""

    band: float
    margin: float
    dead_time: float
    gain: Abc


@kernel
def compare(comparator, leg_j, error_j):
    """The leg after a look at its comparator.

    At +band the upper switch is commanded, at -band the lower, between them nothing changes. An error that is beyond the
    band has got there by `closing` (0: not known), so that part of the dead time is over.
    """
    beyond = -leg_j.side * error_j - comparator.band
    if beyond < -comparator.margin:
        return leg_j
    dead_left = comparator.dead_time
    if beyond > 0.0 and leg_j.closing > 0.0:
        dead_left -= beyond / leg_j.closing
    return Leg(-leg_j.side, max(0.0, dead_left), leg_j.closing)


@kernel
def look(comparator, legs, error):
    """The three legs after a look at their comparators."""
    return Abc(
        compare(comparator, legs.a, error.a),
        compare(comparator, legs.b, error.b),
        compare(comparator, legs.c, error.c),
    )


@kernel
def approach(leg_j, ref, slope_j, w_e, s_j, c_j):
    """The leg with the speed at which its error nears the band: side_j*(di_j/dt - di_ref_j/dt), the slope as measured."""
    return Leg(leg_j.side, leg_j.dead_left, leg_j.side * (slope_j + w_e * (ref.cos * c_j - ref.sin * s_j)))


@kernel
def time_to_band(h, comparator, leg_j, error_j, gate_j, i_j, slope_j, shown_j, decay_j):
    """The earlier of `h` and the time at which the comparator's turn changes the leg's voltage, as the slopes predict it.

    decay_j = R_j/L_j bends the current, shown_j is its slope as measured. A comparator that turns while the current flows
    through the diode of the leg's
    present rail changes nothing before the dead time is over: a commutation then takes one step instead of two, which
    halves HF's time. A current that may die out in the dead time is looked at step by step.
    """
    if leg_j.closing > 0.0:
        kept = gate_j != 0.0 and leg_j.side * i_j < -2.0 * comparator.dead_time * abs(slope_j)
        wait = comparator.dead_time if kept else 0.0
        distance = leg_j.side * error_j + comparator.band
        if leg_j.closing * (h - wait) > distance:
            t = distance / leg_j.closing
            h = t + 0.5 * decay_j * leg_j.side * t * t * shown_j / leg_j.closing + wait
    return h
