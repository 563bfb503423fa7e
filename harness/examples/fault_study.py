"""A fault study: how does a short in one phase show in the current? Prints a table and writes the runs as NetCDF.

python fault_study.py [--fmus DIR] [--out FILE.nc]
"""

import argparse

import xarray as xr

import harness as ema

TURNS_LEFT = [1.0, 0.9, 0.8, 0.7]  # share of phase a's turns that is not shorted


def main() -> None:
    options = argparse.ArgumentParser()
    options.add_argument("--fmus", help="folder of the FMUs; the package's own if not given")
    options.add_argument("--out", default="fault_study.nc")
    given = options.parse_args()

    runs = [ema.fly("SIN", "ELF+", set={"fault.N_a": share}, fmus=given.fmus) for share in TURNS_LEFT]
    study = xr.concat(runs, dim="N_a", combine_attrs="drop_conflicts").assign_coords(N_a=TURNS_LEFT)
    study.to_netcdf(given.out)
    for share in TURNS_LEFT:
        run = study.sel(N_a=share)
        current, loss = run.equivalent_current_filtered, run.copper_loss
        print(f"N_a = {share:.1f}: current up to {float(abs(current).max()):.3f} A, loss {float(loss.mean()):.4f} W")


if __name__ == "__main__":
    main()
