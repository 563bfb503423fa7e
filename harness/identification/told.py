"""What a diagnosis tells beside the estimates: parameters, nuisances, alternatives, remarks, the verdict."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ema_fmu_src import ports
from harness.actuators.actuator import Actuator
from harness.faults import FAULTS, KINDS
from harness.identification.estimates import Estimate
from harness.inference import coordinates
from harness.inference.explain import Explained
from harness.inference.groups import Group
from harness.inference.sensors import GAP, NUISANCES, SHIFT, unit_of
from harness.inference.unknowns import N_FAULTS


def parameters_of(found: Explained) -> dict[str, dict[str, Any]]:
    """The parameters that were not exact, by port: value and sigma by this run, and what was known before."""
    own, u = found.problem.unknowns, found.best.fit.u
    sigmas = np.sqrt(np.diag(found.best.fit.covariance()))[own.parameters] * own.scales
    values = own.prior.values + own.scales * u[own.parameters]
    known = zip(own.prior.names, values, sigmas, own.prior.values, own.prior.sigmas, strict=True)
    return {
        name: {
            "value": float(value),
            "sigma": float(sigma),
            "unit": ports.VARIABLES[ports.INDEX[name]].unit,
            "prior": float(before),
            "prior_sigma": float(width),
        }
        for name, value, sigma, before, width in known
    }


def nuisances_of(found: Explained) -> dict[str, dict[str, Any]]:
    """What sensors and loggers have done, as KIND.CHANNEL with the channel as it is shown, and an unknown load, in SI
    units."""
    own, measured = found.problem.unknowns, found.problem.runs[0].measured
    values, scales = own.nuisances_of(found.best.fit.u, 0), own.nuisance_scales(0)
    sigmas = np.sqrt(np.diag(found.best.fit.covariance()))
    spread = sigmas[own.nuisances[0]].reshape(scales.shape) * scales
    listed: dict[str, dict[str, Any]] = {}
    for k, name in enumerate(measured.channels):
        channel = measured.shown[name]
        for kind, label in enumerate(NUISANCES):
            if kind != GAP:
                scale = channel.scale if label == "offset" else 1.0
                listed[f"{label}.{channel.name}"] = {
                    "value": scale * float(values[k, kind]),
                    "sigma": abs(scale) * float(spread[k, kind]),
                    "unit": unit_of(label, channel.unit),
                }
    if found.load != "none":
        run, place = found.problem.runs[0], own.loads[0]
        curve = run.loads @ found.best.fit.u[place]
        travel = measured.output.scale("load_torque")
        listed["load_torque"] = {
            "value": travel * float(curve.mean()),
            "sigma": travel * float(np.abs(run.loads[0, 0]) * sigmas[place.start]),
            "lowest": travel * float(curve.min()),
            "highest": travel * float(curve.max()),
            "unit": measured.output.unit("load_torque"),
        }
    return listed


def shifts_of(found: Explained) -> list[float]:
    """The shift of each channel [s]."""
    return [float(value) for value in found.problem.unknowns.nuisances_of(found.best.fit.u, 0)[:, SHIFT]]


def alternatives_of(found: Explained) -> list[dict[str, Any]]:
    """Other faults that explain the run as well: their names, values in the ports' units, and by how much -2 log likelihood,
    with what each fault has to gain, is worse than the best's; and factors of sensors (relative errors, by port) that do so
    without a fault."""
    others = [{"faults": _values(other.faults, other.fit.u), "worse": found.worse(other)} for other in found.alternatives]
    if found.misread:
        others.append({"faults": {}, "gains": dict(found.misread.gains), "worse": found.misread.worse})
    return others


def _odds(worse: float) -> str:
    """Odds of the best explanation against another that is `worse`, in words."""
    if abs(worse) < 1.0:
        return "even odds"
    odds = min(float(np.exp(0.5 * abs(worse))), 1e6)
    return f"odds {odds:.2g} to 1 {'against' if worse > 0.0 else 'for'} it"


def _values(faults: Sequence[str], u: Any) -> dict[str, float]:
    values = coordinates.to_values(u[:N_FAULTS])
    return {name: values[name] for name in faults}


def remarks_of(found: Explained, estimates: Sequence[Estimate], untold: Sequence[Group], actuator: Actuator) -> list[str]:
    """What else may be the cause of what was found, what sensors have done, and what the run cannot tell apart."""
    by_name = {item.fault: item for item in estimates}
    alarmed = [item.fault for item in estimates if item.alarm]
    remarks = []
    for members in KINDS.values():
        items = [by_name[fault.name] for fault in members]
        alike = max(item.low for item in items) < min(item.high for item in items)
        if (group := members[0].group) and group.all_alike and alike and all(item.alarm for item in items):
            remarks.append(group.all_alike)
    for name, fault in FAULTS.items():
        item = by_name[name]
        if fault.better_than_healthy and item.alarm and fault.surely_better(item.low, item.high):
            remarks.append(fault.better_than_healthy)
    for other in found.alternatives:
        if set(other.faults) != set(found.best.faults) and (alarmed or other.faults):
            told = ", ".join(f"{name} = {value:.4g}" for name, value in _values(other.faults, other.fit.u).items())
            twins = [FAULTS[name].alone for name in other.faults if FAULTS[name].alone]
            odds = f"no model tells it from {twins[0]} for certain" if twins else _odds(found.worse(other))
            remarks.append(f"explained as well, or nearly, by {told or 'no fault at all'} ({odds})")
    if found.misread and alarmed:
        gains = " and ".join(f"{name} reads {100.0 * value:+.2g} %" for name, value in found.misread.gains.items())
        remarks.append(f"explained as well, or nearly, by no fault, if {gains} ({_odds(found.misread.worse)})")
    remarks += _beside(found)
    wide = {item.fault for item in estimates if item.alarm and not item.identifiable}
    named = [
        f"{' and '.join(group.members)}: {group.experiment}"
        for group in untold
        if (len(group.members) == 1 and set(group.members) <= set(FAULTS)) or set(group.members) & wide
    ]
    if named:
        remarks.append(f"this run cannot tell {'; '.join(named)} would")
    if not actuator.tolerances and not actuator.calibration:
        remarks.append("the parameters of the actuator are taken as exact; tolerances in its file would widen the intervals")
    return remarks


def _beside(found: Explained) -> list[str]:
    """What the sensors have clearly done, and an unknown load."""
    lines = []
    for name, item in nuisances_of(found).items():
        if name == "load_torque":
            lines.append(
                f"an unknown load was found: {item['lowest']:.3g} to {item['highest']:.3g} {item['unit']}, "
                f"{item['value']:.3g} on average"
            )
        elif abs(item["value"]) > _remarkable(name, found, item) and abs(item["value"]) > 5.0 * item["sigma"]:
            kind, channel = name.split(".", 1)
            lines.append(f"{channel}: {_words(kind, item)}")
    return lines


def _remarkable(name: str, found: Explained, item: dict[str, Any]) -> float:
    """Size from which a nuisance is worth a line: 0.5 ms, 0.5 % of a factor, and 0.5 % of the channel's range."""
    kind, channel = name.split(".", 1)
    if kind != "offset":
        return 5e-4 if kind in ("shift", "lag") else 5e-3
    run = found.problem.runs[0]
    places = {run.measured.shown[port].name: place for place, port in enumerate(run.measured.channels)}
    port = list(run.measured.channels)[places[channel]]
    return 5e-3 * float(run.spans[places[channel]]) * abs(run.measured.shown[port].scale)


