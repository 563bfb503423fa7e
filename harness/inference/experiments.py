"""The runs that would tell what others leave open."""

from collections.abc import Sequence

from harness.faults import FAULTS, LOADED

FAST = "a command so fast that the voltage saturates"
WOULD_TELL = {
    "motor.K_e": f"{LOADED}, or {FAST}",
    "motor.R": FAST,
    "motor.L": FAST,
    "motor.p": FAST,
    "mechanics.J": "a faster command, with more acceleration",
    "mechanics.C": "a run at high and at low speed",
    "mechanics.T_coulomb": "a slow run that reverses",
    "mechanics.T_static": "a run that stops and starts again, slowly",
    "mechanics.T_asymmetry": "a slow run in both directions",
    "mechanics.T_quadratic": "a run at high speed",
    "gear.backlash": "a run that reverses, with the position measured on the user's side",
    "gear.eta_opposing": f"{LOADED} against the motion",
    "gear.eta_aiding": f"{LOADED} along the motion",
    "controller.current_limit": "a command that asks for more than the current limit",
    "controller.current.bandwidth": "a log of the current at 1000 rows a second or more",
    "inverter.utilisation": FAST,
}
"""Port -> a run that tells it."""
OTHER = "a run in which it matters more"
HEALTHY = "a calibration on healthy runs"


def would_tell(name: str) -> str:
    """A run that tells the parameter of this port."""
    return WOULD_TELL.get(name, OTHER)


def apart(members: Sequence[str]) -> str:
    """The run that tells these faults and parameters from each other: that of the faults among them, or of the first
    parameter; of a fault that is a scale of a parameter, one in which it was healthy."""
    faults = [FAULTS[name] for name in members if name in FAULTS]
    if any(port in fault.scales for fault in faults for port in members):
        return HEALTHY
    wanted = [fault.told_by for fault in faults if fault.told_by]
    return " or ".join(dict.fromkeys(wanted)) if wanted else would_tell(members[0])
