"""Lessons: observations of a learner's episodes, and the actions that a teacher answers with."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from agents.policies import load_unchanged, play_network
from sph_gym.controllers import AdaptiveRule, TunedCfl
from sph_gym.env.oracle import COARSE, FULL, Oracle
from sph_gym.env.policies import Policy, follow
from sph_gym.env.tuning import TuningEnv


class Teacher(NamedTuple):
    """A policy that answers for the states that a learner visits.

    dear: it plans to the end of the episode, so that one plan has to answer for many states: it
    takes over at one of the states that the learner visited, and answers from there on. Others
    answer for every state of the learner's episode.
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
    weights: hash of the file; instance: what is played; seed: of the state at which a dear teacher
    takes over; action_mode: of the environment.
    """

    teacher: str
    learner: str | None
    weights: str | None
    instance: str
    seed: int
    action_mode: str


def take(lesson: Lesson) -> dict[str, Any]:
    """Play a lesson; return observations, and the actions that the teacher answers with.

    Both are lists of lists. Raises RuntimeError if the learner's network is another one by now.
    """
    guide, dear = TEACHERS[lesson.teacher].make(), TEACHERS[lesson.teacher].dear
    env = TuningEnv(lesson.instance.split("/")[0], action_mode=lesson.action_mode)
    observation, _ = env.reset(options={"instance": lesson.instance})
    pupil = None
    if lesson.learner is not None:
        pupil = play_network(load_unchanged(lesson.learner, lesson.weights))
    if pupil is not None and dear:
        observation, pupil = visit(env, pupil, observation, lesson.seed), None
    seen, answers = list[Any](), list[Any]()
    while not env.episode.over:
        answer = guide(env, observation)
        for kept, numbers in ((seen, observation), (answers, answer)):
            kept.append(rounded(numbers))
        observation, *_ = env.step(answer if pupil is None else pupil(env, observation))
    return {"observations": seen, "actions": answers}


def visit(env: TuningEnv, pupil: Policy, observation: Any, seed: int) -> Any:
    """Let a learner play an episode, and go back to one of the states that it visited.

    Returns the observation of that state. All of them have the same chance, also those that lead
    to a blow-up.
    """
    rng, episode, visited = np.random.default_rng(seed), env.episode, 0
    kept = episode.state()
    while not episode.over:
        visited += 1
        if rng.random() * visited < 1.0:
            kept = episode.state()
        observation, *_ = env.step(pupil(env, observation))
    episode.restore(kept)
    return episode.observe()


def rounded(numbers: Any) -> list[Any]:
    """Return numbers as lists, with the five digits behind the point that are kept."""
    lists: list[Any] = np.round(np.asarray(numbers, float), 5).tolist()
    return lists
