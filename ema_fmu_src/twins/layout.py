"""Where things lie in the twins' flat arrays, and what their status codes mean."""

STALE = 0
"""`x[STALE]` is 1 after the host has changed a tunable parameter, 0 once the twin has taken it in."""

SLOPE = 1
"""`x[SLOPE + i]` is the slope of input i (command, load_torque, supply_voltage) over the step, per second."""

HEADER = 4
"""The first place of `x` that belongs to the twin alone."""

OK = 0
ECCENTRIC = 1
STUCK = 2
NOT_FINITE = 3

STATUS = (
    "",
    "motor.p * fault.zeta must be less than 1: the rotor would touch the stator",
    "the event-located solver reached its bound of steps in one controller period; "
    "try solver.event_located=false with solver.step=1e-6",
    "the solution is no longer finite; check parameters and inputs, or try a smaller solver.step",
)
"""Message for each status a kernel can return, by its number; 0 is success."""
