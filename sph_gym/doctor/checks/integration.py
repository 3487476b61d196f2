"""Does a time step move particles as velocities and accelerations say?"""

from dataclasses import replace

import numpy as np

from sph_gym.doctor.case import DX, SUPPORT, Array, Case, all_finite, case, lattice
from sph_gym.doctor.diagnosis import Measured, Result, failed, inconclusive, need, passed
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.registry import check
from sph_gym.doctor.subject import Crash

# Far enough for a solver that takes h for the smoothing length of a kernel that ends at 3 h.
_FAR = 7 * SUPPORT * DX
# Time steps, in units of what sound takes across the support. The longer is `Case.dt`: a solver
# may refuse longer ones. The longest is long enough for one that divides steps into sub-steps.
LONG, SHORT, LONGEST = 0.1, 0.02, 1.0
_STEPS = 10
# Lone particles feel nothing but rounding, magnified where velocities are differences of positions.
_LONE = 5e-3
_LOST = "lone particles are not finite, which the checks of density judge"
MOVE = "The last lines of a step are v += a * dt and x += v * dt, with the dt that it was given: "


def duration(start: Case, share: float) -> float:
    """Return a time step [s] of this share of what sound takes across the support."""
    return share * start.h / start.c0


def _alone(v: Array, gravity: tuple[float, float] = (0.0, 0.0)) -> Case:
    """Return nine particles that can't feel each other."""
    return case(lattice(3, 3, _FAR), v, gravity=gravity)


def _course(lab: Lab, start: Case, dt: float, steps: int) -> tuple[Array, Array, Array, Array]:
    """Return x and v after the first step, and after `steps` more.

    The first step is left out: some solvers only prepare themselves in it.
    """
    subject = lab.make(start).step(dt)
    x, v = subject.x, subject.v
    subject.step(dt, steps)
    return x, v, subject.x, subject.v


def factor(values: Array, of: Array) -> float:
    """Return the factor that turns `of` into `values` best, 0 if there is none."""
    return float((values * of).sum() / max((of**2).sum(), 1e-300))


@check("integration", needs=("order",))
def flight(lab: Lab) -> Result:
    """Let lone particles fly without any force: v must stay, and x move by v dt a step."""
    angle = 2 * np.pi * np.arange(9) / 9 + 0.3
    v = np.stack([np.cos(angle), np.sin(angle)], axis=1) * np.linspace(0.5, 3.0, 9)[:, None]
    start = _alone(v)
    kept, moved = [], []
    for share in (LONG, SHORT):
        dt = duration(start, share)
        x1, v1, x2, v2 = _course(lab, start, dt, _STEPS)
        need(all_finite(x1, v1, x2, v2), _LOST)
        if wrong := _changed(v, v2, (_STEPS + 1) * dt):
            return wrong
        kept.append(factor(v2, v))
        moved.append(factor(x2 - x1, (v1 + v2) / 2 * _STEPS * dt))
    if max(abs(each - 1) for each in kept) > _LONE:
        return _decay(kept)
    if max(abs(each - 1) for each in moved) > 2 * _LONE:
        return _drift(moved)
    if divided := _divided(lab, start):
        return divided
    return passed(
        f"nine lone particles in {_STEPS} steps at two dt: displacement over v t, and v kept "
        f"(factor {kept[0]:.4g})",
        Measured(moved[0], 1.0, tolerance="1 %"),
    )


def _divided(lab: Lab, start: Case) -> Result | None:
    """Return what is wrong with a long step that the solver may divide, None if nothing is."""
    dt = duration(start, LONGEST)
    try:
        x1, v1, x2, v2 = _course(lab, start, dt, 2)
    except Crash:
        return None  # too long a step may be refused
    moved = factor(x2 - x1, (v1 + v2) / 2 * 2 * dt)
    # less is legal: some cut off what is longer than their own limit
    if not moved > 1 + 2 * _LONE or np.abs(v2 - start.v).max() > _LONE:
        return None
    return failed(
        f"nine lone particles fly straight with short steps; with dt = {LONGEST:g} h/c0 they are "
        f"displaced by {moved:.4g} v t",
        "A long step is divided into sub-steps that add up to more than dt: give each dt / n.",
        Measured(moved, 1.0, tolerance="1 %"),
    )


