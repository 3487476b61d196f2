"""Does every particle have the density that its neighbours, or the flow, make?"""

import numpy as np

from sph_gym.doctor.case import C0, DX, RHO0, SUPPORT, Array, H, case, interior, lattice
from sph_gym.doctor.diagnosis import (
    COLUMNS,
    Measured,
    Result,
    failed,
    inconclusive,
    need,
    passed,
    skipped,
)
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.laws import Match, MeasuredWeights, integral, lattice_sum, match
from sph_gym.doctor.probes import (
    DISTANCES,
    STILL,
    Pairs,
    closing,
    fields,
    fluid,
    pairs,
    spread,
    squeezing,
)
from sph_gym.doctor.registry import check
from sph_gym.doctor.remedies import EVERY_PAIR, IN_2D, OWN_SHARE, RENEW, SUPPORT_RADIUS
from sph_gym.doctor.subject import SolverUnderTest

_UPSIDE_DOWN = ", and yet they push: the slope of the kernel has the wrong sign everywhere"


def by_continuity(lab: Lab) -> Result:
    """Return what is found of densities that don't depend on positions."""
    settings = fluid(H)
    early, late = closing(lab, DISTANCES, (4, 16), **settings)
    both, nearer = late.rho - early.rho, early.q - late.q
    rise = both.mean(axis=1)
    if np.abs(rise).max() < 1e-5 * np.abs(late.rho).max():
        return _deaf(lab, late.lone)
    lab.facts["density"] = "continuity"
    one_sided = np.abs(both[:, 0] - both[:, 1])
    if one_sided.max() > 0.05 * np.abs(both).max():
        return uneven(early.q, one_sided, np.zeros(len(rise)), 0.05 * np.abs(both).max())
    moved = np.abs(nearer) > 0.1 * np.abs(nearer).max()
    middle, slopes = ((early.q + late.q) / 2)[moved], (rise / np.where(moved, nearer, 1.0))[moved]
    if slopes[np.argmax(np.abs(slopes))] < 0:
        return _falling(slopes, bool((late.push - early.push).sum() > 1e-3 * C0**2 / H))
    return _reach(middle, slopes) or _slopes_mass(lab, middle, slopes)


def _falling(slopes: Array, pushes: bool) -> Result:
    """Return that densities fall where they should rise; pushes: whether pairs part even so."""
    # thinned particles that push: the slope in the force has the wrong sign, too
    return failed(
        "pairs that approach each other: their densities fall" + _UPSIDE_DOWN * pushes,
        "d rho_i/dt = sum m_j (v_i - v_j) . grad_i W_ij: check the order of i and j, and the sign "
        "of grad W, which points to the neighbour.",
        Measured(float(slopes.min()), "above 0", unit="kg/m^3 per h"),
        link="force" if pushes else "density",
    )


def _reach(q: Array, slopes: Array) -> Result | None:
    """Return that slopes end elsewhere than at h, None if they don't."""
    size = np.abs(slopes).max()
    far = (q > 1.0) & (np.abs(slopes) > 1e-2 * size)
    if far.any():
        return failed(
            "pairs further apart than case.h change each other's density",
            SUPPORT_RADIUS,
            Measured(f"to r = {q[far].max():.2f} h", "not beyond h"),
        )
    near = (q > 0.65) & (q < 0.76)
    if near.any() and np.abs(slopes[near]).max() < 1e-4 * size:
        return failed(
            "pairs nearer than case.h don't change each other's density",
            SUPPORT_RADIUS,
            Measured(f"none from r = {q[near].min():.2f} h on", "up to h"),
        )
    return None


def _slopes_mass(lab: Lab, q: Array, slopes: Array) -> Result:
    """Return whether d rho/dt = -rho div v has the right size."""
    found = match(q, slopes, "slope", alike=0.03)
    lab.facts["kernel"] = found.name
    mass = found.factor if found.kernel else integral(q, slopes * q) / 2
    plain = RHO0 / SUPPORT**2
    share = mass / plain
    name = found.name or "of no known name"
    if 0.8 < share < 1.25:
        return passed(
            f"densities by continuity; the kernel is {name}",
            Measured(share, 1.0, unit="of -rho div v"),
        )
    need(found.kernel, "densities by continuity, kernel unknown", Measured(share, 1.0))
    return failed(
        f"pairs that approach each other: d rho/dt = -rho div v is off ({name} kernel)",
        factor_remedy(share, H, found),
        Measured(share, 1.0, unit="of -rho div v", tolerance="20 %"),
    )


def _deaf(lab: Lab, own: float) -> Result:
    lists = "neighbors" in lab.shown
    start = case([[H, H], [1.3 * H, H]])
    listed = lists and 1 in lab.make(start).step(STILL * start.dt).neighbors(0)
    lost = (lists and not listed) or (not lists and own < 0.9 * RHO0)
    return failed(
        "pairs at 28 distances, at rest and approaching: each has the density of a lone particle",
        EVERY_PAIR if lost else RENEW,
        Measured(own, "more than that of a lone particle", unit="kg/m^3"),
        link="neighbours" if lost else "density",
    )


