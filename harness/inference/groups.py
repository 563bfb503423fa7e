"""What runs cannot tell apart: combinations of faults and parameters that move nothing that was measured."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harness.faults import FAULTS
from harness.inference import coordinates
from harness.inference.experiments import apart
from harness.inference.problem import Fit
from harness.inference.unknowns import N_FAULTS, Unknowns

Array = NDArray[np.float64]

UNTOLD = 5.0
"""A combination is not told by the data if it is open by more than so many per cent (ours)."""
OPEN = 1e4
"""Per cent from which it is not told at all."""
LEAST = 0.15
"""Share of the largest, in what it moves, from which an unknown counts as a member of a combination."""
MOST_MEMBERS = 8
"""Members of a combination that are named."""
NOTHING = 1e-9
"""Information below which there is none."""


@dataclass(frozen=True)
class Group:
    """A combination that the data leave open: `members`, name -> change in per cent (of a fault's range, of a parameter's
    value), by `sigma` per cent of them; `experiment`: the run that would tell its members apart."""

    members: dict[str, float]
    sigma: float
    experiment: str

    def as_dict(self) -> dict[str, object]:
        """For JSON; the sigma is None if the runs say nothing at all."""
        return {
            "members": self.members,
            "sigma_percent": self.sigma if np.isfinite(self.sigma) else None,
            "experiment": self.experiment,
        }


def groups(fit: Fit, unknowns: Unknowns, able: Sequence[str]) -> list[Group]:
    """The combinations of the faults `able` and the parameters that the data alone tell worse than to UNTOLD per cent.

    The weak eigenvectors of the data's information (Fisher) on faults and parameters, per 1 per cent of each, the nuisances
    marginalised over their priors; made sparse by row reduction, so that each begins with another member. The bound on what
    is known of each is Cramer and Rao's.
    """
    names = _names(unknowns)
    places = [at for at in range(unknowns.parameters.stop) if fit.free[at] and (at >= N_FAULTS or names[at] in able)]
    information = _information(fit, unknowns, np.array(places, dtype=int))
    size = np.sqrt(np.maximum(np.diag(information), 0.0))
    found = [
        Group({names[at]: 1.0}, np.inf, apart([names[at]])) for at, told in zip(places, size, strict=True) if told < NOTHING
    ]
    kept = [n for n, told in enumerate(size) if told >= NOTHING]
    inner = information[np.ix_(kept, kept)]
    values, vectors = np.linalg.eigh(inner)
    rows = _sparse(vectors[:, values < UNTOLD**-2].T, _order(kept, places, names))
    for row in rows:
        told = float(row @ inner @ row)
        sigma = 1.0 / np.sqrt(told) if told > OPEN**-2 else np.inf
        moved = np.abs(row) * size[kept]  # what each moves: they cancel
        strong = [n for n in np.argsort(-moved, kind="stable") if moved[n] > LEAST * moved.max()][:MOST_MEMBERS]
        members: dict[str, float] = {}
        for n in sorted(strong):
            members.setdefault(names[places[kept[n]]], float(f"{row[n]:.2g}"))
        found.append(Group(members, sigma, apart(list(members))))
    return found


def _names(unknowns: Unknowns) -> list[str]:
    return [*(item.fault for item in coordinates.COORDINATES), *unknowns.prior.names]


def _information(fit: Fit, unknowns: Unknowns, places: NDArray[np.intp]) -> Array:
    """The data's information on the unknowns at `places` per 1 per cent of each, the others marginalised."""
    others = np.flatnonzero(fit.free & (np.arange(len(fit.u)) >= unknowns.parameters.stop))
    data = fit.data[np.ix_(places, places)]
    if others.size:
        cross = fit.data[np.ix_(others, places)]
        data = data - cross.T @ np.linalg.solve(fit.hessian[np.ix_(others, others)], cross)
    sizes = []
    for at in places.tolist():
        if at < N_FAULTS:
            sizes.append(0.01)
        else:
            place = at - N_FAULTS
            value = abs(float(unknowns.prior.values[place])) or float(unknowns.scales[place])
            sizes.append(0.01 * value / float(unknowns.scales[place]))
    return np.asarray(data * np.outer(sizes, sizes))


def _order(kept: Sequence[int], places: Sequence[int], names: Sequence[str]) -> list[int]:
    """Columns in the order in which combinations shall begin with them: rare faults first, then the others, then
    parameters."""

    def rank(n: int) -> tuple[int, int]:
        name = names[places[kept[n]]]
        return (0 if name in FAULTS and FAULTS[name].rare else 1 if name in FAULTS else 2), n

    return sorted(range(len(kept)), key=rank)


def _sparse(rows: Array, order: Sequence[int]) -> Array:
    """Rows that span the same, each beginning with another column of `order` and without those of the other rows."""
    rows, done = rows.copy(), 0
    for column in order:
        if done < len(rows) and abs(rows[done:, column]).max() > 0.1 * abs(rows[done:]).max():
            best = done + int(np.argmax(abs(rows[done:, column])))
            rows[[done, best]] = rows[[best, done]]
            rows[done] /= rows[done, column]
            keep = np.arange(len(rows)) == done
            rows -= np.where(keep, 0.0, rows[:, column])[:, None] * rows[done]
            done += 1
    return np.array([row / np.max(np.abs(row)) for row in rows if np.any(row)]) if len(rows) else rows
