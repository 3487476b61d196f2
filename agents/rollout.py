"""Policy iteration by rollouts: `python -m agents.rollout --scene benchmark`.

From states that the policy visits, many actions are tried on the running solver, each held for some
steps. Networks learn what an action earns in a state, and how likely the fluid blows up, from what
is observed there. The policy becomes the one that earns most by them. Then it plays again, and all
that was tried so far counts. Tries (`agents.tries`) are kept on disk and not repeated.
Source: Lagoudakis and Parr 2003, reinforcement learning as classification. Their rollouts go on
with the policy after the first action; here the action is held, and nothing follows it.
"""

import time
from collections.abc import Sequence
from dataclasses import MISSING, asdict, dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import torch

from agents import cards, policies, tries
from agents.arguments import SCENE_HELP, BackendArgs, command, launch, option
from agents.exports import plain_network
from agents.imitation import descend, perceptron
from agents.training import hyperparameters
from agents.tries import Exploration, Tries, TrySettings, explore, gather
from agents.validation import Validation, training_ids, validation_ids
from sph_gym.controllers import Network
from sph_gym.env.instances import SIZES
from sph_gym.provenance import content_hash
from sph_gym.solver.checks import in_range, known, positive, whole
from sph_gym.studies.jobs import run_jobs
from sph_gym.studies.results import Results

Kind = TypeVar("Kind")
# Largest seed, of which torch takes multiples.
LARGEST = 10**9
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
        self.where()
        whole("rounds", self.rounds, at_least=1)
        in_range("episodes", whole("episodes", self.episodes, at_least=1), 1, SIZES["train"])
        in_range("seed", whole("seed", self.seed), 0, LARGEST)
        validation_ids(self.scene, self.n_evaluations)
        self.settings  # noqa: B018  wrong entries are told now

    @property
    def folder(self) -> Path:
        """Folder of everything but the tries."""
        return self.output / f"rollout_{self.scene}_seed{self.seed}"

    @cached_property
    def settings(self) -> "RolloutSettings":
        """Hyperparameters, read once."""
        found = hyperparameters("rollout", self.scene)
        groups: dict[str, type[Any]] = {
            "tries": TrySettings, "value": FitSettings, "policy": FitSettings
        }  # fmt: skip
        made = {name: filled(kind, name, found.get(name)) for name, kind in groups.items()}
        return filled(RolloutSettings, "an entry", found | made)


@dataclass(frozen=True)
class FitSettings:
    """Fit of n networks. Raises ValueError for what is out of range."""

    net_arch: Sequence[int]
    gradient_steps: int
    batch_size: int
    learning_rate: float
    n: int = 1

    def __post_init__(self) -> None:
        for width in self.net_arch:
            whole("net_arch", width, at_least=1)
        for name in ("gradient_steps", "batch_size", "n"):
            whole(name, getattr(self, name), at_least=1)
        positive("learning_rate", self.learning_rate)


@dataclass(frozen=True)
class RolloutSettings:
    """Entries of hyperparams/rollout.yml. Raises ValueError that names a wrong one."""

    action_mode: str
    tries: TrySettings
    value: FitSettings
    policy: FitSettings
    doubt: float
    price: float

    def __post_init__(self) -> None:
        # an action of the other kinds means something else in every state
        known("action_mode", self.action_mode, ("absolute", "stable"))
        for name in ("doubt", "price"):
            in_range(name, getattr(self, name), 0.0)


def filled(kind: type[Kind], place: str, entries: Any) -> Kind:
    """Return a dataclass with entries of the YAML file. Raises ValueError if they don't fit."""
    names = {each.name: each.default for each in fields(kind)}  # type: ignore[arg-type]
    needed = {name for name, default in names.items() if default is MISSING}
    if not isinstance(entries, dict) or not needed <= entries.keys() <= names.keys():
        raise ValueError(
            f"hyperparams: expected {', '.join(names)} in {place} of rollout.yml, got {entries}"
        )
    return kind(**entries)


