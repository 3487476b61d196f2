"""Is the recording whole: finite numbers, the same particles in the same order?"""

import numpy as np

from sph_gym.doctor.diagnosis import Measured, Result, failed, inconclusive, passed
from sph_gym.doctor.passive.survey import CHAIN, Change, RecordingSurvey, nearest
from sph_gym.doctor.reading import Frame
from sph_gym.doctor.remedies import SORT_ALIKE

# Particles that vanish nearer than this to the border of all others [spacings] may have left.
BORDER = 4.0


def layout(survey: RecordingSurvey) -> Result:
    """Say what the recording holds: frames, particles, quantities."""
    frame, recording = survey.first, survey.recording
    columns = [name for name in (*CHAIN, "ids") if getattr(frame, name) is not None]
    n, d = frame.x.shape
    n_walls = 0 if survey.walls is None else len(survey.walls)
    return passed(
        f"{recording.form}: {len(recording)} frames of {n} fluid and {n_walls} wall particles in "
        f"{d} dimensions, with {', '.join(columns)}",
        Measured(f"{len(recording)} frames of {n} fluid particles", "at least 1"),
    )


def finite(survey: RecordingSurvey) -> Result:
    """Find the first density, pressure, velocity or position that is not finite."""
    bad = survey.bad
    if bad is None:
        return passed("all numbers of all frames are finite", Measured(0, 0, unit="not finite"))
    names = {"rho": "density", "p": "pressure", "v": "velocity", "x": "position"}
    before = f"; frame {bad.frame - 1} is finite" if bad.frame else ", from the start"
    return failed(
        f"the {names[bad.column]} of particle {bad.particle} in frame {bad.frame} is the first "
        f"that is not finite, and {bad.n} of that frame are not{before}. Of several quantities "
        "in one frame the first of the chain is named: density, pressure, velocity, position",
        "Let the solver stop at the first value that is not finite (`watch`). The usual causes: a "
        "density of zero, where a particle without neighbours lacks its own share; a distance of "
        "zero between two particles at one place; a time step that is too long.",
        Measured(f"{bad.column} in frame {bad.frame}", "finite"),
        link=CHAIN[bad.column] if bad.frame or bad.column in ("rho", "p") else "setup",
    )


def particles(survey: RecordingSurvey) -> Result:
    """Follow the particles: their number, their identities, their order."""
    if survey.doubled >= 0:
        return failed(
            f"in frame {survey.doubled} two particles have the same identity; in frame 0 all "
            "differ",
            "Give every particle a number of its own, also to those that are put in later, and "
            "sort it with all other columns.",
            Measured("twice the same", "all differ"),
        )
    if survey.change is not None:
        return _changed(survey, survey.change)
    return _in_order(survey)


def _changed(survey: RecordingSurvey, change: Change) -> Result:
    some = f" ({', '.join(change.names)})" if change.names else ""
    lost, gained = len(change.lost), change.gained
    counts = f"{survey.looks[change.frame - 1].n} then {survey.looks[change.frame].n}"
    numbers = Measured(counts, "the same number", unit="particles")
    if lost:
        x = survey.frame(change.frame - 1).x
        if survey.walls is not None:
            x = np.concatenate([x, survey.walls])
        depth = np.minimum(change.lost - x.min(axis=0), x.max(axis=0) - change.lost).min(axis=1)
        inside = int((depth > BORDER * survey.spacing).sum())
        if inside and not gained:
            return failed(
                f"{lost} particles{some} are gone in {survey.when(change.frame)}; {inside} of them "
                f"were more than {BORDER:g} spacings inside all others, where nothing flows out",
                "Look for what deletes particles: a limit of density or speed, or a column that "
                "was shortened. What it deletes is the trace of an earlier fault.",
                numbers,
            )
    return inconclusive(
        f"from {survey.when(change.frame)} on the particles are others: {lost} known ones lost"
        f"{some}, {gained} more than before. An inlet, an outlet or a limit of the domain does "
        "that too",
        numbers,
    )


def _in_order(survey: RecordingSurvey) -> Result:
    """Without identities, look whether rows still belong to the particles that they did."""
    n = survey.looks[0].n if survey.looks else 0
    for k, a, b in survey.pairs():
        if a.ids is not None or len(a.x) < 8:
            break
        near = nearest(a.x, b.x)
        if np.median(near) < 0.3 * survey.spacing and _scattered(a, b) > 2 * survey.spacing:
            survey.reordered = True
            return _exchanged(survey, k, a, b)
    return passed("the same particles in all frames", Measured(n, n, unit="particles"))


def _scattered(a: Frame, b: Frame) -> float:
    """Return how far [m] rows move, as a median, beyond what a common motion or v explains."""
    moved = b.x - a.x
    rests = [moved, moved - np.median(moved, axis=0)]
    if a.v is not None and b.v is not None:
        mean = (a.v + b.v) / 2
        size = float((mean**2).sum())
        rests.append(moved - mean * (float((moved * mean).sum()) / size if size else 0.0))
    return min(float(np.median(np.linalg.norm(rest, axis=1))) for rest in rests)


def _exchanged(survey: RecordingSurvey, k: int, a: Frame, b: Frame) -> Result:
    from scipy.spatial import cKDTree

    place = cKDTree(b.x).query(a.x)[1]
    if a.v is not None and b.v is not None:
        size = float(np.median(np.linalg.norm(a.v, axis=1)))
        as_x = float(np.median(np.linalg.norm(b.v[place] - a.v, axis=1)))
        as_rows = float(np.median(np.linalg.norm(b.v - a.v, axis=1)))
        if as_rows < 0.3 * size < 0.7 * size < as_x:
            return failed(
                f"from {survey.when(k)} to the next, positions are in another order, velocities "
                "are not: a velocity no longer belongs to its particle",
                SORT_ALIKE,
                Measured(
                    as_x / size,
                    0.0,
                    tolerance="change of velocity in its row of x, as a share of the speed",
                ),
                link="neighbours",
            )
    return inconclusive(
        f"from {survey.when(k)} to the next, rows belong to other particles, and there are no "
        "identities: the motion of single particles can't be followed. Write an id with each",
        Measured("another order", "the same order"),
    )
