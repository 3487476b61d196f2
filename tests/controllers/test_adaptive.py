import numpy as np
import pytest

from sph_gym import Simulation, scenes
from sph_gym.controllers import AdaptiveRule, TunedCfl
from sph_gym.controllers.adaptive import (
    FORGOTTEN,
    LOUD,
    PRIOR_MOTION,
    PRIOR_NOISE,
    QUIET,
    SMOOTHING,
    no_memory,
    smoothing,
)


class Told:
    """Simulation whose mean squares of noise and motion are chosen by a test."""

    def __init__(self, sim, time, noise, motion):
        self._sim, self.time, self._told = sim, time, (noise, motion)

    def __getattr__(self, name):
        return getattr(self._sim, name)

    def diagnostics(self):
        noise, motion = self._told
        kinetic = 0.5 * motion * self._sim.mass * self._sim.n_fluid
        return self._sim.diagnostics() | {"velocity_noise": noise, "kinetic_energy": kinetic}


@pytest.fixture(scope="module")
def sim():
    return Simulation(scenes.make("dam_break", dx=0.08))


def test_the_rule_forgets_what_is_long_ago(sim):
    rule, rng = AdaptiveRule(), np.random.default_rng(0)
    scale = (sim.scene.fluid.c0 / 10) ** 2
    frames = rng.uniform(0.0, scale, (30, 2))
    sums = np.array([PRIOR_NOISE, PRIOR_MOTION]) * scale
    for k, frame in enumerate(frames):
        controls = rule(Told(sim, 0.1 * k, *frame))
        sums = (1 - FORGOTTEN) * sums + frame
        assert rule.memory == pytest.approx(sums)
        expected = smoothing(sums[0] / sums[1])
        assert controls == TunedCfl()(sim)._replace(xsph=pytest.approx(expected))


def test_calm_frames_tell_nothing(sim):
    rule = AdaptiveRule()
    scale = (sim.scene.fluid.c0 / 10) ** 2
    rule(Told(sim, 0.0, 0.1 * scale, scale))
    known = rule.memory.share
    for k in range(1, 200):
        rule(Told(sim, 0.1 * k, 0.0, 0.0))
    assert rule.memory.share == pytest.approx(known)


def test_the_rule_begins_anew_with_a_run(sim):
    rule = AdaptiveRule()
    for time in (0.0, 0.1, 0.2):
        rule(Told(sim, time, 5.0, 1.0))
    rule(Told(sim, 0.0, 0.0, 0.0))
    assert rule.memory.share == pytest.approx(no_memory(sim.scene).share)


def test_epsilon_rises_with_the_noise_within_its_range():
    shares = np.geomspace(1e-6, 1.0, 60)
    epsilons = [smoothing(share) for share in [0.0, *shares]]
    assert epsilons == sorted(epsilons)
    assert (epsilons[0], epsilons[-1]) == pytest.approx(SMOOTHING)
    assert smoothing(np.sqrt(QUIET * LOUD)) == pytest.approx(np.mean(SMOOTHING))