def train(args: RolloutArgs) -> None:
    """Learn round by round; keep the network that is best in validation.

    Ctrl-C ends it, and the next call goes on with the tries that are there.
    """
    torch.set_num_threads(1)
    began, ids = time.monotonic(), validation_ids(args.scene, args.n_evaluations)
    validation = Validation(ids, args.folder, args.settings.action_mode)
    episodes, learner = list[dict[str, Any]](), None
    for number in range(args.rounds):
        episodes += visit(args, number, learner)
        found = gather(episodes)
        values = [fit_value(args, found, k) for k in range(args.settings.value.n)]
        network = fit_policy(args, found, values)
        learner = validation.end_round(number, network, found.values.size, "tries")
    print(f"policy: {validation.network}")
    if args.ship:
        target = cards.ship(
            validation.network, "rollout", args.scene,
            how=f"{args.rounds} rounds of {args.episodes} episodes on each scene, with the "
            f"hyperparameters {asdict(args.settings)}; kept is the network that was best on "
            f"{len(ids)} validation flows.",
            command=command(), seed=args.seed,
            minutes=round((time.monotonic() - began) / 60),
        )  # fmt: skip
        print(f"shipped: {target}")


def visit(args: RolloutArgs, number: int, learner: Path | None) -> list[dict[str, Any]]:
    """Return what was tried in the episodes of a round; those that are kept are not played again.

    learner: network that plays, None for the adaptive rule.
    """
    count = args.episodes
    path, weights = (None, None) if learner is None else (str(learner), content_hash(learner))
    # every round has other instances, until all have been played; the next seed begins elsewhere
    first = args.seed * SIZES["train"] // 4 + number * count
    jobs = [
        Exploration(
            path, weights, instance, args.seed, args.settings.action_mode, args.settings.tries
        )
        for _, instance in training_ids(args.scene, first, count)
    ]
    code = content_hash(Path(tries.__file__), Path(policies.__file__))
    # a network counts by its content
    keys = [[*job[1:-1], asdict(job.settings), code] for job in jobs]
    store = Results(args.output / "rollouts")
    title, each = f"tries, round {number}", [(job,) for job in jobs]
    return run_jobs(explore, each, keys, store, title, args.where())


def fit_value(args: RolloutArgs, found: Tries, number: int) -> torch.nn.Module:
    """Return a network that has learned what an action earns and the logit of a blow-up.

    number: of several.
    """
    settings, count = args.settings.value, found.actions.shape[1]
    torch.manual_seed(1000 * args.seed + number)
    observations, actions, values, blowups = map(torch.as_tensor, found)
    inputs = torch.cat([observations.repeat_interleave(count, 0), actions.flatten(0, 1)], 1)
    wanted, blown = values.flatten(), blowups.flatten()
    module = perceptron(inputs.shape[1], settings.net_arch, 2, torch.nn.SiLU)
    descent = torch.optim.AdamW(module.parameters(), settings.learning_rate, weight_decay=1e-3)
    steps, rate = settings.gradient_steps, settings.learning_rate
    schedule = torch.optim.lr_scheduler.OneCycleLR(descent, rate, total_steps=steps)

    def loss() -> torch.Tensor:
        batch = torch.randint(len(inputs), (settings.batch_size,))
        earned, logits = module(inputs[batch]).T
        risk = torch.nn.functional.binary_cross_entropy_with_logits(logits, blown[batch])
        return (earned - wanted[batch]).square().mean() + risk

    descend(loss, descent, schedule, steps)
    return module.requires_grad_(False)


def fit_policy(args: RolloutArgs, found: Tries, values: Sequence[torch.nn.Module]) -> Network:
    """Return a new policy whose actions earn most by the values, less the price of blow-ups.

    Where the values disagree, their doubt counts, too.
    """
    settings, doubt, price = args.settings.policy, args.settings.doubt, args.settings.price
    torch.manual_seed(args.seed)
    observations = torch.as_tensor(found.observations)
    module = perceptron(observations.shape[1], settings.net_arch, 3)
    steps = settings.gradient_steps
    descent = torch.optim.Adam(module.parameters(), settings.learning_rate)
    decay = torch.optim.lr_scheduler.LinearLR(descent, 1.0, 0.01, total_iters=steps)

    def loss() -> torch.Tensor:
        seen = observations[torch.randint(len(observations), (settings.batch_size,))]
        wished = module(seen)
        actions = wished.clamp(-1.0, 1.0)
        inputs = torch.cat([seen, actions + JITTER * torch.randn_like(actions)], 1)
        earned, logits = torch.stack([value(inputs) for value in values]).unbind(-1)
        worths = earned - price * logits.sigmoid()
        sure = worths.mean(0) - doubt * worths.std(0, correction=0)
        # without the first term, what is beyond the bounds would never come back
        return 0.1 * (wished - actions).square().mean() - sure.mean()

    descend(loss, descent, decay, steps)
    return plain_network(module, "clip", args.settings.action_mode)


if __name__ == "__main__":
    launch(train, RolloutArgs, __doc__)
