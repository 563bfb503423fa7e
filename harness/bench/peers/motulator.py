"""motulator (0.18 or later): a PMSM on a switching inverter with carrier comparison, speed and current-vector control."""

import time
from math import pi

COMPUTES = "a PMSM on a switching inverter (carrier comparison), continuous model solved between switchings"
LACKS = "hysteresis control, dry friction, backlash, phase faults"
SIMULATED = 0.05  # s


def run(carrier: float) -> float:
    """Up to 100 rad/s, `carrier` [Hz] sampled twice a period; returns the wall time per simulated second."""
    from motulator.drive import model
    from motulator.drive.control import sm

    parameters = model.SynchronousMachinePars(n_p=2, R_s=1.0, L_d=0.7e-3, L_q=0.7e-3, psi_f=0.025)
    drive = model.Drive(
        model.SynchronousMachine(parameters),
        model.MechanicalSystem(J=6e-5, B_L=5e-5),
        model.VoltageSourceConverter(u_dc=48.0),
        pwm=True,
    )
    configuration = sm.CurrentVectorControllerCfg(i_s_max=10.0, sensorless=False, T_s=0.5 / carrier)
    vector = sm.CurrentVectorController(parameters, configuration)
    system = sm.VectorControlSystem(vector, sm.SpeedController(J=6e-5, alpha_s=2.0 * pi * 10.0))
    system.set_speed_ref(lambda t: 100.0)
    simulation = model.Simulation(drive, system, show_progress=False)
    began = time.perf_counter()
    simulation.simulate(t_stop=SIMULATED)
    return (time.perf_counter() - began) / SIMULATED
