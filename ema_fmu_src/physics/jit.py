"""Compiles the kernels with numba where it is installed; without it they stay plain Python."""

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

numba: Any
try:
    import numba
except ImportError:  # an FMU with the python runtime in a host without numba: slower, same results
    numba = None


def _cache_dir() -> str:
    """Folder of the compiled kernels: one for each content of the sources, because numba's own cache would not notice
    that a function called from another file has changed."""
    package = Path(__file__).resolve().parent.parent
    digest = hashlib.sha256()
    for source in sorted([*package.glob("physics/**/*.py"), *package.glob("twins/**/*.py"), package / "ports.py"]):
        digest.update(source.relative_to(package).as_posix().encode() + source.read_bytes())
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    return str(base / "ema-twins" / "kernels" / digest.hexdigest()[:16])


_CACHE_DIR = _cache_dir() if numba else ""

OPTIONS = {"error_model": "numpy", "forceinline": True, "no_cfunc_wrapper": True}
"""numba's, for kernels that are yet to be made. Called instead of inlined, the parts of HF's step would take half as
long again; none is called back from C, and a way to do so would take time to compile."""


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile `function` on its first call and keep the machine code for later processes.

    A function made within another one is kept as part of the kernels that call it, not by itself: numba would take it for
    a new one in every process.
    """
    if numba is None:
        return function
    previous = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = _CACHE_DIR
    try:
        compiled: Callable[..., Any] = numba.njit(cache=function.__closure__ is None, **OPTIONS)(function)
    except RuntimeError:  # no folder that can be written: compile in every process
        compiled = numba.njit(**OPTIONS)(function)
    finally:
        numba.config.CACHE_DIR = previous
    return compiled
