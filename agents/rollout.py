"""Policy iteration by rollouts: `python -m agents.rollout --scene benchmark`.

From states that the policy visits, many actions are tried on the running solver, each held for some
steps. Networks learn what an action earns in a state, from what is observed there, and the policy
becomes the one that earns most by them. Then it plays again, and all that was tried so far counts.
A try is a fair comparison: all actions begin in the same state, so no luck of the flow hides what
an action does. Tries are kept on disk and not repeated.
Source: Lagoudakis and Parr 2003, reinforcement learning as classification.
"""

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from agents import cards
from agents.arguments import SCENE_HELP, BackendArgs, launch, option, program
from agents.exports import plain_network
from agents.imitation import descend, perceptron
from agents.policies import play_network
from agents.training import hyperparameters
from agents.validation import RETURN, Validation, training_ids, validation_ids
from sph_gym.controllers import AdaptiveRule, Network
from sph_gym.env.episode import Episode
from sph_gym.env.oracle import play
from sph_gym.env.policies import follow
from sph_gym.env.rewards import WORST
from sph_gym.env.tuning import TuningEnv
from sph_gym.provenance import content_hash
from sph_gym.solver.checks import known, whole
from sph_gym.studies.jobs import run_jobs
from sph_gym.studies.results import Results

# Digits of what is kept.
DIGITS = 5
# Steps for which an action that was tried is followed; fewest steps that a try may have.
FOLLOWED, FEWEST = 3, 4
# Noise of the actions while the policy is learned, so that it stays clear of cliffs.
JITTER = 0.03


@dataclass
class RolloutArgs(BackendArgs):
    """Arguments of a training by rollouts; hyperparams/rollout.yml has the others."""

    scene: str = option(SCENE_HELP, "dam_break")
    rounds: int = option("rounds; in the first one the adaptive rule plays", 4)
    episodes: int = option("episodes of a round, on training instances of each scene", 16)
    seed: int = option("seed of everything", 0)
    output: Path = option("folder of tries and networks; tries are kept", Path("runs"))
    n_evaluations: int = option("validation episodes on each scene, after every round", 16)
    ship: bool = option("also put the best network into the package, with a card", False)

    def __post_init__(self) -> None:
        whole("rounds", self.rounds, at_least=1)
        whole("episodes", self.episodes, at_least=1)
        whole("seed", self.seed)
        validation_ids(self.scene, self.n_evaluations)
        # an action of the other kinds means something else in every state
        known("action_mode", self.settings["action_mode"], ("absolute", "stable"))

    @property
    def folder(self) -> Path:
        """Folder of everything but the tries."""
        return self.output / f"rollout_{self.scene}_seed{self.seed}"

    @cached_property
    def settings(self) -> dict[str, Any]:
        """Hyperparameters, read once."""
        return hyperparameters("rollout", self.scene)


class Tries(NamedTuple):
    """Actions that were tried from n states, k from each, and what they earned.

    observations: (n, entries); actions: (n, k, 3), the policy's own one first; values: (n, k) mean
    reward a step.
    """

    observations: NDArray[np.float32]
    actions: NDArray[np.float32]
    values: NDArray[np.float32]


def train(args: RolloutArgs) -> None:
    """Learn round by round; keep the network that is best in validation.

    Ctrl-C ends it, and the next call goes on with the tries that are there.
    """
    torch.set_num_threads(1)
    began, ids = time.monotonic(), validation_ids(args.scene, args.n_evaluations)
    validation = Validation(ids, args.folder, args.settings["action_mode"])
    episodes, learner = list[dict[str, Any]](), None
    for number in range(args.rounds):
        episodes += visit(args, number, learner)
        tries = gather(episodes)
        values = [fit_value(args, tries, k) for k in range(args.settings["value"]["n"])]
        network = fit_policy(args, tries, values)
        validation.judge(network, tries.values.size)
        learner = args.folder / f"round{number}.npz"
        network.save(learner)
        earned = validation.curve[-1][RETURN]
        print(f"round {number}: {tries.values.size} tries, mean return {earned:.3f}")
    print(f"policy: {validation.network}")
    if args.ship:
        target = cards.ship(
            validation.network, "rollout", args.scene,
            how=f"{args.rounds} rounds of {args.episodes} episodes on each scene, with the "
            f"hyperparameters {args.settings}; kept is the network that was best on {len(ids)} "
            "validation flows.",
            command=" ".join([program(), *sys.argv[1:]]), seed=args.seed,
            minutes=round((time.monotonic() - began) / 60),
        )  # fmt: skip
        print(f"shipped: {target}")


# --- tries ----------------------------------------------------------------------------------


def visit(args: RolloutArgs, number: int, learner: Path | None) -> list[dict[str, Any]]:
    """Return what was tried in the episodes of a round; those that are kept are not played again.

    learner: network that plays, None for the adaptive rule.
    """
    count = args.episodes
    path = None if learner is None else str(learner)
    mode, how = args.settings["action_mode"], args.settings["tries"]
    # every round has other instances, until all have been played
    first = (args.seed * args.rounds + number) * count
    jobs = [
        (path, instance, args.seed + k, mode, how)
        for k, instance in training_ids(args.scene, first, count)
    ]
    # a network counts by its content
    weights = None if learner is None else content_hash(learner)
    code = content_hash(Path(__file__))
    keys = [[weights, *job[1:], code] for job in jobs]
    store = Results(args.output / "rollouts")
    return run_jobs(explore, jobs, keys, store, f"tries, round {number}", args.where())


