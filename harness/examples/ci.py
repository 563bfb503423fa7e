"""A gate for CI: has an FMU drifted from results that were stored? Exit code 1 if a variable is further off than allowed.

python ci.py CANDIDATE.fmu REFERENCE.nc [--trial NAME] [--allowed PART]

Where REFERENCE.nc is not there yet, the candidate's own run is stored in it. (`ema check` does more: budgets for each
variable, JUnit XML, a page.)
"""

import argparse
import sys
from pathlib import Path

import xarray as xr

import harness as ema

WATCHED = ("position", "motor_speed", "equivalent_current_filtered")


def main() -> int:
    options = argparse.ArgumentParser()
    options.add_argument("candidate", type=Path)
    options.add_argument("reference", type=Path)
    options.add_argument("--trial", default="SIN")
    options.add_argument("--allowed", type=float, default=1e-3, help="NRMSE, a fraction of the reference's range")
    given = options.parse_args()

    try:
        run = ema.fly(given.trial, given.candidate)
        if not given.reference.exists():
            run.to_netcdf(given.reference)
            print(f"stored {given.reference}")
            return 0
        with xr.open_dataset(given.reference) as stored:
            compared = ema.compare(run, stored.load())
    except ema.HarnessError as error:
        print(error, file=sys.stderr)
        return 2
    outside = [item for item in (compared[name] for name in WATCHED) if item.nrmse is None or item.nrmse > given.allowed]
    for item in outside:
        far = "constant in the reference" if item.nrmse is None else f"{100 * item.nrmse:.4f} %"
        print(f"{item.variable}: {far}, allowed {100 * given.allowed:g} %, furthest at {item.t_max_abs:.4f} s")
    return 1 if outside else 0


if __name__ == "__main__":
    sys.exit(main())
