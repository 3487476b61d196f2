"""Shares that neighbours add to a density, measured on pairs: for solvers that show densities."""

from typing import NamedTuple

import numpy as np

from sph_gym.doctor.case import DX, RHO0, Array, case, cloud, lattice
from sph_gym.doctor.groups import at_rest
from sph_gym.doctor.lab import Lab

# Distances of the pairs [h].
DISTANCES = np.round(np.arange(0.025, 1.225, 0.025), 3)
# Wide enough for 50 neighbours at rest, and so for more in the crowd than many lists hold.
SUPPORT = 4.0
# A kernel that ends with a larger step than this share of its middle does not end there by itself.
STEP = 0.04


class Weights(NamedTuple):
    """Densities [kg/m^3] of one evaluation.

    alone: that of a particle alone; pairs: (k, 2) what the other adds, for both of each pair at the
    k `DISTANCES`; x, rho: positions (m, 2) [m] and densities (m,) of a crowd; few: (9, 2), (9,)
    the same of a group of nine; h: support radius [m].
    """

    alone: float
    pairs: Array
    x: Array
    rho: Array
    few_x: Array
    few_rho: Array
    h: float

    @property
    def added(self) -> Array:
        """Return what a neighbour adds (k,), the mean of both of a pair."""
        return np.asarray(self.pairs.mean(axis=1))

    @property
    def once(self) -> bool:
        """Return whether a very near neighbour adds what a particle adds to itself."""
        return abs(self.added[0] / self.alone - 1) < 0.2

    @property
    def one_sided(self) -> bool:
        """Return whether the two of a pair add different amounts to each other."""
        first, second = self.pairs[DISTANCES < 0.7].T
        return bool(np.abs(first - second).max() > 0.05 * np.abs(self.pairs).max())

    @property
    def ends(self) -> float:
        """Return the largest distance [h] at which a neighbour adds something."""
        counted = np.abs(self.added) > 1e-3 * np.abs(self.added).max()
        return float(DISTANCES[counted].max())

    def predicted(self, x: Array) -> Array:
        """Return the densities (m,) that the pairs predict for particles at x."""
        r = np.linalg.norm(x[:, None] - x[None], axis=2) / self.h
        added = np.interp(r, DISTANCES, self.added, left=self.added[0], right=0.0)
        np.fill_diagonal(added, 0.0)
        return np.asarray(self.alone + added.sum(axis=1))


def pair_weights(lab: Lab) -> Weights | None:
    """Return the weights, measured once a diagnosis.

    None if the solver shows no densities, if they don't react on neighbours (as those by
    continuity), are held at rho0 from below or are not finite, or if particles fly off at once.
    """
    if "pair_weights" not in lab.facts:
        lab.facts["pair_weights"] = _measured(lab) if "rho" in lab.shown else None
    found = lab.facts["pair_weights"]
    assert found is None or isinstance(found, Weights)
    return found


def ends_softly(lab: Lab, reach: float) -> bool | None:
    """Return whether what a neighbour adds dies away towards `reach` [h], where lists end.

    None where that can't be measured.
    """
    weights = pair_weights(lab)
    if weights is None:
        return None
    last = np.interp(0.97 * reach, DISTANCES, weights.added)
    return bool(abs(last) < STEP * np.abs(weights.added).max())


def _measured(lab: Lab) -> Weights | None:
    h = SUPPORT * DX
    rng = np.random.default_rng(1)
    k = len(DISTANCES)
    # one particle alone, then the pairs, 4 h from each other and in all directions
    places = lattice(8, 7, 4 * h, (0.3 * h, 17.1 * h))[: k + 1]
    turned = rng.uniform(0, 2 * np.pi, k)
    others = places[1:] + h * DISTANCES[:, None] * np.stack([np.cos(turned), np.sin(turned)], 1)
    crowd, few = cloud(rng, 9, 9, 0.95 * DX, 0.1), lattice(3, 3, 0.95 * DX, (4.4 * h, 0.1 * h))
    x = np.concatenate([places, others, crowd, few])
    rho, _, moved = at_rest(lab, case(x, h=h))
    if rho is None or not np.isfinite(rho).all() or not np.abs(moved).max() < 1e-3 * h:
        return None
    alone, first, second, rho_crowd, rho_few = np.split(rho, np.cumsum([1, k, k, len(crowd)]))
    pairs = np.stack([first, second], axis=1) - alone
    held = abs(alone[0] / RHO0 - 1) < 1e-6
    if held or not np.abs(pairs).max() > 1e-4 * np.abs(rho).max():
        return None
    return Weights(float(alone[0]), pairs, crowd, rho_crowd, few, rho_few, h)
