"""gym-electric-motor: a PMSM on a two-level inverter, stepped with a switching state each time."""

import time

COMPUTES = "a salient PMSM in dq on an inverter whose switching state the agent gives, every 1e-5 s"
LACKS = "hysteresis or speed control, dry friction, backlash, faults"
TAU, STEPS = 1e-5, 2000


def run() -> float:
    """Random switching states; returns the wall time per simulated second."""
    import gym_electric_motor

    motor = {"p": 2, "r_s": 1.0, "l_d": 0.7e-3, "l_q": 0.7e-3, "psi_p": 0.025, "j_rotor": 6e-5}
    environment = gym_electric_motor.make(
        "Finite-CC-PMSM-v0", tau=TAU, motor={"motor_parameter": motor}, supply={"u_nominal": 48.0}
    )
    environment.reset(seed=0)
    began = time.perf_counter()
    for step in range(STEPS):
        terminated = environment.step(step % 8)[2]
        if terminated:
            environment.reset()
    return (time.perf_counter() - began) / (TAU * STEPS)