def _changed(before: Array, after: Array, time: float) -> Result | None:
    """Return what changes velocities other than by one factor, None if nothing does."""
    change = after - before
    size, speeds = np.abs(change).max(), np.linalg.norm(before, axis=1)
    if size < _LONE * speeds.min():
        return None
    if np.ptp(change, axis=0).max() < 0.05 * size:
        g = change.mean(axis=0) / time
        return failed(
            "gravity is 0, yet lone particles are all accelerated alike",
            "A gravity is built in: take it from case.gravity.",
            Measured(f"({g[0]:.4g}, {g[1]:.4g})", "(0, 0)", unit="m/s^2"),
            link="force",
        )
    if np.abs(change - (factor(after, before) - 1) * before).max() < 0.05 * speeds.max():
        return None
    limited = np.linalg.norm(after, axis=1)
    cut = limited < 0.98 * speeds
    if cut.any() and not cut.all() and np.ptp(limited[cut]) < 0.02 * limited.max():
        return failed(
            "nine lone particles without a force: the fast ones are slowed down to one speed",
            "Take the limit on velocities out: it hides an explosion instead of curing it.",
            Measured(limited.max(), speeds.max(), unit="m/s", tolerance="2 %"),
        )
    return inconclusive(
        "lone particles change their velocities, each in another way",
        Measured(size, 0.0, unit="m/s"),
    )


def _decay(kept: list[float]) -> Result:
    each = abs(kept[0]) ** (1 / (_STEPS + 1))
    alike = abs(kept[0] - kept[1]) < 0.2 * abs(1 - kept[0])
    how = f"v is multiplied by {each:.4g} a step, whatever dt is" if alike else "v decays with time"
    return failed(
        f"nine lone particles in {_STEPS} steps, no force on them: {how}",
        "Take the decay of velocities out of the step (it acts on the fall of a drop too, and "
        "stacks up with viscosity into jelly); damp by XSPH or viscosity, which act between "
        "neighbours only.",
        Measured(kept[0], 1.0, tolerance="0.5 %"),
        link="" if alike else "viscosity",
    )


def _drift(moved: list[float]) -> Result:
    long, short = moved
    ratio = long / short if short else np.inf
    expected = SHORT / LONG
    if abs(ratio / expected - 1) < 0.05:
        cause = "dt is ignored: a constant stands in its place."
    elif abs(ratio * expected - 1) < 0.05:
        cause = "dt comes in twice: x += v * dt * dt."
    elif abs(ratio - 1) < 0.05:
        cause = f"the displacement is {long:.3g} v dt at any dt: a factor too many."
    else:
        cause = "look for a limit on dt, and for a number of sub-steps that is rounded."
    return failed(
        f"nine lone particles fly for {_STEPS} steps: displacement over v t is {long:.4g} with "
        f"dt = {LONG} h/c0, {short:.4g} with {SHORT} h/c0",
        MOVE + cause,
        Measured(long, 1.0, tolerance="1 %"),
    )


@check("integration", needs=("flight",))
def galilean(lab: Lab) -> Result:
    """Give a block one velocity: it must do what the same block does at rest, and fly along."""
    speed = np.array([1.2, 0.7])
    still = case(lattice(4, 4))
    moving = replace(still, v=np.tile(speed, (16, 1)))
    dt = duration(still, LONG)
    one, other = (_course(lab, each, dt, _STEPS) for each in (still, moving))
    dx = (other[2] - other[0]) - (one[2] - one[0])
    dv = other[3] - one[3]
    scale = float(np.hypot(*speed))
    need(all_finite(dx, dv), "the block is not finite, which other checks judge")
    kept = factor(dv.mean(axis=0), speed)
    moved = factor(dx.mean(axis=0), speed * _STEPS * dt)
    spread = float(np.abs(dv - speed).max() / scale)
    told = f"a block of 4 x 4 with one velocity against the same at rest, {_STEPS} steps"
    numbers = Measured(kept, 1.0, tolerance="2 %")
    if abs(kept - 1) > 0.02:
        return failed(
            f"{told}: the block's velocity changes by a factor although nothing else is there",
            "Something acts on absolute velocities of particles that have neighbours: a decay, or "
            "a viscosity on v_i in place of v_j - v_i, in spite of viscosity = xsph = 0.",
            numbers,
            link="viscosity",
        )
    if abs(moved - 1) > 0.02 or spread > 0.05:
        return inconclusive(
            f"{told}: not the same, which may be the neighbours' fault as well",
            Measured(
                f"displacement {moved:.3g} v t, velocities differ by {spread:.2g}", "1 v t, 0"
            ),
        )
    return passed(f"{told}: velocity kept", numbers)


# Strong enough that a step moves particles by more than the rounding of single precision.
_FALLS = ((0.0, -40.0), (30.0, 0.0), (-20.0, 25.0))
_FALL_STEPS = (LONG, LONG / 2)
_FALL_ERROR = 0.03


@check("integration", needs=("flight", "galilean"))
def free_fall(lab: Lab) -> Result:
    """Let lone particles and a block fall along x, along y and askew: dv/dt must be g."""
    for gravity in _FALLS:
        if wrong := _fall(lab, gravity):
            return wrong
    return _falling_block(lab)