def uneven(q: Array, one_sided: Array, between: Array, noise: float) -> Result:
    """Return that densities of like pairs differ: between partners (k, 2), or places (k,)."""
    lonely = bool(one_sided.max() > noise)
    bad = one_sided > noise if lonely else np.tile(between > noise, 2)
    what = (
        "one partner counts the other, but not the other way round"
        if lonely
        else "the same distance gives different densities at another place"
    )
    return failed(
        f"pairs at {len(DISTANCES)} distances, in two places and directions each: {what}",
        EVERY_PAIR,
        Measured(
            f"{int(bad.sum())} of {len(q)} pairs, from r = {q[bad].min():.2f} h on", "0 pairs"
        ),
        link="neighbours",
    )


def factor_remedy(share: float, h: float, found: Match, small: float | None = None) -> str:
    """Return what makes a density `share` times as large; small: the same at half of h."""
    solid = found.kernel.solid if found.kernel else 1.4
    follows = small is None or abs(small / share / 2 - 1) < 0.1
    if follows and 0.7 < share * h / solid < 1.4:
        return (
            f"The kernel has the constant of three dimensions, {solid / h:.3g} times that of two"
            + ("; with half of h it is off by twice as much. " if small else ". ")
            + IN_2D
        )
    mass = f"The mass of a particle is rho0 dx^2 = {RHO0 * (h / SUPPORT) ** 2:.3g} kg/m in 2D"
    return f"{mass}; here densities are {share:.3g} times too large. Else the kernel's constant."


_STEP = (
    "Stop at the first step in which v or x is not finite: accelerations are, so the step itself "
    "divides by zero, by a time step or by a largest speed that are none."
)


@check("density", step=4)
def isolated(lab: Lab) -> Result:
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
        return passed("three particles far apart", Measured(lowest, "above 0", unit=unit))
    return failed(
        "three particles far apart: a particle without neighbours has no density",
        OWN_SHARE,
        Measured(lowest, "m W(0), about 0.14 to 0.4 rho0", unit=unit),
    )


def _first_not_finite(lab: Lab, subject: SolverUnderTest) -> str:
    """Return the first of what is shown, along the chain, that is not finite; "" if all is."""
    seen = lab.seen(subject).items()
    return next((name for name, each in seen if not np.isfinite(each).all()), "")


def _lonely_nan(lab: Lab, subject: SolverUnderTest, name: str, n_steps: int) -> Result:
    # positions and velocities are what accelerations make of them, which were finite so far
    moved = name not in COLUMNS and "a" in lab.shown
    # a division by a density of zero shows in what comes after it
    empty = "rho" in lab.shown and not float(subject.get("rho").min()) > 0
    link = "integration" if moved else "density" if empty else COLUMNS.get(name, "density")
    return failed(
        f"three particles far apart: {name} is not finite after {n_steps} steps"
        + (", though accelerations are" if moved else ""),
        _STEP if moved else OWN_SHARE,
        Measured("not finite", "finite"),
        link=link,
    )


@check("density", step=8, needs=("isolated",), shows=("rho",), may_refuse=True)
def kernel(lab: Lab) -> Result:
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
    if finding := _ends(weights) or _own_share(weights):
        return finding
    lab.facts["weight"], lab.facts["kernel"] = weights, weights.found.name
    name = weights.found.name or "of no known name"
    return passed(f"pairs at {half} distances: the kernel is {name}", Measured(name, "a kernel"))


def _reacting(lab: Lab, ratio: float) -> Pairs | None:
    """Return what densities of pairs are, None if they are that of a lone particle."""
    table = pairs(lab, np.tile(DISTANCES, 2), **fluid(H, ratio))
    own = table.lone
    return table if np.abs(table.rho - own).max() > 1e-4 * abs(own) else None


def _ends(weights: MeasuredWeights) -> Result | None:
    """Return that the kernel ends elsewhere than at h, None if it doesn't."""
    q, values = weights.q, weights.values
    size = np.abs(values).max()
    beyond = (q > 1.0) & (np.abs(values) > 1e-3 * size)
    if beyond.any():
        return failed(
            "a pair further apart than case.h still has more than the density of one particle",
            SUPPORT_RADIUS,
            Measured(f"W > 0 at r = {q[beyond].max():.2f} h", "W = 0 beyond h"),
        )
    inside = (q < 0.76) & (np.abs(values) > 1e-5 * size)
    if not inside[(q > 0.7) & (q < 0.76)].any():
        return failed(
            "a pair nearer than case.h has no more than the density of one particle",
            SUPPORT_RADIUS,
            Measured(f"W = 0 from r = {q[inside].max(initial=0.0):.2f} h on", "W > 0 up to h"),
        )
    return None


