import pytest

from sph_gym import Simulation, scenes
from sph_gym.controllers import ArticleCfl, Static, TunedCfl, nominal
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


def test_the_tuned_rule_follows_the_flow(sim):
    rule = TunedCfl(floor=0.01)
    c = sim.scene.fluid.sound_speed(rule(sim).stiffness)
    assert c == pytest.approx(8.0 * sim.max_speed)
    assert rule(sim).dt * c / sim.scene.h < 0.9


@pytest.mark.parametrize("scene", SCENES)
def test_the_tuned_rule_is_stable(scene):
    sim = Simulation(instance(scene, "nominal", 0, dx=0.05).build())
    while sim.time < 0.5 * sim.scene.duration:
        sim.controls = TunedCfl()(sim)
        assert not sim.advance(sim.scene.frame).diverged
