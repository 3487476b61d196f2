"""Lessons: observations of a learner's episodes, and the actions that a teacher answers with."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from agents.policies import play_network
from sph_gym.controllers import AdaptiveRule, Network, TunedCfl
from sph_gym.env.oracle import COARSE, FULL, Oracle
from sph_gym.env.policies import Policy, follow
from sph_gym.env.tuning import TuningEnv

# Digits of observations and actions that are kept.
DIGITS = 5


class Teacher(NamedTuple):
    """A policy that answers for the states that a learner visits.

    dear: it plans to the end of the episode, so that one plan has to answer for many states: it
    takes over from the learner in the middle of the episode, and answers from there on. Others
    answer for every state, and the learner plays the whole episode.
    """

    make: Callable[[], Policy]
    dear: bool


TEACHERS = {
    "oracle": Teacher(lambda: Oracle(FULL), dear=True),
    "coarse_oracle": Teacher(lambda: Oracle(COARSE), dear=True),
    "adaptive": Teacher(lambda: follow(AdaptiveRule()), dear=False),
    "tuned_cfl": Teacher(lambda: follow(TunedCfl()), dear=False),
}


class Lesson(NamedTuple):
    """An episode with a teacher.

    teacher: one of TEACHERS; learner: file of a network, None for an episode of the teacher's own;
    instance: what is played; seed: of the step at which a dear teacher takes over.
    """

    teacher: str
    learner: str | None
    instance: str
    seed: int


def take(teacher: str, learner: str | None, instance: str, seed: int) -> dict[str, Any]:
    """Play a lesson; return observations, actions of the teacher for them, and the mean return.

    Both are lists of lists, rounded, as JSON has them; the return counts per planned step.
    """
    guide, dear = TEACHERS[teacher].make(), TEACHERS[teacher].dear
    env = TuningEnv(instance.split("/")[0])
    observation, _ = env.reset(options={"instance": instance})
    pupil = None if learner is None else play_network(Network.load(learner))
    switch = int(np.random.default_rng(seed).integers(env.n_steps)) if dear else env.n_steps
    seen, answers, earned = [], [], 0.0
    while not env.episode.over:
        alone = pupil is not None and env.episode.step < switch
        answer = None if alone and dear else guide(env, observation)
        if answer is not None:
            seen.append(np.round(observation.astype(float), DIGITS).tolist())
            answers.append(np.round(np.asarray(answer, float), DIGITS).tolist())
        action = pupil(env, observation) if pupil is not None and alone else answer
        observation, reward, *_ = env.step(action)
        earned += float(reward)
    return {"observations": seen, "actions": answers, "return": earned / env.n_steps}
