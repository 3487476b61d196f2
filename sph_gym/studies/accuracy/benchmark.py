"""How fast this machine is at the moment: a small dam break, which all times are compared with."""

from functools import cache

import numpy as np

from sph_gym import scenes
from sph_gym.studies.timing import Runner, own_clock

# Fluid particles of the dam break, and particle-steps of one timed call.
SIZE, WORK = 1000, 200_000
# Seconds that a measurement takes: a careful one, and one beside a run of the study.
CAREFUL, BRIEF = 2.0, 0.05


@cache
def _runner() -> Runner:
    scene = scenes.make("dam_break", dx=(2.0 / SIZE) ** 0.5, width=1.0, height=2.0, tank=4.0)
    runner = Runner(scene, work=WORK)
    runner.home = runner.sim.engine.state()
    return runner


def rate(seconds: float = BRIEF) -> float:
    """Particle-steps per second of the processor time of one pinned thread.

    The median of calls for so many seconds.
    """
    runner, clock, steps = _runner(), own_clock(), list[float]()
    while not steps or sum(steps) * runner.n_steps < seconds:
        steps.append(runner.seconds(clock))
    return runner.sim.n_particles / float(np.median(steps))
