from dataclasses import replace

import numpy as np
import pytest

from sph_gym import Simulation, scenes
from sph_gym.controllers import ArticleCfl, PiController, Static, TunedCfl, nominal
from sph_gym.controllers.rules import XSPH_RANGE
from sph_gym.env import SCENES
from sph_gym.env.instances import instance


@pytest.fixture(scope="module")
def sim():
    made = Simulation(scenes.make("dam_break", dx=0.08))
    made.advance(0.1)
    return made


def test_nominal_keeps_the_constants(sim):
    assert nominal(sim) == sim.nominal_controls


def test_the_article_takes_the_stable_step_at_nominal_stiffness(sim):
    sim.controls = sim.controls._replace(stiffness=1e3)
    controls = ArticleCfl()(sim)
    sim.controls = controls
    assert controls.stiffness == sim.nominal_controls.stiffness
    assert controls.dt == pytest.approx(sim.stable_dt())


def test_static_settings_mean_what_they_say(sim):
    controls = Static(courant=0.8, sound=0.5, xsph=0.2)(sim)
    c = sim.scene.fluid.sound_speed(controls.stiffness)
    assert c == pytest.approx(0.5 * sim.scene.fluid.c0)
    assert controls.dt * c / sim.scene.h == pytest.approx(0.8)
    assert controls.xsph == 0.2


def sound(sim, rule):
    """The sound speed that a rule chooses."""
    return sim.scene.fluid.sound_speed(rule(sim).stiffness)


def test_the_tuned_rule_follows_the_flow(sim):
    numbers, c0 = sim.diagnostics(), sim.scene.fluid.c0
    assert sound(sim, TunedCfl(fastest=0.0, floor=0.0)) == pytest.approx(
        8.0 * numbers["flow_speed"]
    )
    assert sound(sim, TunedCfl(mach=0.0, floor=0.0)) == pytest.approx(5.0 * sim.max_speed)
    assert sound(sim, TunedCfl(mach=0.0, fastest=0.0)) == pytest.approx(0.42 * c0)
    limits = (8.0 * numbers["flow_speed"], 5.0 * sim.max_speed, 0.42 * c0)
    assert sound(sim, TunedCfl()) == pytest.approx(max(limits))
    assert TunedCfl()(sim).dt * sound(sim, TunedCfl()) / sim.scene.h < TunedCfl().courant


def test_a_single_fast_particle_counts_less_than_a_fast_flow():
    scene = scenes.make("patch_impact", dx=0.1)
    fast = np.array(scene.v)
    fast[0] *= 2
    one, all_ = (Simulation(replace(scene, v=v)) for v in (fast, 2 * np.asarray(scene.v)))
    rule = TunedCfl(floor=0.0)
    assert sound(Simulation(scene), rule) <= sound(one, rule) < sound(all_, rule)


@pytest.mark.parametrize(
    ("alpha", "epsilon"),
    [(0.02, 0.45), (0.002, 0.6), (0.2, 0.15), (1e-9, 0.6), (0.0, 0.6), (100.0, 0.1)],
)
def test_epsilon_makes_up_for_a_lack_of_viscosity(alpha, epsilon):
    assert TunedCfl().smoothing(alpha) == pytest.approx(epsilon)
    assert XSPH_RANGE[0] <= epsilon <= XSPH_RANGE[1]


# An instance of each kind of context: noisy, damped, plain.
@pytest.mark.parametrize("number", [0, 1, 8])
@pytest.mark.parametrize("scene", SCENES)
def test_the_tuned_rule_is_stable(scene, number):
    sim = Simulation(instance(scene, "val", number, dx=0.05).build())
    while sim.time < 0.5 * sim.scene.duration:
        sim.controls = TunedCfl()(sim)
        assert not sim.advance(sim.scene.frame).diverged


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Static(0.0, 1.0, 0.3), "courant: "),
        (lambda: Static(0.75, "a", 0.3), "sound: "),
        (lambda: Static(0.75, 1.0, -0.1), "xsph: "),
        (lambda: TunedCfl(courant=0.0), "courant: "),
        (lambda: TunedCfl(floor=-0.1), "floor: "),
        (lambda: TunedCfl(mach=-1.0), "mach: "),
        (lambda: PiController(setpoint=0.0), "setpoint: "),
    ],
)
def test_constants_that_no_rule_can_have_are_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()
