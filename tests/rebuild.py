"""Builds an FMU from a copy of the sources in which one text differs."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from ema_fmu_src.fmu import source

SCRIPT = """
import sys
from pathlib import Path
from ema_fmu_src.fmu.build import build
build([sys.argv[1]], out=Path(sys.argv[2]), runtime=sys.argv[3])
"""


def rebuilt(model: str, out: Path, scratch: Path, *, old: str, new: str, runtime: str) -> Path:
    """EMA_<model>.fmu in the folder `out`, from sources whose ports.py has `new` in the one place of `old`."""
    copy = scratch / "ema_fmu_src"
    shutil.copytree(source.PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    text = (copy / "ports.py").read_text()
    assert text.count(old) == 1
    (copy / "ports.py").write_text(text.replace(old, new))
    command = [sys.executable, "-c", SCRIPT, model, str(out), runtime]
    subprocess.run(command, check=True, cwd=scratch, env=os.environ | {"PYTHONPATH": str(scratch)})
    return out / f"EMA_{model}.fmu"