def explore(
    learner: str | None, instance: str, seed: int, action_mode: str, how: dict[str, Any]
) -> dict[str, Any]:
    """Play an episode and try actions on the way; return `Tries` as rounded lists, as JSON has it.

    how: the hyperparameters "tries".
    """
    rng = np.random.default_rng(seed)
    env = TuningEnv(instance.split("/")[0], action_mode=action_mode)
    observation, _ = env.reset(options={"instance": instance})
    policy = follow(AdaptiveRule()) if learner is None else play_network(Network.load(learner))
    found: dict[str, list[Any]] = {name: [] for name in Tries._fields}
    followed: list[Any] = []
    while not env.episode.over:
        own = np.asarray(policy(env, observation), np.float32)
        left = env.episode.n_steps - env.episode.step
        if left >= FEWEST and rng.random() < how["share"]:
            actions = candidates(own, how, rng)
            values = [worth(env.episode, action, how["hold"], how["lost"]) for action in actions]
            for name, numbers in zip(Tries._fields, (observation, actions, values), strict=True):
                found[name].append(np.round(np.asarray(numbers, float), DIGITS).tolist())
            if rng.random() < how["follow"]:
                followed = [actions[1 + rng.integers(how["near"])]] * FOLLOWED
        observation, *_ = env.step(followed.pop() if followed else own)
    return found


def candidates(own: Any, how: dict[str, Any], rng: np.random.Generator) -> NDArray[np.float32]:
    """Return the actions to try: the policy's own one, those around it, and any."""
    near = own + np.array(how["spread"]) * rng.normal(size=(how["near"], 3))
    anywhere = rng.uniform(how["lowest"], 1.0, (how["anywhere"], 3))
    return np.clip([own, *near, *anywhere], -1.0, 1.0).astype(np.float32)


def worth(episode: Episode, action: Any, hold: int, lost: int) -> float:
    """Return the mean reward a step of an action that is held; the episode stays where it is.

    A blow-up earns the worst reward in all steps that the try should have had, and in so many more.
    """
    start, left, earned = episode.state(), episode.n_steps - episode.step, 0.0
    planned = min(hold, left)
    for number in range(planned):
        step = play(episode, action)
        if step.blowup:
            earned -= WORST * (planned - number + min(lost, left - planned))
            break
        earned += step.reward
    episode.restore(start)
    return earned / planned


def gather(episodes: Sequence[dict[str, Any]]) -> Tries:
    """Return what was tried in all episodes. Raises ValueError if nothing was."""
    columns = [[row for each in episodes for row in each[name]] for name in Tries._fields]
    if not columns[0]:
        raise ValueError("episodes: no state was tried, there have to be more of them")
    return Tries._make(np.array(column, np.float32) for column in columns)


# --- networks -------------------------------------------------------------------------------


def fit_value(args: RolloutArgs, tries: Tries, number: int) -> torch.nn.Module:
    """Return a network that has learned what an action earns; number: of several."""
    settings, count = args.settings["value"], tries.actions.shape[1]
    torch.manual_seed(1000 * args.seed + number)
    observations, actions, values = map(torch.as_tensor, tries)
    inputs = torch.cat([observations.repeat_interleave(count, 0), actions.flatten(0, 1)], 1)
    wanted = values.flatten()
    module = perceptron(inputs.shape[1], settings["net_arch"], 1, torch.nn.SiLU)
    descent = torch.optim.AdamW(module.parameters(), settings["learning_rate"], weight_decay=1e-3)
    steps, rate = settings["gradient_steps"], settings["learning_rate"]
    schedule = torch.optim.lr_scheduler.OneCycleLR(descent, rate, total_steps=steps)

    def loss() -> torch.Tensor:
        batch = torch.randint(len(inputs), (settings["batch_size"],))
        return (module(inputs[batch])[:, 0] - wanted[batch]).square().mean()

    descend(loss, descent, schedule, steps)
    return module.requires_grad_(False)


def fit_policy(args: RolloutArgs, tries: Tries, values: Sequence[torch.nn.Module]) -> Network:
    """Return a new policy whose actions earn most by what the values say, less their doubt."""
    settings, doubt = args.settings["policy"], args.settings["doubt"]
    torch.manual_seed(args.seed)
    observations = torch.as_tensor(tries.observations)
    module = perceptron(observations.shape[1], settings["net_arch"], 3)
    steps = settings["gradient_steps"]
    descent = torch.optim.Adam(module.parameters(), settings["learning_rate"])
    decay = torch.optim.lr_scheduler.LinearLR(descent, 1.0, 0.01, total_iters=steps)

    def loss() -> torch.Tensor:
        seen = observations[torch.randint(len(observations), (settings["batch_size"],))]
        wished = module(seen)
        actions = wished.clamp(-1.0, 1.0)
        inputs = torch.cat([seen, actions + JITTER * torch.randn_like(actions)], 1)
        worths = torch.stack([value(inputs)[:, 0] for value in values])
        earned = worths.mean(0) - doubt * worths.std(0, correction=0)
        # without the second term, what is beyond the bounds would never come back
        return 0.1 * (wished - actions).square().mean() - earned.mean()

    descend(loss, descent, decay, steps)
    return plain_network(module, "clip", args.settings["action_mode"])


if __name__ == "__main__":
    launch(train, RolloutArgs, __doc__)
