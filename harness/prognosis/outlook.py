"""What a series of flights says about the future of an actuator: trends, and a verdict; in words and as JSON."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from harness.errors import HarnessError
from harness.faults import FAULTS
from harness.prognosis.growth import FEWEST_RUNS, Trend, follow
from harness.prognosis.history import IdentifiedFlight

LIFE = (0.05, 0.5, 0.95)
"""Quantiles of the remaining useful life that are reported."""


@dataclass(frozen=True)
class Outlook:
    """The trends by short name, of those faults that enough runs identify.

    `unit` of time; `runs`: number of all flights; `problems`: a line for each flight that was left out; `not_followed`: a
    line for each fault without a trend.
    """

    trends: dict[str, Trend]
    unit: str
    runs: int
    problems: list[str]
    verdict: str
    not_followed: list[str]

    def as_dict(self) -> dict[str, object]:
        """For JSON; times in `unit` from the first run."""
        return {
            "unit": self.unit,
            "runs": self.runs,
            "problems": self.problems,
            "verdict": self.verdict,
            "not_followed": self.not_followed,
            "faults": {name: _as_dict(trend) for name, trend in self.trends.items()},
        }


def outlook(history: Sequence[IdentifiedFlight], limits: Mapping[str, float], unit: str) -> Outlook:
    """The trend of every fault that at least FEWEST_RUNS flights identify; HarnessError if there is none.

    `limits` by short name, where not those of the faults; `unit` of time.
    """
    problems = [item.problem for item in history if item.problem]
    trends: dict[str, Trend] = {}
    not_followed: list[str] = []
    for name, fault in FAULTS.items():
        all_known = [(item.flight.at, item.estimates[name]) for item in history if not item.problem]
        known = [(at, estimate) for at, estimate in all_known if estimate.identifiable]
        if len(known) < FEWEST_RUNS:
            reason = f"identifiable in {len(known)} of {len(all_known)} runs, {FEWEST_RUNS} are needed"
            nothing = [estimate.reason for _, estimate in all_known if not estimate.effect]
            not_followed.append(f"{name}: {nothing[0] if nothing else reason}")
            continue
        at = np.array([when for when, _ in known])
        values = np.array([estimate.value for _, estimate in known])
        sigmas = np.array([0.25 * (estimate.high - estimate.low) for _, estimate in known])
        limit = limits.get(name, fault.limit_towards(float(values[-1])))
        trends[name] = follow(fault, limit, at, values, sigmas)
    if not trends:
        used = len(history) - len(problems)
        few = f"{used} run(s) can be used, {FEWEST_RUNS} are the least for a trend"
        none = f"no fault is identifiable in {FEWEST_RUNS} of the {used} runs that can be used; more runs are needed"
        lost = f"; left out: {'; '.join(problems)}" if problems else ""
        raise HarnessError(f"{few if used < FEWEST_RUNS else none}{lost}")
    return Outlook(trends, unit, len(history), problems, _verdict(trends, unit), not_followed)


def _verdict(trends: Mapping[str, Trend], unit: str) -> str:
    growing = {name: trend for name, trend in trends.items() if trend.grows}
    if not growing:
        return "no fault grows"
    lives = {name: trend.life(0.5)[0] for name, trend in growing.items()}
    name = min(growing, key=lambda fault: (lives[fault] is None, lives[fault] or 0.0))
    others = f"; growing too: {', '.join(other for other in growing if other != name)}" if len(growing) > 1 else ""
    return f"{name} reaches its limit of {growing[name].limit:g} {life_in_words(growing[name], unit)}{others}"


def life_in_words(trend: Trend, unit: str) -> str:
    """The remaining useful life: median and 90 % interval."""
    if trend.health <= 0.0:
        return "now: the limit is reached"
    low, median, high = trend.life(*LIFE)
    if median is None:
        return f"later than in {trend.horizon:.3g} {unit}, most likely"
    end = f"{high:.3g}" if high is not None else f"more than {trend.horizon:.3g}"
    return f"in {median:.3g} {unit} (90 %: {low:.3g} to {end})"


def _as_dict(trend: Trend) -> dict[str, object]:
    low, median, high = trend.life(*LIFE)
    return {
        "event": f"{trend.fault.name} limit",
        "limit": trend.limit,
        "event_state": trend.health,
        "value": trend.level,
        "rate": trend.rate,
        "rate_sigma": float(np.sqrt(trend.covariance[1, 1])),
        "grows": trend.grows,
        "runs": len(trend.at),
        "time_of_event": {"samples": trend.times_of_event.tolist(), "reached": trend.reached, "horizon": trend.horizon},
        "remaining_useful_life": {"5 %": low, "50 %": median, "95 %": high},
    }
