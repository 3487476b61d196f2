import math

import pytest

from sph_gym import Simulation, scenes
from sph_gym.controllers import PiController, TunedCfl
from sph_gym.controllers.pi import MEAN, P99, SOUND


class Told:
    """Simulation whose time and density errors are chosen by a test."""

    def __init__(self, sim, time, mean, p99=0.0):
        self._sim, self.time, self._told = sim, time, (mean, p99)

    def __getattr__(self, name):
        return getattr(self._sim, name)

    def diagnostics(self):
        mean, p99 = self._told
        return self._sim.diagnostics() | {"density_error": mean, "density_error_p99": p99}


@pytest.fixture(scope="module")
def sim():
    return Simulation(scenes.make("dam_break", dx=0.08))


def sound(sim, controls):
    return sim.scene.fluid.sound_speed(controls.stiffness) / sim.scene.fluid.c0


def test_it_stiffens_a_compressed_fluid_and_softens_a_calm_one(sim):
    pi = PiController(setpoint=0.5, proportional=0.2, integral=0.1)
    at_setpoint = pi(Told(sim, 0.0, 0.5 * MEAN))
    assert sound(sim, at_setpoint) == pytest.approx(1.0)
    # twice the setpoint: both parts act
    expected = math.exp(0.3 * math.log(2))
    assert sound(sim, pi(Told(sim, 0.1, MEAN))) == pytest.approx(min(expected, SOUND[1]))
    # half the setpoint by the other measure
    expected *= math.exp(0.2 * math.log(1 / 4) + 0.1 * math.log(1 / 2))
    assert sound(sim, pi(Told(sim, 0.2, 0.0, 0.25 * P99))) == pytest.approx(expected)


def test_the_sound_speed_stays_in_its_range_and_a_new_run_begins_anew(sim):
    pi = PiController()
    for error, end in ((0.0, SOUND[0]), (1.0, SOUND[1])):
        for k in range(1, 30):
            controls = pi(Told(sim, 0.1 * k, error))
        assert sound(sim, controls) == pytest.approx(end)
    assert sound(sim, pi(Told(sim, 0.0, 0.5 * MEAN))) == pytest.approx(1.0)


def test_step_and_epsilon_are_those_of_the_tuned_rule_at_that_sound_speed(sim):
    controls = PiController()(Told(sim, 0.0, 0.5 * MEAN))
    rule = TunedCfl(mach=0.0, fastest=0.0, floor=1.0)
    assert controls == pytest.approx(rule(sim))
