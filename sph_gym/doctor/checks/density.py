"""Does every particle have the density that its neighbours make?"""

import numpy as np

from sph_gym.doctor.case import C0, DX, RHO0, SUPPORT, H, case, interior, lattice
from sph_gym.doctor.continuity import (
    EVERY_PAIR,
    SUPPORT_RADIUS,
    by_continuity,
    factor_remedy,
    uneven,
)
from sph_gym.doctor.findings import Finding, failed, inconclusive, passed, skipped
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.laws import Match, MeasuredWeights, lattice_sum, match
from sph_gym.doctor.probes import (
    DISTANCES,
    Pairs,
    fields,
    fluid,
    pairs,
    spread,
    squeezing,
    tolerant,
)
from sph_gym.doctor.registry import check
from sph_gym.doctor.subject import SolverUnderTest

_LINKS = {"rho": "density", "p": "pressure", "a": "force"}
_SELF = (
    "Begin each sum with the particle's own share, rho[i] = m W(0, h), before the neighbours are "
    "added: then no density is ever zero."
)
_STEP = (
    "Stop at the first step in which v or x is not finite: accelerations are, so the step itself "
    "divides by zero, by a time step or by a largest speed that are none."
)


@check("density", step=4)
def isolated(lab: Lab) -> Finding:
    """Leave particles alone in empty space: is the density positive and everything finite?"""
    start = case(spread(3, H))
    subject = lab.make(start)
    for n in range(1, 11):
        bad = _first_not_finite(lab, subject.step(start.dt))
        if bad:
            return _lonely_nan(lab, subject, bad, n)
    if "evaluate" in lab.shown:
        subject.evaluate()
    bad = _first_not_finite(lab, subject)
    if bad:
        return _lonely_nan(lab, subject, bad, 10)
    if "rho" not in lab.shown:
        return passed("three particles far apart stay finite for 10 steps")
    lowest, unit = float(subject.get("rho").min()), "kg/m^3"
    if lowest > 0:
        return passed("three particles far apart", lowest, "above 0", unit=unit)
    return failed(
        "three particles far apart: a particle without neighbours has no density",
        _SELF,
        lowest,
        "m W(0), about 0.14 to 0.4 rho0",
        unit=unit,
    )


def _first_not_finite(lab: Lab, subject: SolverUnderTest) -> str:
    """Return the first of what is shown, along the chain, that is not finite; "" if all is."""
    shown = {name: subject.get(name) for name in _LINKS if name in lab.shown}
    shown |= {"x": subject.x, "v": subject.v}
    return next((name for name, each in shown.items() if not np.isfinite(each).all()), "")


def _lonely_nan(lab: Lab, subject: SolverUnderTest, name: str, n_steps: int) -> Finding:
    # positions and velocities are what accelerations make of them, which were finite so far
    moved = name not in _LINKS and "a" in lab.shown
    # a division by a density of zero shows in what comes after it
    empty = "rho" in lab.shown and not float(subject.get("rho").min()) > 0
    link = "integration" if moved else "density" if empty else _LINKS.get(name, "density")
    return failed(
        f"three particles far apart: {name} is not finite after {n_steps} steps"
        + (", though accelerations are" if moved else ""),
        _STEP if moved else _SELF,
        "not finite",
        "finite",
        link=link,
    )


@check("density", step=8, needs=("isolated",), shows=("rho",))
@tolerant
def kernel(lab: Lab) -> Finding:
    """Measure the density kernel by pairs: its shape, where it ends, the particle's own share."""
    ratio, table = SUPPORT, _reacting(lab, SUPPORT)
    if table is None and squeezing(lab):
        # a solver may keep densities from falling below rho0: squeeze it
        ratio = squeezing(lab) or SUPPORT
        table = _reacting(lab, ratio)
    if table is None:
        return by_continuity(lab)
    lab.facts["density"] = "summation"
    own, top = table.lone, float(table.rho.max())
    values = table.rho - own
    half = len(DISTANCES)
    here, there = values[:half].mean(axis=1), values[half:].mean(axis=1)
    noise = 0.01 * np.abs(values).max() + 1e-5 * top
    one_sided = np.abs(values[:, 0] - values[:, 1])
    if max(one_sided.max(), np.abs(here - there).max()) > noise:
        return uneven(table.q, one_sided, np.abs(here - there), noise)
    weights = MeasuredWeights(
        fluid(H, ratio), DISTANCES, here, own, match(DISTANCES, here, "weight")
    )
    finding = _ends(weights) or _own_share(weights)
    if finding:
        return finding
    lab.facts["weight"], lab.facts["kernel"] = weights, weights.found.name
    name = weights.found.name or "of no known name"
    return passed(f"pairs at {half} distances: the kernel is {name}", name, "a kernel")


def _reacting(lab: Lab, ratio: float) -> Pairs | None:
    """Return what densities of pairs are, None if they are that of a lone particle."""
    table = pairs(lab, np.tile(DISTANCES, 2), **fluid(H, ratio))
    own = table.lone
    return table if np.abs(table.rho - own).max() > 1e-4 * abs(own) else None


def _ends(weights: MeasuredWeights) -> Finding | None:
    """Return that the kernel ends elsewhere than at h, None if it doesn't."""
    q, values = weights.q, weights.values
    size = np.abs(values).max()
    beyond = (q > 1.0) & (np.abs(values) > 1e-3 * size)
    if beyond.any():
        return failed(
            "a pair further apart than case.h still has more than the density of one particle",
            SUPPORT_RADIUS,
            f"W > 0 at r = {q[beyond].max():.2f} h",
            "W = 0 beyond h",
        )
    inside = (q < 0.76) & (np.abs(values) > 1e-5 * size)
    if not inside[(q > 0.7) & (q < 0.76)].any():
        return failed(
            "a pair nearer than case.h has no more than the density of one particle",
            SUPPORT_RADIUS,
            f"W = 0 from r = {q[inside].max(initial=0.0):.2f} h on",
            "W > 0 up to h",
        )
    return None


