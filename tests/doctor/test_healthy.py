"""No false alarm: sound solvers that chose otherwise, one test each."""

import numpy as np
import pytest

from sph_gym.doctor import check_solver
from sph_gym.doctor.case import DX, case, lattice
from tests.doctor.healthy import HEALTHY

# As different as can be; the others are slow tests.
QUICK = ("Wendland_x_v", "Continuity", "KickDriftKick", "Layers", "Single")


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in HEALTHY],
)
def test_nothing_is_wrong_with_it(name):
    diagnosis = check_solver(HEALTHY[name])
    assert diagnosis.ok, str(diagnosis)
    assert sum(each.status == "pass" for each in diagnosis.results) > 5


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in HEALTHY if not name.endswith("_x_v")])
def test_it_is_sound_indeed(name):
    """A block that is thrown into a corner stays in its box, finite and not faster than it was."""
    side = 5 * DX
    one = case(lattice(8, 8), (1.0, -1.0), viscosity=0.01, box=(-side, side, -side, side))
    solver = HEALTHY[name](one)
    for _ in range(300):
        solver.step(one.dt)
    assert np.abs(solver.x).max() < side + DX
    assert 0.5 * (solver.v**2).sum(axis=1).mean() < 1.3
