"""HF's inverter: three legs under hysteresis control, with dead time, diodes and a switch that may stay open."""

from .jit import kernel


@kernel
def open_side(open_switch, leg):
    """+1 (upper) or -1 (lower) if `fault.open_switch` (1, 2: leg 0; 3, 4: leg 1; 5, 6: leg 2) is in `leg`, else 0."""
    code = int(open_switch) - 2 * leg
    if code == 1:
        return 1.0
    if code == 2:
        return -1.0
    return 0.0


@kernel
def hysteresis(u_j, rest_j, error_j, band, margin, dead_time):
    """The commanded switch u_j (+1 upper, -1 lower) and the rest of its dead time [s] after a look at the comparator.

    error_j = i_ref_j - i_j [A]: at +band the upper switch is commanded, at -band the lower, between them nothing
    changes. `margin` [A] is how close to the band counts as there.
    """
    if u_j * error_j <= margin - band:
        return -u_j, dead_time
    return u_j, rest_j


@kernel
def gate(u_j, rest_j, open_side_j):
    """Which switch of a leg conducts: +1, -1, or 0 while both are off (dead time, or the commanded switch is open)."""
    if rest_j > 0.0 or u_j == open_side_j:
        return 0.0
    return u_j


@kernel
def rail(gate_j, i_j):
    """The rail that a leg is tied to: that of the switch, else that of the diode which the current's sign selects.

    A current out of the leg (i_j > 0) flows through the lower diode, one into it through the upper; 0: no current, open.
    """
    if gate_j != 0.0:
        return gate_j
    if i_j > 0.0:
        return -1.0
    if i_j < 0.0:
        return 1.0
    return 0.0


@kernel
def forward_biased(v_open, V_dc):
    """The rail whose diode starts to conduct when an open leg's terminal is at `v_open` [V] about the mid-point, or 0."""
    if v_open > 0.5 * V_dc:
        return 1.0
    if v_open < -0.5 * V_dc:
        return -1.0
    return 0.0


@kernel
def time_to_band(u_j, error_j, slope_j, band, h):
    """The earlier of `h` and the predicted time [s] until the comparator of a leg turns, from the error's slope [A/s]."""
    closing = -u_j * slope_j
    distance = u_j * error_j + band
    if closing * h > distance:
        return distance / closing
    return h


@kernel
def time_to_zero(gate_j, i_j, slope_j, h):
    """The earlier of `h` and the time [s] at which the current of a leg that is off reaches zero."""
    if gate_j == 0.0 and i_j * slope_j < 0.0 and abs(slope_j) * h > abs(i_j):
        return abs(i_j / slope_j)
    return h
