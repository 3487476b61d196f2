"""Does a group of particles feel the same wherever it is, and in whatever order it is given?"""

import numpy as np
from numpy.typing import NDArray

from sph_gym.doctor.case import DX, Array, Case, case, cloud, lattice
from sph_gym.doctor.checks.neighbours import FAR
from sph_gym.doctor.diagnosis import Measured, Result, failed, inconclusive, need, passed
from sph_gym.doctor.groups import Response, difference, disc, felt, respond
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.registry import check
from sph_gym.doctor.remedies import BRUTE_FORCE

# Responses of equal groups may differ by so much, as a share of the largest.
EQUAL = 5e-3
# With 32 bits, far from the origin, where positions are rounded to 1e-4 h.
ROUNDED = 0.1
# Differences above this are none of 64 bits, and may come from 32.
DOUBLE = 1e-9
# A group: so many particles, of which most find pressure, in a disc of so many h.
MEMBERS, RADIUS, NEAREST = 7, 0.45, 0.15
UNEQUAL = f"{EQUAL} of the largest"
_SILENT = "particles don't feel each other, at rest or in motion"


# Pushes of this size [c0^2 / h] are no fluid's, squeezed or not.
_BURST = 1e9
_THROWN = "groups at rest burst, which other checks judge"
_ANOTHER = "the same case twice gives different numbers"


@check("neighbours", step=2, needs=("order",))
def same_everywhere(lab: Lab) -> Result:
    """Put the same group at 26 places: does it feel the same at each?"""
    start, places, members = _copies(lab)
    response = respond(lab, start, np.repeat(places, MEMBERS, axis=0))
    need(response.finite, "the same group at 26 places: some numbers are not finite")
    need(felt(response, start), _SILENT)
    if _explodes(response, start):
        return inconclusive(_THROWN)
    copies = response.take(members)
    middle = _median(copies)
    wandering = np.abs(copies.moved - middle.moved).max(axis=(1, 2))
    if (wandering > 0.01 * start.h).any():
        return _walled(start, places, wandering)
    differs = difference(copies, middle, start)
    if (differs > EQUAL).any():
        return _unequal(lab, start, places, members, differs)
    return passed(
        f"the same group of {MEMBERS} at {len(places)} places feels the same",
        Measured(float(differs.max()), 0.0, tolerance=UNEQUAL),
    )


def _copies(lab: Lab) -> tuple[Case, Array, NDArray[np.intp]]:
    """Return the case, the places (k, 2) and the indices (k, m) of the particles at each."""
    h = 2 * DX
    places = lattice(5, 5, 4 * h)
    # at other places within the cells each, and one that is far from all
    places = places + lab.rng.uniform(0, h, places.shape)
    places = np.concatenate([places, [[60.3 * h, 45.8 * h]]])
    group = disc(lab.rng, MEMBERS, RADIUS * h, NEAREST * h)
    x = (places[:, None] + group[None]).reshape(-1, 2)
    return case(x, h=h), places, np.arange(len(x)).reshape(len(places), MEMBERS)


def _median(copies: Response) -> Response:
    rho = None if copies.rho is None else np.median(copies.rho, axis=0)
    return Response(rho, np.median(copies.a, axis=0), np.median(copies.moved, axis=0))


def _explodes(response: Response, start: Case) -> bool:
    """Return whether particles are pushed so hard that no step is short enough for them."""
    return bool(np.abs(response.a).max() > _BURST * start.c0**2 / start.h)


def _walled(start: Case, places: Array, wandering: Array) -> Result:
    worst = int(np.argmax(wandering))
    return failed(
        f"groups at rest in open space (case.box is None): the one at {_place(places[worst])} m "
        f"was moved by {wandering[worst] / start.h:.2g} h in tiny steps, others were not",
        "Look for walls, or a domain that is periodic, at fixed coordinates: walls are where "
        "case.box says, and nowhere if it is None.",
        Measured(float(wandering[worst] / start.h), 0.0, unit="h"),
        link="walls",
    )


def _place(place: Array | tuple[float, float]) -> str:
    return f"({place[0]:.3g}, {place[1]:.3g})"


def _unequal(
    lab: Lab, start: Case, places: Array, members: NDArray[np.intp], differs: Array
) -> Result:
    again = respond(lab, start, np.repeat(places, MEMBERS, axis=0)).take(members)
    repeats = np.allclose(difference(again, _median(again), start), differs, rtol=0.01, atol=1e-4)
    need(repeats, _ANOTHER)
    worst = int(np.argmax(differs))
    wrong = np.asarray(differs > EQUAL)
    text = (
        f"the same group of {MEMBERS} at {len(places)} places feels different things: at "
        f"{int(wrong.sum())} of them, the numbers are not the median ones, at "
        f"{_place(places[worst])} m by {100 * differs[worst]:.2g} %"
    )
    if not _alone(lab, start, places, members, worst):
        text += "; alone it does not, so groups that are 3 h apart feel each other"
    elif abs(np.mean(wrong == (places < 0).any(axis=1)) - 0.5) > 0.45:
        text += "; what decides is whether a coordinate is negative"
    return failed(
        text,
        BRUTE_FORCE + "Look at the borders of cells (all nine cells searched? cells as wide as "
        "the support?), at negative coordinates (floor(), not int()), at a hash that leads two "
        "cells to one place, and at whether pairs beyond the support are left out.",
        Measured(float(differs[worst]), 0.0, tolerance=UNEQUAL),
    )