def _own_share(weights: MeasuredWeights) -> Result | None:
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
            Measured(near, "above 0", unit="kg/m^3"),
        )
    share = weights.own / high
    if 0.95 * low <= weights.own <= 1.05 * high:
        return None
    twice = 0.45 < share < 0.55
    return failed(
        "the density of a lone particle against the limit of close pairs: own share m W(0)",
        ("Each pair is counted twice, but not the particle itself. " + EVERY_PAIR)
        if twice
        else OWN_SHARE,
        Measured(share, 1.0, unit="of m W(0)", tolerance="5 %"),
        link="neighbours" if twice else "density",
    )


@check("density", step=4, needs=("isolated", "kernel"), shows=("rho",), may_refuse=True)
def density_follows(lab: Lab) -> Result:
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
    numbers = Measured(error, 0.0)
    if moved < 0.02 or error < 0.25 * moved:
        return passed("four pairs approach: densities follow", numbers)
    if np.abs(rho - first).max() < 0.05 * np.abs(now[0] - first).max():
        return failed(
            "four pairs approach for 10 steps: densities stay what they were at the start",
            RENEW,
            Measured(float(rho.mean()), float(now[1].mean()), unit="kg/m^3"),
        )
    return inconclusive("densities of moving pairs are not those of their positions", numbers)


@check("density", step=4, needs=("isolated",), shows=("rho",), may_refuse=True)
def interior_density(lab: Lab) -> Result:
    """Set up a lattice at rest: is the density inside near rho0?"""
    share, explained = _inside(lab, H)
    if explained is not None and abs(share / explained - 1) > 0.02:
        return failed(
            "lattice of 11 x 11 at rest: the density inside is not the sum of what pairs add",
            EVERY_PAIR + " A limit on the number of neighbours has the same effect.",
            Measured(share, explained, unit="rho0", tolerance="2 %"),
            link="neighbours",
        )
    weights = lab.facts.get("weight")
    found = weights.found if weights else Match("", 0.0, np.inf)
    right = abs(share - 1) <= 0.15 or _as_it_must(found, share)
    numbers = Measured(share, 1.0, unit="rho0", tolerance="15 %")
    if right:
        return passed("lattice of 11 x 11 at rest", numbers)
    if weights and not found.kernel and abs(weights.mass / (RHO0 * DX**2) - 1) < 0.05:
        return inconclusive(
            "lattice of 11 x 11; mass and kernel's integral right", Measured(share, 1.0)
        )
    small, _ = _inside(lab, H / 2)
    if 0.8 < small < 1.25:
        return inconclusive("lattice of 11 x 11 at rest; right at half of h", numbers)
    remedy = factor_remedy(share, H, found, small)
    return failed("lattice of 11 x 11 at rest: the density inside", remedy, numbers)


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


# The block shrinks by this share of its width, so fast that sound does not cross it meanwhile.
_SHRINK = 0.02
_STEPS = 8
_SPEED = 0.3 * C0


@check("density", step=4, needs=("isolated",), shows=("rho",))
def density_in_flow(lab: Lab) -> Result:
    """Let a block shrink by its own motion: does the density inside rise as it should?"""
    x = lattice(9, 9)
    half = x.max()
    dt = _SHRINK * half / _SPEED / _STEPS
    subject = lab.make(case(x, -_SPEED / half * x)).step(dt)
    begun, width = subject.get("rho"), np.ptp(subject.x[:, 0])
    subject.step(dt, _STEPS)
    rise, narrower = subject.get("rho") - begun, np.ptp(subject.x[:, 0]) / width
    # the nine in the middle, which no surface is near
    inside = np.abs(x).max(axis=1) < 1.5 * DX
    need(np.isfinite(rise).all(), "the block is not finite, which other checks judge")
    planned = _SHRINK * _STEPS / (_STEPS + 1)
    need(
        0.9 < (1 - narrower) / planned < 1.5,
        "the block does not shrink as it moves, which other checks judge",
    )
    expected = RHO0 * (narrower**-2 - 1)
    share = float(np.median(rise[inside]) / expected)
    told = f"a block of 9 x 9 becomes {1 - narrower:.1%} narrower by its own motion"
    if share > 0.3:
        return passed(f"{told}: its density rises", Measured(share, 1.0, unit="of -rho div v"))
    if share > -0.3:
        return inconclusive(f"{told}: its density hardly changes", Measured(share, 1.0))
    return failed(
        f"{told}: its density falls",
        "The rate of the density has the wrong sign: d rho_i/dt = sum m_j (v_i - v_j) . grad_i "
        "W_ij is positive where particles approach.",
        Measured(share, 1.0, unit="of -rho div v", tolerance="above 0.3"),
    )
