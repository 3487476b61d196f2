"""Do pressures push apart, both partners alike, in all directions alike, in a crowd as well?"""

import numpy as np

from sph_gym.doctor.case import C0, DX, RHO0, SUPPORT, Array, Case, H, case, cloud, lattice
from sph_gym.doctor.diagnosis import Measured, Result, failed, inconclusive, need, passed
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.laws import MeasuredWeights
from sph_gym.doctor.probes import (
    MOMENT,
    STILL,
    Seen,
    cluster,
    fields,
    fluid,
    groups,
    not_finite,
    pairs,
    passing,
    pressed,
    squeezing,
)
from sph_gym.doctor.registry import check
from sph_gym.doctor.remedies import EVERY_PAIR, UNIT_VECTOR

# An acceleration that counts as none [m/s^2], and one in motion [c0^2/h].
_NONE, _FAINT = 1e-4 * C0**2 / H, 1e-4
_SYMMETRIC = (
    "Use a form in which i pushes j as j pushes i, such as a_i = -sum m_j (p_i / rho_i^2 + "
    "p_j / rho_j^2) grad W or (p_i + p_j) / (rho_i rho_j). p_i alone, p_j alone, p_j - p_i, or a "
    "force that is divided by one particle's density only, make momentum out of nothing."
)
_SIGN = (
    "The sign of the kernel's gradient: in a_i = -sum m_j (p_i / rho_i^2 + p_j / rho_j^2) W'(r) "
    "(x_i - x_j) / r, W' is below zero, so that the two signs together push apart."
)
_SUCTION = (
    "Pressures below zero act, those above it don't: p = max(0, p), not min, and p = B ((rho / "
    "rho0)^gamma - 1) is above zero when rho > rho0."
)
_AT_ONCE = (
    "Do one thing for all particles before the next begins: all densities, all pressures, all "
    "accelerations, and only then all velocities and positions. In a loop that does all of it for "
    "one particle after the other, i is pushed by what j was a step ago, and j by what i is now."
)
_HALF = (
    "Each pair is in the list of one partner only. Either list it twice, or add to both partners "
    "when it is visited."
)


@check("force", step=3, needs=("isolated",), may_refuse=True)
def momentum(lab: Lab) -> Result:
    """Squeeze groups of four, then a cloud: do all forces add up to zero?"""
    ratio = squeezing(lab)
    numbers = {"unit": "of the forces", "tolerance": "1 %"}
    small = 0.0
    if ratio is not None:
        x = groups([cluster(4, H, lab.rng) for _ in range(6)], H)
        small = _left_over(pressed(lab, x, **fluid(H, ratio))[1], 6)
    if small > 0.01 and ratio is not None:
        what = "six groups of four particles: forces don't add up to zero"
        if "rho" not in lab.shown and _one_of_two(lab, ratio):
            what += "; of two partners, only one is pushed"
            return failed(what, _HALF, Measured(small, 0.0, **numbers), link="neighbours")
        return failed(what, _SYMMETRIC, Measured(small, 0.0, **numbers))
    x = lattice(6, 6, 0.75 * DX, center=(1.0, 1.1))
    x += lab.rng.uniform(-0.2, 0.2, x.shape) * 0.75 * DX
    large = _left_over(pressed(lab, x[None], **fluid(H))[1], 1)
    if large > 0.01:
        what, link, remedy = "a cloud of 6 x 6: forces don't add up to zero", "force", _SYMMETRIC
        if ratio is not None:
            what += ", though they do in groups of four"
            link, remedy = "neighbours", EVERY_PAIR
        return failed(what, remedy, Measured(large, 0.0, **numbers), link=link)
    worst = max(small, large)
    need(worst >= 0, "nothing pushes in groups under pressure", Measured(worst, 0.0, **numbers))
    return passed("groups of four and a cloud of 6 x 6", Measured(worst, 0.0, **numbers))


def _one_of_two(lab: Lab, ratio: float) -> bool:
    push = np.abs(pairs(lab, np.array([0.2, 0.4, 0.6]), **fluid(H, ratio)).push)
    return bool(np.all(push.min(axis=1) < 1e-6 * push.max(axis=1)))


