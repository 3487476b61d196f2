"""What a scene doesn't name is not there."""

import numpy as np
import pytest
from numba import typeof, types

from sph_gym import Effects
from tests.cases import assert_close, fluid, simulation

NAMED = {
    "artificial_viscosity": Effects(artificial_viscosity=0.1),
    "laminar_viscosity": Effects(laminar_viscosity=0.1),
    "xsph": Effects(xsph=True),
}


@pytest.mark.without_jit
@pytest.mark.parametrize("named", [None, *NAMED])
def test_what_is_not_named_is_none_to_the_compiler(named):
    model = simulation("none", effects=NAMED.get(named, Effects())).engine.model
    assert (model.gravity, model.box) == (None, None)
    for effects in (model.effects, model.wall_effects):
        for effect in NAMED:
            if effect != named:
                assert getattr(effects, effect) is None
                assert typeof(effects)[effects._fields.index(effect)] is types.none
    if named:
        assert getattr(model.effects, named) is not None


@pytest.mark.without_jit
def test_gravity_and_the_box_are_there_when_named():
    assert simulation("gravity").engine.model.gravity is not None
    assert simulation("box").engine.model.box is not None


def test_the_xsph_control_is_inert_without_xsph():
    sims = [simulation("laminar viscosity") for _ in range(2)]
    for k, sim in enumerate(sims):
        for strength in (0.0, 0.7, 3.0):
            sim.controls = sim.controls._replace(xsph=k * strength)
            sim.advance(3 * sim.controls.dt)
    for field in ("x", "v", "rho", "p", "a"):
        assert (getattr(sims[0], field) == getattr(sims[1], field)).all()


def test_xsph_moves_particles_but_does_not_touch_their_velocities():
    with_xsph, without = (simulation(name) for name in ("xsph", "none"))
    dt = with_xsph.controls.dt
    for sim in (with_xsph, without):
        sim.advance(dt)
    assert_close(with_xsph.v, without.v, 1e-13)
    assert np.abs(with_xsph.x - without.x).max() > 0.01 * dt


def test_xsph_of_strength_zero_is_none():
    sim, none = simulation("xsph"), simulation("none")
    sim.controls = sim.controls._replace(xsph=0.0)
    for each in (sim, none):
        each.advance(each.controls.dt)
    assert_close(sim.x, none.x, 1e-13)


@pytest.mark.parametrize("name", ["artificial_viscosity", "laminar_viscosity"])
def test_viscosity_zero_is_no_viscosity(name):
    zero, none = simulation("none", effects=Effects(**{name: 0.0})), simulation("none")
    assert_close(zero.a, none.a, 1e-13)


def test_artificial_viscosity_does_not_follow_the_stiffness():
    # rarefied, so that the clamp leaves no pressure at any stiffness
    x = 1.6 * np.asarray(simulation("none").scene.x)
    sim = simulation("artificial viscosity", x=x)
    assert not fluid(sim, "p").any()
    before = sim.a
    assert np.abs(before).max() > 1.0
    sim.controls = sim.controls._replace(stiffness=100 * sim.controls.stiffness)
    assert (sim.a == before).all()