def _words(kind: str, item: dict[str, Any]) -> str:
    value = float(item["value"])
    if kind == "shift":
        return f"logged {1e3 * abs(value):.3g} ms {'before' if value > 0.0 else 'after'} it happened"
    if kind == "lag":
        return f"low-passed with {1e3 * value:.3g} ms"
    if kind == "gain":
        return f"{100.0 * value:+.2g} % in its factor"
    return f"off by {value:+.3g} {item['unit']}"


def verdict_of(
    estimates: Sequence[Estimate], complaints: Sequence[str], fidelity: str, threshold: float, switch: int = 0
) -> str:
    """The verdict in a sentence: not explained, faulty, healthy, or healthy as far as the run tells. `switch`: the number
    of one that stays open."""
    if complaints:
        return f"not explained by {fidelity} and these faults: {'; '.join(complaints)}"
    if switch:
        return f"faulty: open_switch = {switch}; what else there may be cannot be told beside it"
    alarms = [item for item in estimates if item.alarm]
    unknown = [e.fault for e in estimates if e.fault in FAULTS and e.effect and not e.identifiable and not e.alarm]
    rest = f"; not identifiable from this run: {', '.join(unknown)}" if unknown else ""
    if not alarms:
        healthy = "as far as this run tells, healthy" if unknown else "healthy"
        return f"{healthy}: no fault is found to have lost more than {100.0 * threshold:g} % of its health{rest}"
    listed = [
        f"{item.fault} = {item.value:.4g} (health {'' if item.identifiable else 'at most '}{item.health:.2f})"
        for item in sorted(alarms, key=lambda alarm: alarm.health or 0)
    ]
    return f"faulty: {', '.join(listed)}{rest}"
