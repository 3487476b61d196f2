"""Which plates mirror the fluid, and the corners between them."""

import math
from itertools import combinations, product
from typing import Any, NamedTuple

import numpy as np

from sph_gym.solver.images import MirrorPlates
from sph_gym.solver.scene import Scene
from sph_gym.solver.state import Floats
from sph_gym.solver.walls import SIDES

# Largest cosine of the angle of two plates that count as perpendicular.
SQUARE = 1e-6
# Support radii: as good as infinite.
FAR = 1e6


class Plate(NamedTuple):
    """A straight wall from `begin` along the unit vector `along` (2,) for `length` [m]."""

    begin: Floats
    along: Floats
    length: float

    @property
    def normal(self) -> Floats:
        """The unit vector to the right of `along`."""
        return np.array([self.along[1], -self.along[0]])

    def place(self, x: Floats) -> tuple[Any, Any]:
        """Return distances of points (n, 2) from its line [m], with a sign, and places along it."""
        return (x - self.begin) @ self.normal, (x - self.begin) @ self.along


def mirroring_plates(scene: Scene) -> list[Plate]:
    """Return the plates that mirror the fluid: those that enclose it.

    At the start all fluid is on one side, and both ends are out of its way: at another such plate
    or side of the box, beyond it, or h above the fluid. At an end within the flow particles would
    lose sight of each other at once, which makes energy. Not those before boundary particles or
    beside a side of the box; and none in periodic space.
    """
    walls = scene.walls
    if walls is None or walls.plates is None or walls.is_periodic:
        return []
    plates = [_plate(*plate) for plate in np.asarray(walls.plates).tolist()]
    chosen, before = [plate for plate in plates if _bounds(plate, scene)], -1
    sides = _sides(scene)
    while len(chosen) != before:
        before = len(chosen)
        chosen = [plate for plate in chosen if _is_closed(plate, [*chosen, *sides], scene)]
    return chosen


def _bounds(plate: Plate, scene: Scene) -> bool:
    """Return whether all fluid is on one side, and no boundary particle or side of the box near."""
    walls, h = scene.walls, scene.h
    assert walls is not None
    distance, _ = plate.place(np.asarray(scene.x))
    if distance.min() < 0 < distance.max():
        return False
    if walls.particles is not None:
        distance, along = plate.place(np.asarray(walls.particles))
        if ((np.abs(distance) < h) & (along > 0) & (along < plate.length)).any():
            return False
    return all(
        abs(plate.along @ side.along) < 1 - SQUARE or abs(float(side.place(plate.begin)[0])) > h
        for side in _sides(scene)
    )


def _is_closed(plate: Plate, others: list[Plate], scene: Scene) -> bool:
    """Return whether both ends of a plate are out of the way of the fluid."""
    x = np.asarray(scene.x)
    field = scene.effects.field
    gravity = np.zeros(2) if field is None else field.lasting()
    level = (x @ -gravity).max() + scene.h * np.hypot(*gravity)
    _, along = plate.place(x)
    for end, sign in ((0.0, -1.0), (plate.length, 1.0)):
        point = plate.begin + end * plate.along
        high = gravity.any() and point @ -gravity >= level
        meets = (_meeting(plate, other, scene.dx) for other in others if other is not plate)
        # all fluid is before the place where the other one stands
        if not high and not any((sign * (along - at) < scene.dx).all() for at in meets):
            return False
    return True


def _meeting(plate: Plate, other: Plate, dx: float) -> float:
    """Return the place along a plate where another one meets it [m], nan if it doesn't."""
    across = other.along @ plate.normal
    if abs(across) < SQUARE:
        ends = other.begin + np.array([[0.0], [other.length]]) * other.along
        distance, along = plate.place(ends)
        beside = (np.abs(distance) < dx) & ((along < dx) | (along > plate.length - dx))
        return float(along[beside][0]) if beside.any() else math.nan
    on_other = -float(plate.place(other.begin)[0]) / across
    at = float(plate.place(other.begin + on_other * other.along)[1])
    touches = -dx < on_other < other.length + dx and -dx < at < plate.length + dx
    return at if touches else math.nan


def _sides(scene: Scene) -> list[Plate]:
    """Return the sides of the box that stand still and mirror the fluid."""
    walls = scene.walls
    places = None if walls is None else walls.mirrored_sides(scene.h)
    if walls is None or places is None:
        return []
    middle, far = np.repeat(np.asarray(scene.x)[0], 2), FAR * scene.h * np.array([-1, 1, -1, 1])
    box = np.array(walls.box, float)
    left, right, low, high = np.where(np.isfinite(box), box, middle + far).tolist()
    ends = (left, low, left, high), (right, low, right, high), (left, low, right, low)
    moving = () if walls.motion is None else walls.motion.sides
    named = zip(SIDES, places, (*ends, (left, high, right, high)), strict=True)
    return [_plate(*e) for name, at, e in named if math.isfinite(at) and name not in moving]


def _plate(x0: float, y0: float, x1: float, y1: float) -> Plate:
    length = math.hypot(x1 - x0, y1 - y0)
    return Plate(np.array([x0, y0]), np.array([x1 - x0, y1 - y0]) / length, length)


def _corners(one: Plate, other: Plate, dx: float) -> list[tuple[Floats, Floats, Floats]]:
    """Return corners of two plates: the point, and the inward normals of both walls."""
    if abs(one.along @ other.along) > SQUARE:
        return []
    # the foot of one plate's line on the other's
    _, on_one = one.place(other.begin)
    point = one.begin + on_one * one.along
    _, on_other = other.place(point)
    found = []
    for sign, other_sign in product((1.0, -1.0), repeat=2):
        # both walls must go on from the point
        length = on_one if sign < 0 else one.length - on_one
        other_length = on_other if other_sign < 0 else other.length - on_other
        meets = -dx < on_one < one.length + dx and -dx < on_other < other.length + dx
        if meets and min(length, other_length) > dx:
            found.append((point, other_sign * other.along, sign * one.along))
    return found


def make_mirror_plates(scene: Scene, number: Any) -> MirrorPlates | None:
    """Return the numbers of all plates that mirror the fluid and of their corners; None if none."""
    plates = mirroring_plates(scene)
    if not plates:
        return None
    rows = [(*plate.begin, *plate.normal, 0.0, plate.length, 0.0) for plate in plates]
    pairs = [*combinations(plates, 2), *product(plates, _sides(scene))]
    far = FAR * scene.h
    for one, other in pairs:
        for point, normal, along in _corners(one, other, scene.dx):
            # places along a plate are counted along (-ny, nx)
            if normal[0] * along[1] - normal[1] * along[0] < 0:
                normal = along
            rows.append((*point, *normal, -far, far, 1.0))
    columns = np.array(rows).T.astype(number)
    return MirrorPlates._make([*map(np.ascontiguousarray, columns), number(scene.h)])
