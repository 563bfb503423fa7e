"""What symbols, names and headings mean, in words: faults and ports as they are declared, and the terms of the tables."""

import html
from collections.abc import Iterable

from ema_fmu_src import ports
from harness.faults import ESTIMATED

TERMS = {
    "NRMSE": "rms of the difference, over the range of the reference",
    "Largest error": "largest absolute difference, at the time beside it",
    "95 % interval": "holds the true value in 95 of 100 runs, if what is found here is all there is",
    "Health": "1 healthy, 0 at the limit",
    "Event state (health)": "1 healthy, 0 at the limit",
    "Limit": "value at which health is 0 and the event is reached",
    "Sigma": "standard deviation",
    "Sigma before": "standard deviation before the logs were seen",
    "+-95 %": "half width of the interval that holds the value in 95 of 100 cases",
    "of before": "standard deviation over that before the logs were seen",
    "Told by the data": "standard deviation of what is left open, in % of each",
    "Wall s / s": "wall seconds per simulated second, on one core",
    "ms / s": "wall milliseconds per simulated second, on one core",
    "order": "order of the autoregressive model of the noise",
    "unexplained": "rms of what neither model nor bench explains, in % of the range",
}
"""Headings and other terms -> what they mean."""
NUISANCES = {
    "offset": "offset of the sensor",
    "gain": "error of the sensor's gain",
    "shift": "time by which the log is late",
    "lag": "time constant of a low-pass in the log",
}
"""What sensors and loggers do -> what it means; as KIND.CHANNEL."""


def meaning(name: str) -> str:
    """What a fault's short name, a port, a nuisance or a term means, in words; empty if it is none of these."""
    port = ESTIMATED[name].port if name in ESTIMATED else name
    if port in ports.INDEX:
        variable = ports.VARIABLES[ports.INDEX[port]]
        unit = "" if variable.unit == "1" or variable.kind == "Boolean" else f" [{variable.unit}]"
        return f"{variable.description}{unit}"
    kind, _, channel = name.partition(".")
    if kind in NUISANCES and channel:
        return f"{NUISANCES[kind]}: {meaning(channel) or channel}"
    return TERMS.get(name, "")


def legend(names: Iterable[str]) -> str:
    """Those of `names` that mean something, with what they mean, as HTML to be opened; empty if none does."""
    told = {name: meaning(name) for name in dict.fromkeys(names)}
    lines = "".join(f"<dt>{html.escape(name)}</dt><dd>{html.escape(text)}</dd>" for name, text in told.items() if text)
    return f"<details><summary>What the names mean</summary><dl>{lines}</dl></details>" if lines else ""