def _left_over(found: Seen, n_groups: int) -> float:
    """Return the sum of a group's accelerations as a share of their sizes; the largest of all."""
    a = found.a.reshape(n_groups, -1, 2)
    sizes = np.linalg.norm(a, axis=2).sum(axis=1)
    real = sizes > _NONE
    if not real.any() or not np.isfinite(a).all():
        return float("nan")
    return float((np.linalg.norm(a.sum(axis=1), axis=1)[real] / sizes[real]).max())


@check("force", step=4, needs=("momentum", "flight"))
def momentum_in_motion(lab: Lab) -> Result:
    """Let a cloud shrink and burst: do forces add up to zero in every step?"""
    x = cloud(lab.rng, 8, 8, 0.9 * DX, 0.1)
    start = case(x, -0.025 * C0 / DX * (x - x.mean(axis=0)))
    subject, gains = lab.make(start), []
    for _ in range(12):
        gains.append(subject.step(start.dt).v - start.v)
    gained = np.array(gains)
    need(np.isfinite(gained).all(), "a cloud in motion is not finite, which other checks judge")
    size = float(np.linalg.norm(gained, axis=2).sum(axis=1).max())
    if size < 1e-3 * np.abs(start.v).sum():
        return inconclusive("a cloud shrinks, and nothing pushes")
    left = float(np.linalg.norm(gained.sum(axis=1), axis=1).max()) / size
    numbers = Measured(left, 0.0, unit="of what all gain", tolerance="0.5 %")
    if left > 5e-3:
        what = "a cloud of 8 x 8 in motion: its momentum changes, though forces at rest add up to 0"
        return failed(what, _AT_ONCE, numbers)
    return passed("a cloud of 8 x 8 in motion keeps its momentum", numbers)


@check("force", step=3, needs=("isolated", "momentum"), may_refuse=True)
def push_apart(lab: Lab) -> Result:
    """Squeeze a blob: do its particles move apart?"""
    for side, spacing in ((5, 0.75), (5, 0.45), (9, 0.3)):
        x = lattice(side, side, spacing * DX, center=(1.0, 1.1))
        found = fields(lab, case(x))
        if not np.isfinite(found.a).all():
            return not_finite(lab, found, "a squeezed blob", "Look for divisions by zero. ")
        if np.abs(found.a).max() > _NONE:
            return _apart(lab, _outward(x, found.a), found)
    if found.rho.max() > 1.05 * RHO0 and "p" in lab.shown:
        return _no_push(found)
    return _contracting(lab, found)


def _outward(x: Array, a: Array) -> float:
    """Return the mean of accelerations away from the middle, in units of the largest one."""
    arms, size = x - x.mean(axis=0), float(np.abs(a).max())
    return float((a * arms).sum() / (size * np.abs(arms).sum())) if size else 0.0


def _apart(lab: Lab, out: float, found: Seen) -> Result:
    numbers = Measured(out, "above 0", unit="of the largest acceleration")
    if out > 0.02:
        return passed("a blob, squeezed, expands", numbers)
    if out > -0.02:
        return inconclusive("a blob, squeezed: no clear direction", Measured(out, "above 0"))
    suction = bool(found.p.mean() < 0) or not _pairs_attract(lab)
    return failed(
        "a blob, squeezed, contracts" + (", but close pairs don't" * suction),
        _SUCTION if suction else _SIGN,
        numbers,
        link="pressure" if suction else "force",
    )


def _pairs_attract(lab: Lab) -> bool:
    """Return whether pairs denser than rho0 attract each other; True if that can't be tried."""
    ratio = squeezing(lab)
    if ratio is None:
        return True
    found = pairs(lab, np.array([0.2, 0.4, 0.6]), **fluid(H, ratio))
    return not found.push.min() > -_NONE or found.rho.max() < RHO0


