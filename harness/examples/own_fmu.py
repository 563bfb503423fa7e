"""An FMU of your own in a system: the position of the EMA goes to it, and the torque that it answers loads the EMA.

python own_fmu.py LOAD.fmu [--position NAME] [--torque NAME] [--fmus DIR]
"""

import argparse
from pathlib import Path

import numpy as np

from harness.flight.couple import Connection, System, fly

STEP, STOP = 1e-4, 0.5  # s


def main() -> None:
    options = argparse.ArgumentParser()
    options.add_argument("load", type=Path, help="an FMI 2.0 co-simulation FMU")
    options.add_argument("--position", default="position", help="its input [rad]")
    options.add_argument("--torque", default="torque", help="its output [N.m]")
    options.add_argument("--fmus", type=Path, default=Path("fmus"), help="folder of the EMA's FMUs; ema build fills fmus")
    given = options.parse_args()

    system = System(
        components={"ema": given.fmus / "EMA_ELF.fmu", "load": given.load},
        connections=[
            Connection("ema.position", f"load.{given.position}"),
            Connection(f"load.{given.torque}", "ema.load_torque"),
        ],
    )
    command = {"ema.command": np.full(round(STOP / STEP), 0.1)}
    run = fly(system, stop=STOP, step=STEP, inputs=command, record=["ema.position"], order="gauss-seidel")
    print(f"position after {STOP:g} s: {float(run['ema.position'][-1]):.6f} rad")


if __name__ == "__main__":
    main()
