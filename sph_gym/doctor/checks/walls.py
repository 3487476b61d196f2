"""Do the sides of the box hold, at every speed, without putting in energy? And a dam break."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sph_gym.doctor import throws
from sph_gym.doctor.case import DX, Array, Case, case, lattice
from sph_gym.doctor.checks.whole import QUARTER, STEPS, RunEnd, follow
from sph_gym.doctor.diagnosis import Measured, Result, failed, inconclusive, need, passed
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.registry import check
from sph_gym.doctor.throws import OUTSIDE, SIDES, Throw

# Thrown with so many c0. Faster than the second, walls of particles and of forces may leak.
_SLOW, _FAST, _MAD = 0.1, 0.3, 1.0
_LONG, _SHORT = 0.2, 0.05
# Moved by so much more than v dt in a step [spacings], a particle was put somewhere.
_JUMP = 2.0
_REFLECT = (
    "Walls that put particles back have to do both: clamp the position to the wall, and reflect "
    "(or remove) the component of the velocity across it, of every particle outside."
)
_BUILD = (
    "Treat all four sides of case.box alike, and every particle: clamp the position and reflect "
    "the normal velocity, or line the sides with three or more layers of boundary particles."
)


@check("walls", needs=("flight", "blob"))
def thrown_alone(lab: Lab) -> Result:
    """Throw lone particles at all sides and corners: do they stop, and how do they come back?"""
    runs = [throws.alone(lab, speed, _LONG) for speed in (_SLOW, _FAST)]
    if not all(run.finite for run in runs):
        return _not_finite(runs)
    jump = max(run.jump() for run in runs)
    if jump > _JUMP:
        return failed(
            "lone particles fly to the sides and corners of a box: one is moved by far more than "
            "v dt in a step",
            "A wall may move only the particles that have passed it, and only back to itself: "
            "look for an index that is missing, for an array that is assigned as a whole, and for "
            "a box that is periodic.",
            Measured(jump, 0.0, unit="dx", tolerance=f"{_JUMP:g} dx"),
        )
    stuck = [name for run in runs for name in _names(run, run.stuck())]
    if stuck:
        return failed(
            f"lone particles thrown at the sides: at {_listed(stuck)} the position stops, but the "
            "velocity goes on into the wall",
            _REFLECT,
            Measured("v kept", "v turned or stopped"),
        )
    return _tremble(runs) or _gap(lab, runs) or _judge_return(lab, runs)


def _tremble(runs: list[Throw]) -> Result | None:
    """Return at which sides particles turn again and again, None if nowhere."""
    names = [name for run in runs for name in _names(run, run.trembling())]
    if not names:
        return None
    return failed(
        f"lone particles thrown at the sides: at {_listed(names)} the velocity is turned again in "
        "every step, so that the particle stays outside and trembles",
        "Turn only velocities that go outwards, and put the particle back to the wall: one that is "
        "still outside after the turn must not be turned again.",
        Measured("turned again", "turned once"),
    )


def _gap(lab: Lab, runs: list[Throw]) -> Result | None:
    """Return where lone particles fly on as if nothing was there, if other sides turn them."""
    sharp = np.array([[run.sharp(k) for k in range(4)] for run in runs])
    lab.facts["sharp walls"] = sharp
    slow = runs[0]
    if not (sharp[0].any() and slow.untouched.any()):
        return None
    names = _names(slow, slow.untouched)
    return failed(
        f"lone particles thrown at the sides with {_SLOW} c0: some are turned back in one step, "
        f"but nothing stops those that fly to {_listed(names)}",
        _BUILD,
        Measured(f"open: {_listed(names)}", "open: none"),
    )


def _not_finite(runs: list[Throw]) -> Result:
    late = all(np.isfinite(run.x[:4]).all() for run in runs)
    need(late, "lone particles in a box are not finite, which other checks judge")
    return failed(
        "lone particles thrown at the sides of a box are finite until they get there",
        "Look for a division by the distance from the wall or from a boundary particle.",
        Measured("not finite", "finite"),
    )


def _names(run: Throw, which: NDArray[np.bool_]) -> list[str]:
    return [SIDES[k] if k >= 0 else "a corner" for k in run.side[which]]


def _listed(names: list[str]) -> str:
    return ", ".join(dict.fromkeys(names))


def _judge_return(lab: Lab, runs: list[Throw]) -> Result:
    """Judge the speeds after the bounce, of sides that turn a particle in a step and of others."""
    sharp = lab.facts["sharp walls"]
    back = [-run.towards[-1] for run in runs]
    fastest = max(float(each.max()) for each in back)
    # a force or a wall of particles turns particles in a few steps, with the error of these
    limit = 1.02 if sharp.all() else 1.25
    numbers = Measured(max(fastest, 0.0), "<= 1")
    if fastest > limit and not sharp.all():
        again = -throws.alone(lab, _FAST, _SHORT).towards[-1].min()
        if again < 1.15:
            return inconclusive(
                f"lone particles come back with {fastest:.3g} of their speed, with {again:.3g} in "
                "short steps: the wall's force is stiff",
                numbers,
            )
    if fastest > limit:
        return failed(
            f"lone particles come back from a wall with {fastest:.3g} of their speed",
            "A wall must not put in energy: the restitution lies between 0 and 1.",
            Measured(*numbers[:2], tolerance=f"{limit - 1:.0%}"),
        )
    return passed(
        f"lone particles thrown at sides and corners with {_SLOW} and {_FAST} c0: speed on the way "
        "back",
        numbers,
    )


@check("walls", needs=("thrown_alone",))
def thrown_blocks(lab: Lab) -> Result:
    """Throw blocks of particles at each side: none may end beyond it, nor with more energy."""
    runs = []
    for speed in (_SLOW, _FAST):
        runs.append(throws.blocks(lab, speed, _LONG))
        if not runs[-1].finite:
            return _blocks_not_finite(lab)
        if runs[-1].lost.any():
            return _leak(lab, runs[-1], speed)
    slow, fast = runs
    if max(slow.jump(), fast.jump()) > 1.0:
        return inconclusive(
            "particles of a block move by more than v dt", Measured(fast.jump(), 0.0)
        )
    if fast.energy > 2.0:
        return _more_energy(lab, fast)
    return passed(
        f"blocks of 5 x 5 thrown at the sides with {_SLOW} and {_FAST} c0: farthest beyond a side",
        Measured(
            max(float(slow.depth.max()), float(fast.depth.max())), f"<= {OUTSIDE:g}", unit="dx"
        ),
    )


def _blocks_not_finite(lab: Lab) -> Result:
    need(
        throws.blocks(lab, _FAST, _LONG, box=False).finite,
        "blocks are not finite in open space either, which other checks judge",
    )
    return failed(
        "blocks of 5 x 5 fly well in open space, but not finite any more at the sides of a box",
        "Look for a division by the distance from the wall, and for two particles that the wall "
        "puts on the same place.",
        Measured("not finite", "finite"),
    )


def _leak(lab: Lab, run: Throw, speed: float) -> Result:
    """Judge particles that ended outside; walls of forces may need gravity to be there."""
    shares = [run.lost_share(k) for k in range(4)]
    worst = int(np.argmax(shares))
    told = ", ".join(f"{name} {share:.0%}" for name, share in zip(SIDES, shares, strict=True))
    told += f"; {int(run.lost.sum())} particles in all"
    out = np.zeros(2)
    out[worst // 2] = 10.0 if worst % 2 else -10.0
    pulled = throws.blocks(lab, speed, _LONG, gravity=out)
    numbers = Measured(told, "0 %")
    if pulled.finite and pulled.lost_share(worst) < 0.5 * shares[worst]:
        return inconclusive(
            f"without gravity, blocks thrown at the sides with {speed} c0 leave the box ({told}); "
            "with gravity they don't: the walls may take their strength from it",
            numbers,
        )
    need(
        _decided(lab, run, worst, speed),
        f"some particles of blocks thrown with {speed} c0 leave the box ({told}): walls of "
        "forces or particles hold up to some speed, and let edges of a block through",
        numbers,
    )
    return failed(
        f"blocks of 5 x 5 thrown at the sides with {speed} c0: of those that get to a "
        f"side, so many end more than {OUTSIDE:g} dx outside: {told}" + _pattern(shares, speed),
        _BUILD
        if speed == _SLOW
        else _BUILD + " Test where a particle is after the step, not "
        "whether it is within a band near the wall: fast ones cross that in one step.",
        Measured(told, "0 %", tolerance=f"{OUTSIDE:g} dx"),
    )


def _decided(lab: Lab, run: Throw, worst: int, speed: float) -> bool:
    """Return whether what is lost at the worst side speaks against the walls of any kind."""
    if lab.facts.get("sharp walls", np.zeros((2, 4), dtype=bool))[0, worst]:
        return True
    share = run.lost_share(worst)
    if speed == _SLOW:
        return share >= 0.5
    mine = run.lost & (run.side == worst)
    return share >= 0.9 and bool(np.median(run.towards[-1, mine]) > 0.9)


def _pattern(shares: list[float], speed: float) -> str:
    leaking = [name for name, share in zip(SIDES, shares, strict=True) if share > 0]
    if speed > _SLOW:
        return f"; with {_SLOW} c0 none do: they tunnel"
    if min(shares) > 0.9:
        return ": there are no walls"
    if max(shares) < 0.9:
        return ": walls don't look at every particle"
    return f": nothing stops them at {_listed(leaking)}"


def _more_energy(lab: Lab, run: Throw) -> Result:
    short = throws.blocks(lab, _FAST, _SHORT)
    free = throws.blocks(lab, _FAST, _LONG, box=False)
    numbers = (run.energy, "<= 1")
    if short.finite and short.energy > 1.5 and free.finite and free.energy < 1.3:
        return failed(
            f"blocks thrown at the sides with {_FAST} c0 come back with {run.energy:.3g} times "
            f"their energy ({short.energy:.3g} in short steps; {free.energy:.3g} in open space)",
            "A wall must not put in energy: look at the sign of its force or of the velocity that "
            "it turns, and at its restitution (0 to 1).",
            Measured(*numbers, tolerance="2"),
        )
    return inconclusive(
        f"blocks thrown at the sides with {_FAST} c0 end with {run.energy:.3g} times their "
        f"energy, with {short.energy:.3g} in short steps, {free.energy:.3g} in open space",
        Measured(*numbers),
    )


@check("walls", needs=("thrown_alone", "thrown_blocks"))
def tunnelling(lab: Lab) -> Result:
    """Throw lone particles with the speed of sound at sides that stopped slower ones at once."""
    sharp = lab.facts.get("sharp walls")
    if sharp is None or not sharp.all():
        return inconclusive(
            "walls of forces or of particles: what they let through at the speed of sound is no "
            "fault of them"
        )
    runs = [throws.alone(lab, _MAD, dt) for dt in (_LONG, _SHORT)]
    need(all(run.finite for run in runs), "lone particles are not finite, which other checks judge")
    lost = [name for run in runs for name in _names(run, run.lost)]
    told = f"lone particles thrown with {_MAD:g} c0 at walls that turned slower ones in a step"
    if lost:
        return failed(
            f"{told}: some pass at {_listed(lost)}",
            "Test where a particle is after the step, not whether it is within a band near the "
            "wall or slow enough: fast ones cross that in one step.",
            Measured(len(lost), 0, unit="particles outside"),
        )
    return passed(told, Measured(0, 0, unit="particles outside"))


@check("walls", needs=("thrown_blocks", "free_fall"))
def standing(lab: Lab) -> Result:
    """Let a filled box stand under gravity: no particle may leave it, and nothing may explode."""
    columns, rows, g = 8, 6, 8.0
    x = lattice(columns, rows)
    # a spacing from the sides: walls whose first particles are on the side need as much
    x[:, 1] += DX - x[:, 1].min()
    side = (columns + 1) / 2 * DX
    start = case(x, gravity=(0.0, -g), box=(-side, side, 0.0, 14 * DX))
    subject, farthest = lab.make(start), -np.inf
    for _ in range(10):
        subject.step(_LONG * start.h / start.c0, 10)
        need(np.isfinite(subject.x).all(), "not finite, which the checks of the whole judge")
        # beyond left, right or floor
        beyond = max(np.abs(subject.x[:, 0]).max() - side, -subject.x[:, 1].min())
        farthest = max(farthest, float(beyond) / DX)
    energy = float((subject.v**2).sum(axis=1).mean() / 2 / (g * rows * DX))
    told = f"a box filled to {rows} dx, 100 steps under gravity"
    numbers = Measured(farthest, f"<= {OUTSIDE:g}", unit="dx")
    if farthest > OUTSIDE:
        return failed(f"{told}: a particle is {farthest:.3g} dx outside", _BUILD, numbers)
    if energy > 10:
        return inconclusive(f"{told}: kinetic energy in units of g H", Measured(energy, "< 1"))
    return passed(f"{told}: farthest beyond a side", numbers)


# A dam break that has less kinetic energy [g H] hardly moves: measured are 0.09 to 0.3.
_STIFF = 0.01


@check("walls", needs=("free_fall",), last=True)
def dam_break(lab: Lab) -> Result:
    """Let a column of 10 x 10 particles fall apart in a box: a tenth of what a dam break is."""
    x = lattice(10, 10)
    # a spacing from the sides: walls whose first particles are on the side need as much
    x += DX - x.min(axis=0)
    start = case(x, gravity=(0.0, -9.81), box=(0.0, 20 * DX, 0.0, 16 * DX))
    run = follow(lab, start, 2 * start.dt, STEPS)
    told = f"a column of 10 x 10 in a box, {STEPS} steps"
    if not run.finite:
        return _dam_not_finite(lab, start, told)
    unit = 9.81 * 10 * DX
    fallen = 9.81 * float((x - run.x)[:, 1].mean()) / unit
    energy, front = run.energy / unit, float(run.x[:, 0].max() - x[:, 0].max()) / DX
    if energy > 1.5:
        return _too_lively(lab, start, told, run)
    outside = _outside(run.x, start) / DX
    numbers = f"front {front:.3g} dx, fall {fallen:.2g} g H, energy {energy:.2g} g H"
    if outside > 1:
        return failed(
            f"{told}: particles leave the box, though the water is slow (below 0.2 c0)",
            "Walls of particles need as many layers as the support is deep, take part in densities "
            "and in pressures, and stay where they are; other walls must look at every particle in "
            "every step.",
            Measured(outside, "at most 1", unit="dx outside"),
        )
    if front < (0.8 if energy < _STIFF else 0.3):
        return _stays(told, front, energy)
    if fallen < 0.02:
        return inconclusive(f"{told}: it does not fall", Measured(numbers))
    return passed(told, Measured(numbers, "front > 0.8 dx, fall > 0, energy < 0.5 g H"))


def _outside(x: Array, start: Case) -> float:
    assert start.box is not None
    x_min, x_max, y_min, y_max = start.box
    low, high = np.array([x_min, y_min]), np.array([x_max, y_max])
    return float(max((low - x).max(), (x - high).max()))


def _dam_not_finite(lab: Lab, start: Case, told: str) -> Result:
    numbers = Measured("not finite", "finite")
    if follow(lab, start, start.dt / 2, 2 * STEPS).finite:
        return failed(
            f"{told}: not finite any more; with a quarter of the step it stays so",
            QUARTER,
            numbers,
            link="integration",
        )
    return failed(
        f"{told}: not finite any more, with a quarter of the step as well",
        "A blob in empty space stays finite. Walls press particles onto one place: skip pairs "
        "whose distance is (nearly) zero before dividing by it.",
        numbers,
        link="force",
    )


def _too_lively(lab: Lab, start: Case, told: str, run: RunEnd) -> Result:
    unit = 9.81 * 10 * DX
    short = follow(lab, start, start.dt / 2, 2 * STEPS)
    free = follow(lab, replace(start, box=None, gravity=np.zeros(2)), 2 * start.dt, STEPS)
    numbers = Measured(run.energy / unit, "< 0.5", unit="g H")
    if short.finite and short.energy < 0.5 * unit:
        return failed(
            f"{told}: it gains more energy than it had; not so with a quarter of the step",
            QUARTER,
            numbers,
            link="integration",
        )
    if free.finite and free.energy < 0.2 * unit and short.finite and short.energy > unit:
        return failed(
            f"{told}: it gains more energy than it had, with a quarter of the step as well, but "
            "not without box and gravity",
            "The walls put in energy: look at the velocity after a contact, and at the force of "
            "boundary particles.",
            numbers,
        )
    return inconclusive(f"{told}: it gains more energy than it had", numbers)


def _stays(told: str, front: float, energy: float) -> Result:
    numbers = Measured(front, "> 2", unit="dx")
    if energy < _STIFF:
        return failed(
            f"{told}: the front does not advance, and the column hardly moves ({energy:.2g} g H)",
            "Too much damping: viscosity is 0 in this case, so look for an artificial viscosity "
            "that is always on, for a decay of velocities, and for damping that is added twice.",
            numbers,
            link="viscosity",
        )
    return failed(
        f"{told}: it falls ({energy:.2g} g H), but into a heap: nothing pushes the front",
        "Hardly any pressure is there: look at the density under compression (does it change?), "
        "then at B in the equation of state.",
        numbers,
        link="pressure",
    )