def _alone(lab: Lab, start: Case, places: Array, members: NDArray[np.intp], worst: int) -> bool:
    """Return whether the group at the worst place is unlike another also if each is alone."""
    felt_there = []
    for place in (worst, 0 if worst else 1, len(places) - 1):
        x = start.x[members[place]]
        felt_there.append(respond(lab, case(x, h=start.h), places[place]))
    there, *others = felt_there
    return any(_unlike(there, other, start) > EQUAL for other in others)


def _unlike(one: Response, other: Response, start: Case) -> float:
    """Return by how much the responses of two groups differ."""
    return float(difference(one.take(np.arange(len(one.a))[None]), other, start)[0])


def _need_the_same_again(lab: Lab, start: Case, here: Response) -> None:
    again = respond(lab, start, start.x.mean(axis=0))
    need(_unlike(again, here, start) <= 0.01 * EQUAL, _ANOTHER)


@check("neighbours", step=2, needs=("order",))
def same_when_shifted(lab: Lab) -> Result:
    """Shift a cloud by parts of a cell, to negative coordinates and far away."""
    worst, silent = 0.0, True
    for ratio in (2, 3, 4):
        # squeezed, so that there is pressure; multiples of the spacing come near borders of cells
        spacing = 0.85 * DX
        start = case(np.round(lattice(9, 5) / DX) * spacing, h=1.001 * ratio * spacing)
        here = respond(lab, start, start.x.mean(axis=0))
        need(here.finite, f"a squeezed lattice, h/dx = {ratio}: some numbers are not finite")
        silent = silent and not felt(here, start)
        for shift in ((0.5, 0.25), (-20.0, 0.0), (-0.37, -7.13), (FAR, -FAR)):
            moved = case(start.x + np.array(shift) * start.h, h=start.h)
            there = respond(lab, moved, moved.x.mean(axis=0))
            differs = _unlike(there, here, start) if there.finite else np.inf
            single = shift[0] == FAR and (lab.float32 or worst > DOUBLE)
            if not differs < (ROUNDED if single else EQUAL):
                return _shifted(lab, start, moved, here, there, shift)
            worst = worst if single else max(worst, differs)
    if silent:
        return inconclusive(_SILENT)
    return passed(
        f"squeezed lattices, h/dx = 2, 3, 4: the same after shifts of 0.5 to {FAR:.0f} h",
        Measured(worst, 0.0, tolerance=UNEQUAL),
    )


def _shifted(
    lab: Lab, start: Case, moved: Case, here: Response, there: Response, shift: tuple[float, float]
) -> Result:
    differs = _unlike(there, here, start) if there.finite else np.nan
    _need_the_same_again(lab, start, here)
    if _explodes(there, start) or _explodes(here, start):
        return inconclusive(_THROWN)
    wandering = np.abs(there.moved - here.moved).max(axis=1)
    if (wandering > 0.01 * start.h).any():
        return _walled(start, moved.x, wandering)
    return failed(
        f"a squeezed lattice of {start.n}, h = {start.h:.3g} m: after a shift by {_place(shift)} h "
        + (f"it feels something else, by {100 * differs:.2g} %" if there.finite else "it is NaN"),
        BRUTE_FORCE + "Cells of negative coordinates come from floor(), not from int(); a grid "
        "must cover where particles are, not where they began.",
        Measured(float(differs) if there.finite else "not finite", 0.0, tolerance=UNEQUAL),
    )


@check("neighbours", step=2, needs=("order",))
def any_order(lab: Lab) -> Result:
    """Give the same particles in other orders: does each feel the same?"""
    worst = []
    # much squeezed, for pressure even if half of all pairs are missing; and with 44 neighbours
    for start in (
        case(cloud(lab.rng, 7, 7, 0.65 * DX, 0.2), h=2 * DX),
        case(cloud(lab.rng, 9, 9, 0.8 * DX, 0.2)),
    ):
        here = respond(lab, start, start.x.mean(axis=0))
        need(here.finite, "a squeezed cloud: some numbers are not finite")
        if felt(here, start):
            worst.append(_reordered(lab, start, here))
        if worst and worst[-1] > EQUAL:
            return _by_order(lab, start, here, worst[-1])
    need(worst, _SILENT)
    return passed(
        "a squeezed cloud feels the same in three orders",
        Measured(max(worst), 0.0, tolerance=UNEQUAL),
    )


def _reordered(lab: Lab, start: Case, here: Response) -> float:
    """Return the largest difference after the particles were given in two other orders."""
    worst = 0.0
    for order in (np.arange(start.n)[::-1], lab.rng.permutation(start.n)):
        other = case(start.x[order], h=start.h)
        there = respond(lab, other, start.x.mean(axis=0)).take(np.argsort(order))
        worst = max(worst, _unlike(there, here, start) if there.finite else np.inf)
    return worst


def _by_order(lab: Lab, start: Case, here: Response, worst: float) -> Result:
    _need_the_same_again(lab, start, here)
    return failed(
        f"a squeezed cloud of {start.n}: when the particles are given in another order, densities "
        f"or accelerations change by {100 * worst:.2g} %",
        BRUTE_FORCE + "Lists that hold too few neighbours drop others in another order; where "
        "pairs are listed once (i < j), both must be given their share.",
        Measured(worst, 0.0, tolerance=UNEQUAL),
    )