def _contracting(lab: Lab, found: Seen) -> Result:
    """Return whether a blob that contracts is pushed apart, where densities are by continuity."""
    early, late = (_in_motion(lab, -1.0, n) for n in (6, 30))
    numbers = {"unit": "c0^2/h"}
    if not np.isfinite([early, late]).all():
        return failed(
            "a blob in motion is not finite", "Look for divisions by zero.", Measured("", "finite")
        )
    out = late if abs(late) > abs(early) else early
    # a stiff fluid rebounds soon: what it does first counts
    if max(early, late) > _FAINT:
        return passed("a blob that contracts is pushed apart", Measured(out, "above 0", **numbers))
    if min(early, late) < -_FAINT:
        return failed(
            "a blob that contracts is pulled together", _SIGN, Measured(out, "above 0", **numbers)
        )
    back = _in_motion(lab, 1.0, 30)
    if abs(back) < _FAINT:
        return _no_push(found)
    if back < 0:
        link, remedy = "pressure", _SUCTION
    else:
        link, remedy = "density", "d rho/dt = -rho div v is above zero where particles approach."
    what = "a blob that contracts is not pushed apart, but one that expands feels a force"
    return failed(what, remedy, Measured(back, 0.0, **numbers), link=link)


def _in_motion(lab: Lab, rate: float, n_steps: int) -> float:
    """Return the mean push outwards [c0^2/h] in a blob that expands (rate > 0) or contracts."""
    x = lattice(5, 5, DX, center=(1.0, 1.1))
    dt = MOMENT * H / C0
    subject = lab.make(case(x, 0.5 * rate * C0 / H * (x - x.mean(axis=0)))).step(dt, n_steps)
    x = subject.x
    a = passing(subject, lab, dt).a
    return _outward(x, a) * float(np.abs(a).max()) * H / C0**2


def _no_push(found: Seen) -> Result:
    # comparisons that are true for NaN, too: for what isn't shown
    if found.rho.max() <= 1.05 * RHO0:
        return inconclusive(
            "a blob could not be squeezed above rho0", Measured(float(found.rho.max()))
        )
    link = "pressure" if found.p.max() <= 0 else "force"
    # a blob that is denser than rho0 by far pushes, unless its densities are much too small
    link = link if np.isfinite(found.rho).all() else "density"
    return failed(
        "a blob of 9 x 9 at 0.3 of its spacing: nothing pushes",
        "Log densities: they must be far above rho0 here (mass rho0 dx^2, constants of 2D). Then "
        "check that p > 0 for rho > rho0, and that the force is added to the velocities.",
        Measured(0.0, "a push outwards", unit="m/s^2"),
        link=link,
    )


_TURNS = {
    "mirrored in x": ((-1, 0), (0, 1)),
    "mirrored in y": ((1, 0), (0, -1)),
    "x and y exchanged": ((0, 1), (1, 0)),
    "turned by 90 degrees": ((0, -1), (1, 0)),
    "turned by 37 degrees": ((0.8, -0.6), (0.6, 0.8)),
}
_N_COPIES = 5


@check("force", step=3, needs=("isolated",), may_refuse=True)
def isotropy(lab: Lab) -> Result:
    """Mirror and turn a squeezed group: do the accelerations turn with it?"""
    ratio = squeezing(lab) or SUPPORT
    shape = cluster(7, H, lab.rng, least=0.2) * (1.0 if ratio < 2 else 0.5)
    turns = [np.eye(2)] * _N_COPIES + [np.array(t, dtype=float) for t in _TURNS.values()]
    _, found = pressed(lab, groups([shape @ t.T for t in turns], H), **fluid(H, ratio))
    a = found.a.reshape(len(turns), -1, 2)
    size = float(np.abs(a).max())
    if not np.isfinite(a).all() or size < _NONE:
        return inconclusive("a group of seven was not pushed", Measured(size))
    back = np.stack([each @ turn for each, turn in zip(a, turns, strict=True)])
    errors = np.abs(back - back[0]).max(axis=(1, 2)) / size
    moved, turned = float(errors[:_N_COPIES].max()), float(errors[_N_COPIES:].max())
    numbers = {"unit": "of the largest acceleration", "tolerance": "2 %"}
    if moved > 0.02:
        return failed(
            "a group of seven, put elsewhere, is pushed differently",
            EVERY_PAIR,
            Measured(moved, 0.0, **numbers),
            link="neighbours",
        )
    if turned > 0.02:
        which = list(_TURNS)[int(np.argmax(errors[_N_COPIES:]))]
        return failed(
            f"a group of seven, {which}, is pushed differently{_only(a)}",
            UNIT_VECTOR + " Look for an x where y is meant.",
            Measured(turned, 0.0, **numbers),
        )
    return passed("a group of seven, moved, mirrored and turned", Measured(turned, 0.0, **numbers))


