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
def hysteresis(u_j, rest_j, error_j, band, margin, dead_time, closing_j):
    """The commanded switch u_j (+1 upper, -1 lower) and the rest of its dead time [s] after a look at the comparator.

    error_j = i_ref_j - i_j [A]: at +band the upper switch is commanded, at -band the lower, between them nothing
    changes. `margin` [A] is how close to the band counts as there. An error that is beyond the band has got there by
    `closing_j` [A/s] (0: not known), so that part of the dead time is over.
    """
    beyond = -u_j * error_j - band
    if beyond < -margin:
        return u_j, rest_j
    if beyond > 0.0 and closing_j > 0.0:
        dead_time -= beyond / closing_j
    return -u_j, max(0.0, dead_time)


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
def time_to_event(
    h, u_j, error_j, closing_j, band, dead_time, rest_j, gate_j, rail_j, i_j, slope_j, decay_j
):  # fmt: skip
    """The earlier of `h` and the next time [s] at which a leg's voltage changes, as the slopes predict it.

    closing_j: how fast the error nears the band [A/s]; i_j, slope_j: the current and its slope; decay_j = R_j/L_j [1/s],
    which bends it. A comparator that turns while the current flows through the diode of the leg's present rail changes
    nothing before the dead time is over; the end of a dead time changes nothing where the diode has led to the new rail
    already. So a commutation takes one step instead of two, which halves HF's time. A current that may die out in the
    dead time is looked at step by step.
    """
    if closing_j > 0.0:
        kept = gate_j != 0.0 and u_j * i_j < -2.0 * dead_time * abs(slope_j)
        wait = dead_time if kept else 0.0
        distance = u_j * error_j + band
        if closing_j * (h - wait) > distance:
            t = distance / closing_j
            h = t + 0.5 * decay_j * u_j * t * t * slope_j / closing_j + wait
    if gate_j == 0.0:
        if 0.0 < rest_j < h and rail_j != u_j:
            h = rest_j
        if i_j * slope_j < 0.0 and abs(slope_j) * h > abs(i_j):
            zero = abs(i_j / slope_j)
            if zero < rest_j or rest_j <= 0.0:
                h = zero
    return h
