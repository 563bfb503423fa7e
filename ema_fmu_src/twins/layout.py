"""Where things lie in the twins' flat arrays `v` and `x`, and what their status codes mean."""

from ..ports import INDEX

# --- x: what the host writes ---------------------------------------------------------------------------------------
STALE = 0
"""`x[STALE]` is 1 after the host has changed a tunable parameter, 0 once the twin has taken it in."""
SLOPE = 1
"""`x[SLOPE + i]` is the slope of input i (command, load_torque, supply_voltage) over the step, per second."""

# --- x: clock -------------------------------------------------------------------------------------------------------
TICK = 4  # whole periods of the twin's own grid (HF: of the controller) since the start
OFFSET = 5  # time since that tick [s]
DUE = 6  # 1: the controller is to be sampled before the twin moves on
PENDING = 7  # 1: the communication point lies within a step; the frame AT_POINT holds the twin there
HELD_LOAD = 8  # inputs at the last communication point, to notice a change
HELD_SUPPLY = 9
RAMPED = 10  # 1: an input had a slope in the last step
POINT = 11  # time of the last communication point [s]
POINT_CHARGE = 12  # charge and loss at the last communication point
POINT_LOSS = 13
LIMITED = 14  # 1: voltage-limited at some time since the last communication point
TOLERANCE = 15  # written by the host after initialize: relative tolerance of the experiment; 0: none given

# --- x: what follows from the parameters, taken at the start and after each change (saves ELF and LF 5 % of their time)
PER_RATIO, STATIC, COULOMB = 16, 17, 18  # 1/G; limits of dry friction [N.m]
LOSS_OPPOSING, LOSS_AIDING = 19, 20  # 1/eta - 1, 1 - eta
HALF_PLAY, THETA_MAX = 21, 22  # half of the play [rad]; the rotor's stop [rad]
Z_COS, Z_SIN = 23, 24  # p*zeta*(cos, sin)(phi)
K_HOT, R_HOT = 25, 26  # K_e and R with their faults
GRID, PER_PERIOD = 27, 28  # the twin's own step [s], and how many make a controller period
SMOOTHING = 29  # of the filtered current over a whole step: h/(tau + h/2)

# --- x: two frames of the same shape --------------------------------------------------------------------------------
THETA, W, POSITION, SIN, COS = 0, 1, 2, 3, 4  # rotor angle and speed, user shaft; sine and cosine of theta_e
I_A, I_B, I_C, I_REF, XI, I_FILTERED = 5, 6, 7, 8, 9, 10
CHARGE, LOSS, FRICTION, SATURATED = 11, 12, 13, 14  # supply charge [C], copper loss [J], dry friction, last limit flag
REF_COS, REF_SIN = 15, 16  # HF: I_ref times cosine and sine of the resolver's electrical error
U_A, U_B, U_C = 17, 18, 19  # HF: commanded switch of each leg, +1 upper, -1 lower
REST_A, REST_B, REST_C = 20, 21, 22  # HF: rest of each leg's dead time [s]
CLOSING_A, CLOSING_B, CLOSING_C = 23, 24, 25  # HF: speed of each leg's error towards the band in the last step [A/s]
FRAME_SIZE = 26

OWN = 30
"""Frame at the end of the last whole step of the twin's own."""
AT_POINT = OWN + FRAME_SIZE
"""Frame at the communication point, when that lies within a step."""
N_STATES = AT_POINT + FRAME_SIZE

CLOSE = 1e-6
"""Two times closer than this fraction of a tick are one: hosts that add up their steps are off by 1e-12 s."""

# --- status ---------------------------------------------------------------------------------------------------------
OK, ECCENTRIC, STUCK, NOT_FINITE = 0, 1, 2, 3
STATUS = (
    "",
    "motor.p * fault.zeta must be less than 1: the rotor would touch the stator",
    "the event-located solver reached its bound of steps in one controller period; "
    "try solver.event_located=false with solver.step=1e-6",
    "the solution is no longer finite; check parameters and inputs, or try a smaller solver.step",
)
"""Message for each status a kernel can return, by its number; 0 is success."""

# --- v: value references, as constants that numba can see -----------------------------------------------------------
COMMAND, LOAD_TORQUE, SUPPLY_VOLTAGE = INDEX["command"], INDEX["load_torque"], INDEX["supply_voltage"]
OUT = INDEX["position"]  # the outputs follow in the order of ports.OUTPUTS, then controller.integral
R, L, K_E, PAIRS = INDEX["motor.R"], INDEX["motor.L"], INDEX["motor.K_e"], INDEX["motor.p"]
J, C = INDEX["mechanics.J"], INDEX["mechanics.C"]
T_STATIC, T_COULOMB, END_STOP = (INDEX[f"mechanics.{name}"] for name in ("T_static", "T_coulomb", "end_stop"))
RATIO, ETA_OPPOSING, ETA_AIDING, BACKLASH = (
    INDEX[f"gear.{name}"] for name in ("ratio", "eta_opposing", "eta_aiding", "backlash")
)
K_POS, SPEED_LIMIT, K_P, K_I, CURRENT_LIMIT, PERIOD = (
    INDEX[f"controller.{name}"] for name in ("K_pos", "speed_limit", "K_p", "K_i", "current_limit", "period")
)
HYSTERESIS, R_ON, DEAD_TIME = (INDEX[f"inverter.{name}"] for name in ("hysteresis", "R_on", "dead_time"))
RESOLVER_BITS, TAU = INDEX["sensor.resolver_bits"], INDEX["monitor.tau"]
COUPLED = INDEX["driver.coupled_saturation"]
STEP, EVENT_LOCATED = INDEX["solver.step"], INDEX["solver.event_located"]
INITIAL = INDEX["initial.motor_position"]  # and on, in the order of ports.py
(
    FAULT_FRICTION,
    FAULT_BACKLASH,
    FAULT_N_A,
    FAULT_N_B,
    FAULT_N_C,
    FAULT_ZETA,
    FAULT_PHI,
    FAULT_GAIN,
    FAULT_JAM,
    FAULT_MAGNET,
    FAULT_RESISTANCE,
    FAULT_OPEN_SWITCH,
    FAULT_OFFSET_A,
    FAULT_OFFSET_B,
    FAULT_OFFSET_C,
    FAULT_RESOLVER,
) = (
    INDEX[f"fault.{name}"]
    for name in (
        "friction",
        "backlash",
        "N_a",
        "N_b",
        "N_c",
        "zeta",
        "phi",
        "gain",
        "jam",
        "magnet",
        "resistance",
        "open_switch",
        "current_offset_a",
        "current_offset_b",
        "current_offset_c",
        "resolver_offset",
    )
)
