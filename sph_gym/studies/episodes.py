"""Whole episodes in a few numbers, kept on disk, and the best static setting in hindsight."""

import itertools
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sph_gym.env import actions
from sph_gym.env.oracle import ControlSetting, Step, play
from sph_gym.env.policies import Policy
from sph_gym.env.tuning import TuningEnv
from sph_gym.studies.results import Results

# A run is within tolerance if no more than this share of its steps is beyond it: even the fine
# references differ by more than their tolerance now and then.
BEYOND = 0.05
# Beyond this error the reward's penalty grows no more.
WORST_ERROR = 10.0


class Score(NamedTuple):
    """The numbers that are kept of an episode.

    substeps: all of them; reward: mean per planned step; error: mean of the largest error of each
    step, in multiples of its tolerance and at most WORST_ERROR; beyond: share of the planned
    steps with an error above 1, those after a blow-up included.
    """

    substeps: int
    reward: float
    error: float
    beyond: float
    blowup: bool

    @property
    def within(self) -> bool:
        """True if the episode kept within tolerance."""
        return self.beyond <= BEYOND


def results(folder: Path) -> Results:
    """Return the store of episodes below the folder of all studies, which share them."""
    return Results(folder / "episodes", "studies/episodes.py")


def constant(*action: float) -> Policy:
    """Return a policy that repeats one action."""
    held = np.array(action, np.float32)
    return lambda env, observation: held


def run(scene: str, instance: str, policy: Policy, seed: int = 0) -> Score:
    """Play a whole episode of a policy on an instance of an environment's scene."""
    env = TuningEnv(scene)
    env.reset(seed=seed, options={"instance": instance})
    found = follow(env, policy)
    assert found is not None
    return found


def follow(env: TuningEnv, policy: Policy, most_beyond: float = math.inf) -> Score | None:
    """Play the rest of an episode; None as soon as more than a share `most_beyond` is beyond."""
    steps, beyond = list[Step](), 0
    while not steps or not steps[-1].over:
        steps.append(play(env.episode, policy(env, None)))
        beyond += steps[-1].error > 1 or steps[-1].blowup
        if beyond > most_beyond * env.n_steps:
            return None
    lost = env.n_steps - len(steps)
    errors = np.minimum([step.error for step in steps], WORST_ERROR)
    return Score(
        substeps=sum(step.n_substeps for step in steps),
        reward=sum(step.reward for step in steps) / env.n_steps,
        error=float((errors.sum() + WORST_ERROR * lost) / env.n_steps),
        beyond=(beyond + lost) / env.n_steps,
        blowup=steps[-1].blowup,
    )


# --- Static settings ------------------------------------------------------------------------


class StaticGrid(NamedTuple):
    """Static settings that are tried: sound speeds in multiples of c0, epsilons, finest step."""

    sound: tuple[float, ...] = tuple(np.geomspace(0.1, 1.25, 18).tolist())
    xsph: tuple[float, ...] = (0.1, 0.3, 0.5, 0.7)
    substeps: int = 40


FULL = StaticGrid()


def best_static(
    scene: str, instance: str, grid: StaticGrid = FULL
) -> tuple[ControlSetting, Score] | None:
    """Return the static setting that is cheapest within tolerance, in hindsight; None if none is.

    The work of a static setting is known beforehand: so many substeps a step. The fewest are
    tried first, with every sound speed for which they make a Courant multiple of the action
    space, and every epsilon; of those within tolerance, the one with the largest reward.
    """
    env = TuningEnv(scene)
    env.reset(seed=0, options={"instance": instance})
    begin = env.episode.state()
    for n in range(1, grid.substeps + 1):
        found = []
        for setting in _settings(env, n, grid):
            env.episode.restore(begin)
            score = follow(env, constant(*setting), most_beyond=BEYOND)
            if score is not None and not score.blowup:
                found.append((setting, score))
        if found:
            return max(found, key=lambda pair: pair[1].reward)
    return None


def _settings(env: TuningEnv, n: int, grid: StaticGrid) -> list[ControlSetting]:
    """Return the settings that take n substeps a step."""
    scene, low, high = env.sim.scene, *actions.COURANT
    settings = []
    for sound, xsph in itertools.product(grid.sound, grid.xsph):
        # a hair more, so that rounding to float32 doesn't cost another substep
        courant = (1 + 1e-5) * scene.frame * sound * scene.fluid.c0 / (n * scene.h)
        if low <= courant <= high:
            settings.append(tuple(actions.locate(courant, sound, xsph).tolist()))
    return settings
