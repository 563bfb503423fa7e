"""The FMUs in flight: each in a process of its own, so that no request takes the server with it, or holds it for long."""

import threading
from concurrent.futures import ThreadPoolExecutor
from http import HTTPStatus
from pathlib import Path

import xarray as xr

from ema_fmu_src.fidelities import Fidelity
from harness.actuators.fmus import belongs_to_another, record_of
from harness.errors import HarnessError
from harness.flight.isolate import TIME_LIMIT, Isolated
from harness.parameters import merged
from harness.show.live.refused import Refused
from harness.show.live.wish import Flight
from harness.show.outside import run_of

LONGEST_WAIT = 2.0 * TIME_LIMIT
"""For the flights of other clients [s]."""


class Fleet:
    """The FMUs of a folder, flown for one request at a time, those of different files side by side."""

    def __init__(self, fmus: Path, *, time_limit: float = TIME_LIMIT) -> None:
        self.fmus = fmus
        self.time_limit = time_limit
        self._open: dict[str, Isolated] = {}
        self._lock = threading.Lock()
        self._ending = threading.Event()

    def fly(self, flight: Flight) -> dict[str, xr.Dataset]:
        """A run with each fidelity, by name, in the actuator's units outside.

        Refused (422) if an FMU refuses, crashes, takes longer than the time limit, or was built for another actuator;
        Refused (503) if other clients fly for too long.
        """
        if not self._lock.acquire(timeout=LONGEST_WAIT):
            raise Refused("others fly; ask again in a moment", HTTPStatus.SERVICE_UNAVAILABLE)
        try:
            files: dict[str, list[Fidelity]] = {}
            for fidelity in flight.fidelities:
                files.setdefault(fidelity.fmu, []).append(fidelity)
            with ThreadPoolExecutor(len(files)) as threads:
                parts = list(threads.map(lambda name: self._fly(flight, name, files[name]), files))
        except Refused:
            raise
        except HarnessError as error:
            raise Refused(str(error), HTTPStatus.UNPROCESSABLE_ENTITY) from None
        finally:
            self._lock.release()
        runs = {name: run for part in parts for name, run in part.items()}
        return {each.name: runs[each.name] for each in flight.fidelities}

    def _fly(self, flight: Flight, name: str, fidelities: list[Fidelity]) -> dict[str, xr.Dataset]:
        if name not in self._open:
            self._open[name] = Isolated(self.fmus / name, time_limit=self.time_limit)
        record = record_of(self.fmus / name)
        if belongs_to_another(record, flight.actuator):
            raise HarnessError(f"{name}: was built for another actuator, {record['actuator']}; choose that one")
        runs = {}
        for fidelity in fidelities:
            run = self._open[name].run(
                flight.trial, merged(fidelity, flight.parameters), on_progress=lambda _: self._ending.is_set()
            )
            if run.attrs["stopped"]:
                raise Refused("the server ends", HTTPStatus.SERVICE_UNAVAILABLE)
            run.attrs["fidelity"] = fidelity.name
            runs[fidelity.name] = run_of(run, flight.actuator)
        return runs

    def close(self) -> None:
        """End the processes, and what flies in them."""
        self._ending.set()
        with self._lock:
            for twin in self._open.values():
                twin.close()
            self._open.clear()
