"""Tries: what actions earn from the states of an episode, each held for some steps.

All tries of a state begin in the same state, so no luck of the flow hides what an action does.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agents.lessons import rounded
from agents.policies import load_unchanged, play_network
from sph_gym.controllers import AdaptiveRule
from sph_gym.env.episode import Episode
from sph_gym.env.oracle import play
from sph_gym.env.policies import follow
from sph_gym.env.rewards import WORST
from sph_gym.env.tuning import TuningEnv
from sph_gym.solver.checks import finite_array, in_range, positive, whole

# Steps for which an action that was tried is followed; steps that must be left for a try.
FOLLOWED, FEWEST = 3, 4


class Tries(NamedTuple):
    """Actions that were tried from n states, k from each, and what they earned.

    observations: (n, entries); actions: (n, k, 3), the policy's own one first; values: (n, k) mean
    reward a step; blowups: (n, k), 1 where the fluid blew up, else 0.
    """

    observations: NDArray[np.float32]
    actions: NDArray[np.float32]
    values: NDArray[np.float32]
    blowups: NDArray[np.float32]


@dataclass(frozen=True)
class TrySettings:
    """Entries "tries" of hyperparams/rollout.yml, which says what each means.

    Raises ValueError for what is out of range.
    """

    share: float
    hold: int
    near: int
    anywhere: int
    spread: Sequence[float]
    lowest: Sequence[float]
    follow: float

    def __post_init__(self) -> None:
        positive("share", in_range("share", self.share, 0.0, 1.0))
        in_range("follow", self.follow, 0.0, 1.0)
        for name in ("hold", "near"):
            whole(name, getattr(self, name), at_least=1)
        whole("anywhere", self.anywhere)
        for value in finite_array("spread", self.spread, (3,)):
            positive("spread", value)
        for value in finite_array("lowest", self.lowest, (3,)):
            in_range("lowest", value, -1.0, 1.0)


class Exploration(NamedTuple):
    """An episode in which actions are tried.

    learner: file of the network that plays, None for the adaptive rule; weights: hash of the file;
    instance: what is played; seed: of what is tried, and where; action_mode: of the environment.
    """

    learner: str | None
    weights: str | None
    instance: str
    seed: int
    action_mode: str
    settings: TrySettings


def explore(job: Exploration) -> dict[str, Any]:
    """Play an `Exploration`; return `Tries` as rounded lists, as JSON has it.

    Raises RuntimeError if the network is another one by now.
    """
    # every flow has its own chances
    rng, settings = np.random.default_rng([job.seed, *job.instance.encode()]), job.settings
    env = TuningEnv(job.instance.split("/")[0], action_mode=job.action_mode)
    observation, _ = env.reset(options={"instance": job.instance})
    policy = (
        follow(AdaptiveRule())
        if job.learner is None
        else play_network(load_unchanged(job.learner, job.weights))
    )
    found: dict[str, list[Any]] = {name: [] for name in Tries._fields}
    followed: list[Any] = []
    while not env.episode.over:
        own = np.asarray(policy(env, observation), np.float32)
        left = env.episode.n_steps - env.episode.step
        if left >= FEWEST and rng.random() < settings.share:
            actions = candidates(own, settings, rng)
            outcomes = [worth(env.episode, each, settings.hold) for each in actions]
            row = (observation, actions, *zip(*outcomes, strict=True))
            for name, numbers in zip(Tries._fields, row, strict=True):
                found[name].append(rounded(numbers))
            if rng.random() < settings.follow:
                followed = [actions[1 + rng.integers(settings.near)]] * FOLLOWED
        observation, *_ = env.step(followed.pop() if followed else own)
    return found


def candidates(own: Any, settings: TrySettings, rng: np.random.Generator) -> NDArray[np.float32]:
    """Return the actions to try: the policy's own one, those around it, and any."""
    near = own + np.array(settings.spread) * rng.normal(size=(settings.near, 3))
    anywhere = rng.uniform(settings.lowest, 1.0, (settings.anywhere, 3))
    return np.clip([own, *near, *anywhere], -1.0, 1.0).astype(np.float32)


def worth(episode: Episode, action: Any, hold: int) -> tuple[float, bool]:
    """Return the mean reward a step of an action that is held, and if the fluid blew up.

    From a blow-up on, every step of the try earns the worst reward. The episode stays where it is.
    """
    start, earned, blown = episode.state(), 0.0, False
    planned = min(hold, episode.n_steps - episode.step)
    for number in range(planned):
        step = play(episode, action)
        if blown := step.blowup:
            earned -= WORST * (planned - number)
            break
        earned += step.reward
    episode.restore(start)
    return earned / planned, blown


def gather(episodes: Sequence[dict[str, Any]]) -> Tries:
    """Return what was tried in all episodes. Raises ValueError if nothing was."""
    columns = [[row for each in episodes for row in each[name]] for name in Tries._fields]
    if not columns[0]:
        raise ValueError("episodes: no state was tried, there have to be more of them")
    return Tries._make(np.array(column, np.float32) for column in columns)
