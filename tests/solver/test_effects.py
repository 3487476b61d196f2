"""What a scene doesn't name is not there."""

from dataclasses import replace

import numpy as np
import pytest
from numba import typeof, types

from sph_gym import (
    Effects,
    Fluid,
    Scene,
    Simulation,
    Walls,
    disc,
    lattice,
    sound_speed,
    tank_particles,
)
from sph_gym.studies.stability.bodies import CELL, wide
from tests.cases import (
    CHANNEL,
    DX,
    MOVING,
    PAIRS,
    PISTON,
    WALLS,
    assert_close,
    fluid,
    simulation,
    uncompiled,
)

NAMED = {
    "artificial_viscosity": Effects(artificial_viscosity=0.1),
    "quadratic_viscosity": Effects(quadratic_viscosity=0.1),
    "laminar_viscosity": Effects(laminar_viscosity=0.1),
    "surface_tension": Effects(surface_tension=0.1),
    "tensile_correction": Effects(tensile_correction=0.2),
    "xsph": Effects(xsph=True),
    "shifting": Effects(shifting=2.0),
    "continuity": Effects(continuity=True),
    "density_diffusion": Effects(continuity=True, density_diffusion=0.1),
}
# What another effect needs.
WITH = {"density_diffusion": "continuity"}
# Columns that all particles have.
PLAIN = {"x", "y", "u", "v", "rho", "stress", "id"}


@uncompiled
@pytest.mark.parametrize("named", [None, *NAMED])
def test_what_is_not_named_is_none_to_the_compiler(named):
    model = simulation("none", effects=NAMED.get(named, Effects())).engine.model
    parts = ("gravity", "box", "plates", "unbacked_walls", "extrapolation", "stroke")
    assert [getattr(model, part) for part in parts] == [None] * 6
    assert (model.constants.period_x, model.constants.period_y) == (None, None)
    for effects in (model.effects, model.wall_effects):
        for effect in NAMED:
            if effect not in (named, WITH.get(named)):
                assert getattr(effects, effect) is None
                assert typeof(effects)[effects._fields.index(effect)] is types.none
    if named:
        assert getattr(model.effects, named) is not None


@pytest.mark.without_jit
def test_gravity_and_the_box_are_there_when_named():
    assert simulation("open space").engine.model.gravity is not None
    assert simulation("everything").engine.model.box is not None


@uncompiled
def test_columns_are_there_for_what_needs_them():
    def columns(configuration, **parts):
        engine = simulation(configuration, **parts).engine
        kept = {name for name, a in engine.fluid._asdict().items() if a is not None}
        walls = {} if engine.walls is None else engine.walls._asdict()
        return kept - PLAIN, {name for name, a in walls.items() if a is not None} - PLAIN

    rates, drift = {"ax", "ay"}, {"tx", "ty"}
    assert columns("none") == (set(), set())
    assert columns("everything") == (set(), set())
    mirrors = replace(WALLS, pressure="extrapolated")
    assert columns("everything", walls=mirrors) == (set(), {"ghost_u", "ghost_v"})
    slippery = replace(mirrors, slip="free-slip")
    corrected = {"integrator": "predictor_corrector"}
    assert columns("everything", walls=slippery, **corrected) == (rates | drift, set())
    moving = Walls(CHANNEL, motion=PISTON, box=MOVING.box)
    kicked = {"integrator": "kick_drift_kick"}
    assert columns("everything", walls=moving, **kicked) == (rates | drift, {"ax", "ay"})
    surface, continuity = {"nx", "ny"}, {"offset"}
    assert columns("all, euler") == (
        surface | continuity, {"ghost_u", "ghost_v", "ax", "ay"},
    )  # fmt: skip
    assert columns("all, kick")[0] == rates | drift | surface | continuity | {"growth"}


@uncompiled
@pytest.mark.parametrize("slip", ["no-slip", "free-slip"])
@pytest.mark.parametrize("pressure", ["like fluid", "extrapolated"])
def test_walls_take_part_in_what_they_should(pressure, slip):
    named = replace(PAIRS, continuity=pressure == "extrapolated")
    walls = replace(WALLS, pressure=pressure, slip=slip)
    model = simulation("none", effects=named, walls=walls).engine.model
    without = {"xsph", "density_diffusion"}
    if slip == "free-slip":
        without |= {"artificial_viscosity", "quadratic_viscosity", "laminar_viscosity"}
    for name, of_fluid in model.effects._asdict().items():
        of_walls = getattr(model.wall_effects, name)
        if name == "shifting":
            # walls are no free surface
            of_fluid = of_fluid._replace(inv_range=0.0)
        if name == "surface_tension":
            # the layer under tension rubs against walls, which do not pull it
            of_fluid = of_fluid._replace(strength=0.0)
        assert of_walls is None if name in without else of_walls == of_fluid


