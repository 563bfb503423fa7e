"""What a twin says of a step or a start."""

from enum import IntEnum


class Status(IntEnum):
    """Status of a kernel, and what it means for the user; only OK lets the twin go on."""

    message: str

    def __new__(cls, value: int, message: str) -> "Status":
        status = int.__new__(cls, value)
        status._value_ = value
        status.message = message
        return status

    OK = 0, ""
    ECCENTRIC = 1, "motor.p * fault.zeta must be less than 1: the rotor would touch the stator"
    STUCK = (
        2,
        "the event-located solver reached its bound of steps in one controller period; "
        "try a larger inverter.hysteresis or motor.L, or solver.event_located=false with a small solver.step",
    )
    NOT_FINITE = 3, "the solution is no longer finite; check parameters and inputs, or try a smaller solver.step"
    STIFF = (
        4,
        "rotor and currents move faster than steps of 1e-9 s can follow; a larger mechanics.J or motor.L, a smaller "
        "motor.K_e, smaller controller gains or a slower start are needed",
    )
    COARSE = (
        5,
        "a fixed solver.step is too long for the current's hysteresis: inverter.hysteresis*L/supply_voltage is the longest, "
        "L that of the phase with the fewest turns; or solver.event_located=true",
    )
    PAIR = (
        6,
        "controller.current_control=ideal goes with inverter.modulation=hysteresis, and field_oriented with a carrier, "
        "sine_triangle or space_vector",
    )
    LOOP = (
        7,
        "the current loop does not settle: it grows or rings from sample to sample; "
        "smaller controller.current.K_p and K_i or a larger inverter.carrier_frequency are needed",
    )
    PULSE = (
        8,
        "inverter.dead_time must be shorter than half a period of inverter.carrier_frequency, or no switch ever closes, and "
        "inverter.minimum_pulse shorter than a quarter of it",
    )
