"""Does the solver keep the protocol? Everything else waits for this."""

import numpy as np

from sph_gym.doctor.case import DX, all_finite, case, lattice
from sph_gym.doctor.diagnosis import COLUMNS, Measured, Result, failed, passed
from sph_gym.doctor.lab import OPTIONAL, TINY, Lab
from sph_gym.doctor.registry import check
from sph_gym.doctor.remedies import SORT_ALIKE
from sph_gym.doctor.subject import Misfit

_ORDER = (
    "Return particles in case.x's order at all times: sort copies, or keep the permutation and "
    "undo it in x, v, rho, p and a."
)


@check("setup", needs=())
def adapter(lab: Lab) -> Result:
    """Make a solver for nine particles, do two steps, read everything that it shows."""
    x = lattice(3, 3, 1.1 * DX)
    nine = case(x)
    subject = lab.make(nine)
    if not np.allclose(subject.x, x, rtol=1e-5, atol=1e-4 * DX):
        i = int(np.argmax(np.abs(subject.x - x).max(axis=1)))
        raise Misfit(
            f"x is not case.x before the first step: particle {i} is at {subject.x[i]}, expected "
            f"{x[i]}"
        )
    if not np.allclose(subject.v, 0.0):
        raise Misfit("v is not case.v before the first step")
    lab.float32 = subject.is_single
    for _ in range(2):
        subject.step(TINY * nine.h / nine.c0)
        # some show nothing before their first step
        lab.shown = frozenset(name for name in OPTIONAL if subject.shows(name))
        values = lab.seen(subject)
    if "evaluate" in lab.shown:
        subject.evaluate()
    if "neighbors" in lab.shown:
        subject.neighbors(4)
    bad = [name for name in ("x", "v") if not np.isfinite(values[name]).all()]
    if bad:
        return failed(
            f"nine particles at rest: {' and '.join(bad)} not finite after two tiny steps",
            "Stop at the first value that is not finite and name its particle (a tripwire); the "
            "usual causes are a division by a distance or a density of zero.",
            Measured("not finite", "finite"),
            link=_first_bad(values),
        )
    return passed(
        f"shows {', '.join(name for name in OPTIONAL if name in lab.shown) or 'x and v only'}"
    )


def _first_bad(values: dict[str, np.ndarray]) -> str:
    for name, link in COLUMNS.items():
        if name in values and not np.isfinite(values[name]).all():
            return link
    # positions and velocities were those of the case, and only forces are left to spoil them
    return "force" if "a" not in values else "integration"


@check("setup")
def order(lab: Lab) -> Result:
    """Let particles that don't touch fly apart: does each keep its place in x and v?"""
    # in an order that no grid would choose
    x = lattice(4, 4, 1.5 * DX * 3)[lab.rng.permutation(16)]
    v = lab.rng.uniform(-1.0, 1.0, (16, 2))
    start = case(x, v)
    subject = lab.make(start)
    dt = start.dt
    for n in range(4):
        where, speed = subject.x, subject.v
        if not all_finite(where, speed):
            return passed("some values are not finite, which other checks judge")
        moved, turned = _owners(where, x), _owners(speed, v)
        if (moved != range(16)).any() or (turned != range(16)).any():
            return _exchanged(moved, turned, n)
        subject.step(dt)
    return passed(
        "16 particles keep their places in 3 steps", Measured(0, 0, unit="particles exchanged")
    )


def _exchanged(moved: np.ndarray, turned: np.ndarray, n_steps: int) -> Result:
    """Return what is wrong; moved, turned: whose position and velocity each particle has."""
    together = (moved == turned).all()
    text = "16 particles far apart: " + (
        f"after {n_steps} steps, " if n_steps else "at the start, "
    )
    if together:
        text += f"{int((moved != range(16)).sum())} have changed places, in x and v alike"
    else:
        text += "positions and velocities of the same index belong to different particles"
    return failed(
        text,
        _ORDER if together else SORT_ALIKE,
        Measured(
            f"{int((moved != turned).sum() or (moved != range(16)).sum())} of 16",
            "0",
            unit="particles exchanged",
        ),
        link="setup" if together else "neighbours",
    )


def _owners(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return whose values each particle has, its own unless they are all only exchanged."""
    distance = np.linalg.norm(values[:, None] - known[None], axis=2)
    nearest = np.argmin(distance, axis=1)
    exchanged = len(set(nearest.tolist())) == len(known)
    close = distance.min(axis=1).max() < 0.1 * np.ptp(known)
    return nearest if exchanged and close else np.arange(len(known))
