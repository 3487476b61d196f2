"""A rule that finds out from the noise of a flow how much smoothing it needs."""

import math
from typing import NamedTuple

from sph_gym.controllers.rules import TunedCfl
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.state import Controls

# Shares of noise at which the adaptive rule takes the smallest and the largest epsilon, and these.
QUIET, LOUD = 0.005, 0.014
SMOOTHING = (0.1, 0.7)
# A memory begins with these mean squares of noise and velocity [(c0 / 10)^2], which says that
# nothing is known yet, and of all that it has it forgets such a share a call.
PRIOR_NOISE, PRIOR_MOTION = 0.01, 0.5
FORGOTTEN = 1 / 40


class NoiseMemory(NamedTuple):
    """Sums over the past of the mean squared velocity noise and velocity [m^2/s^2], fading.

    Noise is a share of the motion that went with it: calm frames add nothing to either sum, so that
    a fluid that falls freely for long is still known when it hits something.
    """

    noise: float
    motion: float

    @property
    def share(self) -> float:
        """Noise as a share of the motion."""
        return self.noise / self.motion

    def after(self, noise: float, motion: float) -> "NoiseMemory":
        """Return the memory after one more frame, with its mean squares [m^2/s^2]."""
        kept = 1.0 - FORGOTTEN
        return NoiseMemory(kept * self.noise + noise, kept * self.motion + motion)


def no_memory(scene: Scene) -> NoiseMemory:
    """Return the memory at the start of a run."""
    scale = (scene.fluid.c0 / 10) ** 2
    return NoiseMemory(PRIOR_NOISE * scale, PRIOR_MOTION * scale)


def smoothing(share: float) -> float:
    """Return the epsilon for a share of noise, on a log scale from QUIET to LOUD."""
    place = math.log(max(share, QUIET) / QUIET) / math.log(LOUD / QUIET)
    low, high = SMOOTHING
    return low + (high - low) * min(place, 1.0)


class AdaptiveRule:
    """The tuned rule with an epsilon that follows the noise: much where the fluid is a gas.

    It is to be called once a frame, remembers a run, and begins anew at time 0.
    """

    def __init__(self) -> None:
        self.rule = TunedCfl()
        self.memory = NoiseMemory(0.0, 1.0)

    def __call__(self, sim: Simulation) -> Controls:
        """Return the controls for the present state."""
        numbers = sim.diagnostics()
        if sim.time == 0.0:
            self.memory = no_memory(sim.scene)
        motion = 2 * numbers["kinetic_energy"] / (sim.mass * sim.n_fluid)
        self.memory = self.memory.after(numbers["velocity_noise"], motion)
        return self.rule.at(sim, numbers)._replace(xsph=smoothing(self.memory.share))
