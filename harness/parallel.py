"""Worker processes, with one thread of linear algebra each, so that they do not compete for the cores."""

import os
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


@contextmanager
def environment(values: Mapping[str, str]) -> Iterator[None]:
    """Inside, the environment has these `values` too, for processes that begin there."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextmanager
def processes(count: int) -> Iterator[ProcessPoolExecutor]:
    """A pool of `count` new processes, 0 for one a core.

    If an error leaves the block, the work that has not begun is cancelled.
    """
    with environment(dict.fromkeys(THREADS, "1")):
        pool = ProcessPoolExecutor(count or os.cpu_count() or 1, mp_context=get_context("spawn"))
        try:
            yield pool
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
        pool.shutdown()