def _fall(lab: Lab, gravity: tuple[float, float]) -> Result | None:
    g, factors = np.array(gravity), []
    for share in _FALL_STEPS:
        start = _alone(np.zeros((9, 2)), gravity)
        dt, steps = duration(start, share), 4 * _STEPS
        _, v1, x2, v2 = _course(lab, start, dt, steps)
        need(all_finite(x2, v2), _LOST)
        a = (v2 - v1) / (steps * dt)
        factors.append(a)
        t = (steps + 1) * dt
        late = np.abs(x2 - start.x - g * t**2 / 2).max()
        if np.abs(a - g).max() > _FALL_ERROR * np.hypot(*g):
            continue
        if late > 2.5 * np.hypot(*g) * dt * t:
            return failed(
                "lone particles fall: v = g t, but x is not g t^2 / 2",
                MOVE + "look at how x is advanced.",
                Measured(late, 0.0, unit="m", tolerance="2.5 g dt t"),
            )
    if max(np.abs(a - g).max() for a in factors) > _FALL_ERROR * np.hypot(*g):
        return _wrong_fall(lab, g, factors)
    return None


def _wrong_fall(lab: Lab, g: Array, factors: list[Array]) -> Result:
    long, short = (each.mean(axis=0) for each in factors)
    link, cause = _cause(lab, g, long, short)
    return failed(
        f"lone particles under the gravity ({g[0]:g}, {g[1]:g}) m/s^2: dv/dt is "
        f"({long[0]:.4g}, {long[1]:.4g}) with dt = {LONG} h/c0 and ({short[0]:.4g}, "
        f"{short[1]:.4g}) with {LONG / 2:g} h/c0",
        cause,
        Measured(
            f"({long[0]:.4g}, {long[1]:.4g})",
            f"({g[0]:g}, {g[1]:g})",
            unit="m/s^2",
            tolerance=f"{_FALL_ERROR:.0%}",
        ),
        link=link,
    )


def _cause(lab: Lab, g: Array, long: Array, short: Array) -> tuple[str, str]:
    """Return the link and the remedy for a fall that is not g."""
    size = np.hypot(*g)
    # compared with each other, for both may be far below g
    larger = max(np.abs(long).max(), np.abs(short).max())
    if np.abs(long - short).max() > 2 * _FALL_ERROR * larger > 0:
        return "integration", MOVE + "here v += a * dt depends on dt in another way."
    if "a" in lab.shown:
        a = lab.acceleration(_alone(np.zeros((9, 2)), (g[0], g[1]))).mean(axis=0)
        if np.abs(a - g).max() < _FALL_ERROR * size:
            return "integration", (
                "a is g, as it should be, but v changes by something else: gravity is added once "
                "more in the step, or v += a * dt has a factor or an axis wrong."
            )
    times = float(long @ g / size**2)
    if np.abs(long - times * g).max() > 2 * _FALL_ERROR * size:
        return "force", "Take both components of case.gravity, with their signs."
    if abs(times - 2) < 0.05:
        return "force", "Gravity is added twice: once is enough."
    if abs(times + 1) < 0.05:
        return "force", "The sign of gravity is wrong: a += case.gravity."
    if abs(times) < 0.05:
        return "force", "Gravity is missing: a += case.gravity for each particle, lone ones too."
    return "force", f"Gravity is {times:.3g} times too strong: it is an acceleration, not a force."


def _falling_block(lab: Lab) -> Result:
    g = np.array([13.0, -39.0])
    gains = []
    for gravity in (np.zeros(2), g):
        start = case(lattice(4, 4), gravity=gravity)
        dt = duration(start, LONG)
        _, v1, _, v2 = _course(lab, start, dt, _STEPS)
        gains.append((v2 - v1).mean(axis=0) / (_STEPS * dt))
    fall = gains[1] - gains[0]
    need(np.isfinite(fall).all(), "the block is not finite, which other checks judge")
    numbers = Measured(
        f"({fall[0]:.4g}, {fall[1]:.4g})", f"({g[0]:g}, {g[1]:g})", unit="m/s^2", tolerance="3 %"
    )
    if np.abs(fall - g).max() > 0.03 * np.hypot(*g):
        return failed(
            "lone particles fall with g, but the center of a block of 4 x 4 doesn't (taken "
            "against the same block without gravity)",
            "Add gravity once a particle, outside of the loop over its neighbours, and as an "
            "acceleration: no density belongs to it.",
            numbers,
            link="force",
        )
    return passed("lone particles and a block fall along x, y and askew", numbers)
