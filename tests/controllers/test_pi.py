import math

import pytest

from sph_gym import Simulation, scenes
from sph_gym.controllers import PiController, TunedCfl
from sph_gym.controllers.pi import MEAN, P99


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


def factor(sim, controls):
    """Return the sound speed as a multiple of that of the tuned rule."""
    fluid = sim.scene.fluid
    return fluid.sound_speed(controls.stiffness) / fluid.sound_speed(TunedCfl()(sim).stiffness)


def test_at_the_setpoint_it_is_the_tuned_rule(sim):
    pi = PiController()
    for k in range(3):
        assert pi(Told(sim, 0.1 * k, pi.setpoint * MEAN)) == pytest.approx(TunedCfl()(sim))


def test_it_stiffens_a_compressed_fluid_and_softens_a_calm_one(sim):
    pi = PiController(setpoint=0.5, proportional=0.2, integral=0.1)
    pi(Told(sim, 0.0, 0.5 * MEAN))
    # twice the setpoint: both parts act
    expected = math.exp(0.3 * math.log(2))
    assert factor(sim, pi(Told(sim, 0.1, MEAN))) == pytest.approx(expected)
    # half the setpoint, by the other measure
    expected *= math.exp(0.2 * math.log(1 / 4) + 0.1 * math.log(1 / 2))
    assert factor(sim, pi(Told(sim, 0.2, 0.0, 0.25 * P99))) == pytest.approx(expected)


def test_the_correction_has_ends_and_a_new_run_begins_anew(sim):
    pi = PiController()
    for error, end in ((0.4 * pi.setpoint * MEAN, pi.least), (1.0, pi.most)):
        for k in range(1, 40):
            controls = pi(Told(sim, 0.1 * k, error))
        assert factor(sim, controls) == pytest.approx(end)
    assert factor(sim, pi(Told(sim, 0.0, pi.setpoint * MEAN))) == pytest.approx(1.0)


def test_no_error_tells_nothing(sim):
    pi = PiController()
    before = factor(sim, pi(Told(sim, 0.0, 2 * pi.setpoint * MEAN)))
    for k in range(1, 30):
        controls = pi(Told(sim, 0.1 * k, 0.0))
    assert factor(sim, controls) == pytest.approx(before) != 1.0
