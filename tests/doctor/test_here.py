"""This solver through the doctor's door: no alarm in any of its kinds, wrong kernels found."""

import numpy as np
import pytest

from sph_gym import scenes
from sph_gym.doctor import check_solver
from sph_gym.doctor.case import DX, case, lattice
from sph_gym.doctor.foreign.shared import boundary
from sph_gym.doctor.here import here, of_scene, short_name
from sph_gym.solver.geometry import LAYERS
from sph_gym.studies.doctor import sound_solvers

KINDS = {name: (link, make) for name, link, make in sound_solvers() if name != "plain"}


def test_it_keeps_the_protocol():
    side = 6 * DX
    x = lattice(8, 8)
    one = case(x, (0.5, 0.0), gravity=(0.0, -9.81), box=(-side, side, -side, np.inf), xsph=0.3)
    solver = here()(one)
    np.testing.assert_array_equal(solver.x, x)
    for _ in range(100):
        solver.step(one.dt)
    solver.evaluate()
    assert solver.x.shape == solver.v.shape == solver.a.shape == (64, 2)
    assert solver.rho.shape == solver.p.shape == (64,)
    assert np.abs(solver.x[:, 0]).max() <= side
    assert solver.stiffness == pytest.approx(1000 * solver.c0**2 / 7)


def test_layers_stand_behind_the_closed_sides():
    one = case(lattice(4, 4), box=(-3 * DX, np.inf, -2 * DX, np.inf))
    tail = boundary(one, LAYERS)
    assert ((tail[:, 0] < -3 * DX) | (tail[:, 1] < -2 * DX)).all()
    assert tail[:, 0].min() == pytest.approx(-6.5 * DX)
    assert tail[:, 1].min() == pytest.approx(-5.5 * DX)
    assert tail[:, 0].max() > 20 * DX


def test_names_and_scenes():
    for wrong in ({"density": "sum"}, {"walls": "boxes"}, {"kernel": "cubic"}, {"dtype": "half"}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            here(**wrong)
    assert short_name("somebody:make") == "somebody:make"
    assert callable(short_name("brute"))
    with pytest.raises(ValueError, match="nowhere"):
        of_scene("nowhere")


@pytest.mark.slow
def test_it_is_sound():
    diagnosis = check_solver(here())
    assert diagnosis.ok, str(diagnosis)


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_each_kind(name):
    link, make = KINDS[name]
    diagnosis = check_solver(make())
    assert diagnosis.link == link, str(diagnosis)


@pytest.mark.slow
@pytest.mark.parametrize("name", scenes.names())
def test_the_settings_of_each_scene(name):
    diagnosis = check_solver(of_scene(name))
    assert diagnosis.ok, str(diagnosis)