def test_the_xsph_control_is_inert_without_xsph():
    sims = [simulation("none") for _ in range(2)]
    for k, sim in enumerate(sims):
        for strength in (0.0, 0.7, 3.0):
            sim.controls = sim.controls._replace(xsph=k * strength)
            sim.advance(3 * sim.controls.dt)
    for field in ("x", "v", "rho", "p", "a"):
        assert (getattr(sims[0], field) == getattr(sims[1], field)).all()


@uncompiled
def test_xsph_moves_particles_but_does_not_touch_their_velocities():
    with_xsph, without = simulation("none", effects=NAMED["xsph"]), simulation("none")
    dt = with_xsph.controls.dt
    for sim in (with_xsph, without):
        sim.advance(dt)
    assert_close(with_xsph.v, without.v, 1e-13)
    assert np.abs(with_xsph.x - without.x).max() > 0.01 * dt


@uncompiled
def test_xsph_of_strength_zero_is_none():
    sim, none = simulation("none", effects=NAMED["xsph"]), simulation("none")
    sim.controls = sim.controls._replace(xsph=0.0)
    for each in (sim, none):
        each.advance(each.controls.dt)
    assert_close(sim.x, none.x, 1e-13)


@uncompiled
@pytest.mark.parametrize("name", ["artificial_viscosity", "laminar_viscosity"])
def test_viscosity_zero_is_no_viscosity(name):
    zero, none = simulation("none", effects=Effects(**{name: 0.0})), simulation("none")
    assert_close(zero.a, none.a, 1e-13)


@uncompiled
def test_artificial_viscosity_does_not_follow_the_stiffness():
    # rarefied, so that the clamp leaves no pressure at any stiffness
    x = 1.6 * np.asarray(simulation("none").scene.x)
    sim = simulation("none", x=x, effects=NAMED["artificial_viscosity"])
    assert not fluid(sim, "p").any()
    before = sim.a
    assert np.abs(before).max() > 1.0
    sim.controls = sim.controls._replace(stiffness=100 * sim.controls.stiffness)
    assert (sim.a == before).all()


# --- Shifting at free surfaces --------------------------------------------------------------


def test_a_drop_that_is_shifted_stays_a_drop():
    middle, radius = CELL * DX / 2, 5 * DX
    x = disc(middle, middle, radius, DX)
    sim = Simulation(replace(wide(DX, 3.5, shifting=2.0), x=x, v=None))
    sim.advance(0.5)
    assert np.hypot(*(sim.x - middle).T).max() < 1.1 * radius
    assert np.abs(sim.x.mean(axis=0) - middle).max() < 0.1 * DX
    assert sim.max_speed < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("strength", [0.5, 2.0])
@pytest.mark.parametrize(("kernel", "ratio"), [("quintic_spline", 2.8), ("wendland_c2", 3.0)])
def test_a_tank_at_rest_keeps_its_level_when_it_is_shifted(kernel, ratio, strength):
    dx, width, depth = 0.02, 0.4, 0.3
    effects = Effects((0, -9.81), xsph=True, artificial_viscosity=0.1, shifting=strength)
    particles = tank_particles(width, 2 * depth, dx)
    walls = Walls(particles, box=(0, width, 0, np.inf), pressure="extrapolated")
    x = lattice(0, width, 0, depth, dx)
    water = Fluid(c0=sound_speed(2.5), kernel=kernel)
    sim = Simulation(Scene("tank", x, dx, ratio * dx, water, effects=effects, walls=walls))
    at_stake = 1000 * width * depth * 9.81 * depth
    for _ in range(10):
        assert not sim.advance(0.3).diverged
        # the first waves throw single particles up by two spacings
        assert sim.x[: sim.n_fluid, 1].max() < depth + 2 * dx
    assert sim.x[: sim.n_fluid, 1].max() < 1.05 * depth
    assert sim.diagnostics()["com_y"] == pytest.approx(depth / 2, rel=0.03)
    assert sim.energy_surplus < 0.02 * at_stake
    assert sim.diagnostics()["kinetic_energy"] < 2e-3 * at_stake