def _own_share(weights: MeasuredWeights) -> Finding | None:
    """Return that a particle's own share is not the kernel's value at 0, None if it is."""
    near, next_ = weights.values[:2]
    step = weights.q[0] / (weights.q[1] - weights.q[0])
    low, high = near, near + max(near - next_, 0.0) * step
    if weights.found.kernel:
        low = high = weights.found.factor * float(weights.found.kernel.weight(np.zeros(1))[0])
    if high <= 0:
        return failed(
            "a close pair has less density than a lone particle",
            "The kernel must be positive and fall with r; check its sign and the order of h and r.",
            near,
            "above 0",
            unit="kg/m^3",
        )
    share = weights.own / high
    if 0.95 * low <= weights.own <= 1.05 * high:
        return None
    twice = 0.45 < share < 0.55
    return failed(
        "the density of a lone particle against the limit of close pairs: own share m W(0)",
        ("Each pair is counted twice, but not the particle itself. " + EVERY_PAIR)
        if twice
        else _SELF,
        share,
        1.0,
        unit="of m W(0)",
        tolerance="5 %",
        link="neighbours" if twice else "density",
    )


@check("density", step=4, needs=("isolated", "kernel"), shows=("rho",))
@tolerant
def density_follows(lab: Lab) -> Finding:
    """Let pairs approach each other: do their densities follow?"""
    if lab.facts.get("density") != "summation":
        return skipped("densities are no sums over positions")
    n = 4
    along = np.array([1.0, 0.0])
    places = spread(n, H)
    half = 0.35 * H * along
    x = np.concatenate([places - half, places + half])
    v = np.repeat([0.2 * along, -0.2 * along], n, axis=0)
    start = case(x, v * C0)
    subject = lab.make(start).step(0.5 * start.dt, 9)
    before = subject.x
    subject.step(0.5 * start.dt)
    rho, first = subject.get("rho"), lab.density(start)
    now = [lab.density(case(places_)) for places_ in (before, subject.x)]
    error = min(np.abs(rho - each).max() for each in now) / np.abs(now[1]).max()
    moved = np.abs(now[0] - first).max() / np.abs(now[1]).max()
    if moved < 0.02 or error < 0.25 * moved:
        return passed("four pairs approach: densities follow", error, 0.0)
    if np.abs(rho - first).max() < 0.05 * np.abs(now[0] - first).max():
        return failed(
            "four pairs approach for 10 steps: densities stay what they were at the start",
            "Renew densities in every step, before pressures and forces.",
            float(rho.mean()),
            float(now[1].mean()),
            unit="kg/m^3",
        )
    return inconclusive("densities of moving pairs are not those of their positions", error, 0.0)


@check("density", step=4, needs=("isolated",), shows=("rho",))
@tolerant
def interior_density(lab: Lab) -> Finding:
    """Set up a lattice at rest: is the density inside near rho0?"""
    share, explained = _inside(lab, H)
    if explained is not None and abs(share / explained - 1) > 0.02:
        return failed(
            "lattice of 11 x 11 at rest: the density inside is not the sum of what pairs add",
            EVERY_PAIR + " A limit on the number of neighbours has the same effect.",
            share,
            explained,
            unit="rho0",
            tolerance="2 %",
            link="neighbours",
        )
    weights = lab.facts.get("weight")
    found = weights.found if weights else Match("", 0.0, np.inf)
    right = abs(share - 1) <= 0.15 or _as_it_must(found, share)
    numbers = {"unit": "rho0", "tolerance": "15 %"}
    if right:
        return passed("lattice of 11 x 11 at rest", share, 1.0, **numbers)
    if weights and not found.kernel and abs(weights.mass / (RHO0 * DX**2) - 1) < 0.05:
        return inconclusive("lattice of 11 x 11; mass and kernel's integral right", share, 1.0)
    small, _ = _inside(lab, H / 2)
    if 0.8 < small < 1.25:
        return inconclusive("lattice of 11 x 11 at rest; right at half of h", share, 1.0, **numbers)
    remedy = factor_remedy(share, H, found, small)
    return failed("lattice of 11 x 11 at rest: the density inside", remedy, share, 1.0, **numbers)


def _inside(lab: Lab, h: float) -> tuple[float, float | None]:
    """Return the density inside a lattice at rest, measured and by the sum of pairs, in rho0."""
    settings = fluid(h)
    x = lattice(11, 11, settings["dx"], center=(9.13 * h, 8.71 * h))
    inside = interior(x, h * 0.999)
    rho = fields(lab, case([*x, (30.3 * h, 9.0 * h)], **settings)).rho
    share = float(np.median(rho[:-1][inside])) / RHO0
    weights = lab.facts.get("weight")
    if not isinstance(weights, MeasuredWeights) or weights.settings != settings:
        return share, None
    r = np.linalg.norm(x - x[len(x) // 2], axis=1)
    # a lone particle shows the mass, which some calibrate anew for every arrangement
    mass = float(rho[-1]) / weights.own
    return share, mass * float(weights.own + weights(r[r > 0]).sum()) / RHO0


def _as_it_must(found: Match, share: float) -> bool:
    """Return whether the kernel with the mass rho0 dx^2 reads so on a lattice."""
    if not found.kernel:
        return False
    expected = lattice_sum(found.kernel.weight, SUPPORT) / SUPPORT**2
    return abs(share / expected - 1) < 0.03
