"""Compiles the harness's own loops with numba, on any disk and whatever the environment says."""

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numba
from numba.core.caching import FunctionCache


class _Cache(FunctionCache):
    """Machine code kept between processes, where that can be done; a full disk or a torn file only costs time."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # noqa: BLE001 - a file that was torn, or is another's: unpickling raises whatever it meets
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        with suppress(OSError):
            super().save_overload(sig, data)


def compiled(**options: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """As `numba.njit(cache=True, **options)`, which asks for more than every machine has.

    Where no folder can be written for a cache, the function is compiled in every process. NUMBA_DISABLE_JIT does not reach
    it: the loops call FMUs through their addresses, which plain Python cannot.
    """

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        config: Any = numba.config
        disabled, config.DISABLE_JIT = config.DISABLE_JIT, 0
        try:
            dispatcher: Any = numba.njit(**options)(function)
        finally:
            config.DISABLE_JIT = disabled
        with suppress(RuntimeError):  # numba's word for: no folder that can be written
            dispatcher._cache = _Cache(dispatcher.py_func)
        return dispatcher  # type: ignore[no-any-return]

    return decorate
