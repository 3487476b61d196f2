import numpy as np
import pytest

from sph_gym import Simulation
from sph_gym.scenes import lid_driven_cavity as cavity
from sph_gym.scenes.lid_driven_cavity import REFERENCE, TABLES, lid_driven_cavity
from sph_gym.scenes.shared.reference import read
from tests.scenes.planted import planted


def test_the_tables_are_those_of_an_incompressible_flow():
    # what flows to the right above the vortex flows back below it
    for table, ends in zip(TABLES, ((0.0, 1.0), (0.0, 0.0)), strict=True):
        place, value = read(table)[::-1].T
        place = np.concatenate([[0.0], place, [1.0]])
        value = np.concatenate([[ends[0]], value, [ends[1]]])
        assert len(place) == 17
        assert np.all(np.diff(place) > 0)
        assert abs(np.sum((value[1:] + value[:-1]) / 2 * np.diff(place))) < 0.01


def test_the_error_is_that_of_the_state():
    scene = lid_driven_cavity(dx=0.01, size=2.0, speed=0.5)
    u_table, v_table = (read(table)[::-1] for table in TABLES)
    x, y = np.asarray(scene.x).T / 2.0
    u = np.interp(y, [0, *u_table[:, 0], 1], [0, *u_table[:, 1], 1])
    v = np.interp(x, [0, *v_table[:, 0], 1], [0, *v_table[:, 1], 0])
    state = planted(scene, 0.5 * np.stack([u, v], axis=-1))
    assert cavity.error(state) < 0.02
    state.v[: state.n_fluid, 0] += 0.05
    assert cavity.error(state) == pytest.approx(0.1, abs=0.02)


def test_the_lid_moves_and_nothing_else():
    scene = lid_driven_cavity(dx=0.1, size=2.04, speed=3.0, reynolds=50.0)
    walls = scene.walls
    lid = np.asarray(walls.particles)[:, 1] > 2.0
    assert lid.sum() == 4 * 28
    assert np.array_equal(walls.velocities[lid], np.tile((3.0, 0.0), (lid.sum(), 1)))
    assert not walls.velocities[~lid].any()
    assert scene.effects.laminar_viscosity == pytest.approx(3.0 * 2.0 / 50.0)
    assert scene.duration == pytest.approx(100 * scene.frame)


@pytest.mark.parametrize("argument", ["dx", "size", "speed", "reynolds"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.inf])
def test_wrong_values_are_named(argument, value):
    with pytest.raises(ValueError, match=f"{argument}: expected"):
        lid_driven_cavity(**{argument: value})


def test_a_coarse_run_finds_the_vortex():
    run = REFERENCE.run(Simulation(lid_driven_cavity(dx=1 / 20), threads=1))
    mean, end, spread, outside = REFERENCE.judge(run)
    assert mean.bound is None
    assert mean.value < 0.13
    assert end.value < 0.16
    assert spread.value < 0.1
    assert outside.value == 0
    assert len(REFERENCE.chart(run).curves) == 4
