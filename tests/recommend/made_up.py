"""Made-up tables of the elliptical drop, and advice from them."""

from sph_gym import recommend
from sph_gym.recommend import advice
from sph_gym.recommend.series import MeasuredRun
from sph_gym.recommend.settings import nominal
from sph_gym.scenes.shared.refinement import refinement

DROP = refinement("elliptical_drop")
SPEED = 1e6


def offered(rows):
    """The series of a table that may be recommended."""
    return advice.offered(rows, advice.floor_of(rows))


def samples(factor=1.0, order=1.0, sizes=(10, 20, 40), **changes):
    """A line whose error goes as dx^order and whose effort as dx^-3."""
    return [
        MeasuredRun(
            DROP.scene, nominal(DROP, n)._replace(**changes), 0.2 * n**-order, factor * 100.0 * n**3
        )
        for n in sizes
    ]


def advise(table, **wanted):
    return recommend.advise(DROP.scene, table=table, speed=SPEED, **wanted)