def _only(a: Array) -> str:
    across = np.abs(a).max(axis=(0, 1))
    if across.min() > 1e-3 * across.max():
        return ""
    return f": it is pushed along {'xy'[int(np.argmax(across))]} only"


_TOUCH = (
    "Skip pairs nearer than some 1e-6 h when the direction (x_i - x_j) / r is formed; their "
    "share of the density stays."
)


@check("force", step=3, needs=("isolated",), may_refuse=True)
def coincident(lab: Lab) -> Result:
    """Put two particles at one place, alone and in a blob: does everything stay finite?"""
    blob = lattice(5, 5, DX, center=(1.0, 1.1))
    dense = lattice(5, 5, 0.85 * DX, center=(1.0, 1.1))
    cases = [case([*each, each[12]]) for each in (blob, dense)]
    speeds = [_speed_after(lab, each) for each in cases]
    if not np.isfinite(speeds).all():
        remedy = _TOUCH
        return failed(
            "two particles at one place: not finite after 7 steps",
            remedy,
            Measured("not finite", "finite"),
        )
    fastest = speeds[0]
    numbers = Measured(fastest, "below 5", unit="c0")
    if fastest > max(5, 10 * _speed_after(lab, case(blob))):
        return failed(
            "two particles at one place in a blob at rest fly off",
            _TOUCH + " A division by r^2, or by a tiny r that stands for zero, has this effect.",
            numbers,
        )
    return passed("two particles at one place, in a blob at rest", numbers)


def _speed_after(lab: Lab, start: Case) -> float:
    """Return the largest speed [c0] after some steps, NaN if x or v is not finite."""
    subject = lab.make(start).step(STILL * H / C0, 2).step(0.5 * start.dt, 5)
    return float(np.abs([subject.v / C0, 0 * subject.x]).max())


@check("force", step=4, needs=("isolated", "kernel", "interior_density"), may_refuse=True)
def dense_group(lab: Lab) -> Result:
    """Crowd 40 particles into one place: are densities their sums, and all finite?"""
    x = cluster(40, 0.6 * H, lab.rng, least=0.03) + np.array([1.0, 1.1])
    start = case(x)
    found = fields(lab, start)
    if not np.isfinite(found.a).all():
        return not_finite(lab, found, "40 particles within a circle of 0.6 h", _TOUCH)
    weights = lab.facts.get("weight")
    few = x[:3]
    if (
        not isinstance(weights, MeasuredWeights)
        or (weights.settings["h"], weights.settings["dx"]) != (start.h, start.dx)
        or np.abs(_shares(lab, weights, few) - 1).max() > 0.02
    ):
        return passed("40 particles within a circle of 0.6 h: all finite")
    share = _shares(lab, weights, x)
    worst = float(share[np.argmax(np.abs(share - 1))])
    text = "40 particles within a circle of 0.6 h: density"
    numbers = Measured(worst, 1.0, unit="of the sum over pairs", tolerance="5 %")
    if 0.95 < worst < 1.05 or np.ptp(share) < 0.02:
        return passed(text, numbers)
    remedy = EVERY_PAIR + " Lists of a fixed length must be long enough for a crowd."
    return failed(text, remedy, numbers, link="neighbours")


def _shares(lab: Lab, weights: MeasuredWeights, x: Array) -> Array:
    """Return densities (n,) as shares of the sums over pairs."""
    r = np.linalg.norm(x[:, None] - x[None], axis=2)
    np.fill_diagonal(r, np.inf)
    return np.asarray(fields(lab, case(x)).rho / (weights.own + weights(r).sum(axis=1)))
