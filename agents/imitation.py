"""Imitation of a teacher, by default the oracle: `python -m agents.imitation --scene benchmark`.

Behaviour cloning and DAgger. In the first round the teacher plays; a network learns its actions.
In every further round the learner plays, the teacher answers for the states that it visits
(`agents.lessons`), and a network learns from all answers so far. Lessons are kept on disk and not
repeated. Sources: Ross et al. 2011, DAgger; Kelly et al. 2019, where the teacher takes over.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch.nn.functional import smooth_l1_loss

from agents import lessons, policies
from agents.arguments import SCENE_HELP, BackendArgs, launch, option
from agents.exports import plain_network
from agents.lessons import TEACHERS, Lesson
from agents.training import CONTINUOUS, hyperparameters
from agents.validation import Validation, training_ids, validation_ids
from sph_gym.controllers import Network
from sph_gym.provenance import content_hash
from sph_gym.solver.checks import known, whole
from sph_gym.studies.jobs import run_jobs
from sph_gym.studies.results import Results


@dataclass
class ImitationArgs(BackendArgs):
    """Arguments of an imitation; hyperparams/imitation.yml has those of the network."""

    scene: str = option(SCENE_HELP, "dam_break")
    teacher: str = option(f"one of {', '.join(TEACHERS)}", "coarse_oracle")
    rounds: int = option("rounds; in the first one the teacher plays by itself", 4)
    lessons: int = option("lessons of a round, on training instances of each scene", 12)
    seed: int = option("seed of everything", 0)
    output: Path = option("folder of lessons and networks; lessons are kept", Path("runs"))
    n_evaluations: int = option("validation episodes on each scene, after every round", 4)
    action_mode: str | None = option(
        f"one of {', '.join(CONTINUOUS)}; by default that of hyperparams/imitation.yml", None
    )

    def __post_init__(self) -> None:
        self.where()
        known("teacher", self.teacher, TEACHERS)
        whole("rounds", self.rounds, at_least=1)
        whole("lessons", self.lessons, at_least=1)
        whole("seed", self.seed)
        validation_ids(self.scene, self.n_evaluations)
        known("action_mode", self.settings["action_mode"], CONTINUOUS)

    @property
    def folder(self) -> Path:
        """Folder of everything that the imitation writes."""
        return self.output / f"imitation_{self.teacher}_{self.scene}_seed{self.seed}"

    @cached_property
    def settings(self) -> dict[str, Any]:
        """Hyperparameters, read once, among them the kind of the actions that are learned."""
        found = hyperparameters("imitation", self.scene)
        return found if self.action_mode is None else found | {"action_mode": self.action_mode}


def train(args: ImitationArgs) -> None:
    """Learn from the teacher, round by round; keep the network that is best in validation.

    Ctrl-C ends it, and the next call goes on with the lessons that are there.
    """
    torch.set_num_threads(1)
    ids = validation_ids(args.scene, args.n_evaluations)
    validation = Validation(ids, args.folder, args.settings["action_mode"])
    answers, learner = [], None
    for number in range(args.rounds):
        answers += attend(args, number, learner)
        observations, actions = (
            np.concatenate([answer[kind] for answer in answers if answer[kind]])
            for kind in ("observations", "actions")
        )
        network = fit(args, observations, actions)
        learner = validation.end_round(number, network, len(observations), "answers")
    print(f"policy: {validation.network}")


def attend(args: ImitationArgs, number: int, learner: Path | None) -> list[dict[str, Any]]:
    """Return the lessons of a round; those that are kept are not played again."""
    count, mode = args.lessons, args.settings["action_mode"]
    path, weights = (None, None) if learner is None else (str(learner), content_hash(learner))
    # every round has other instances, until all have been played
    first = (args.seed * args.rounds + number) * count
    jobs = [
        Lesson(args.teacher, path, weights, instance, args.seed + k, mode)
        for k, instance in training_ids(args.scene, first, count)
    ]
    code = content_hash(Path(lessons.__file__), Path(policies.__file__))
    # a network counts by its content
    keys = [[job.teacher, *job[2:], code] for job in jobs]
    store = Results(args.output / "lessons")
    title, each = f"lessons, round {number}", [(job,) for job in jobs]
    return run_jobs(lessons.take, each, keys, store, title, args.where())


def fit(args: ImitationArgs, observations: Any, actions: Any) -> Network:
    """Return a new network that has learned the actions for the observations.

    The loss grows linearly for answers far off, since equally good actions may be far apart.
    """
    settings = args.settings
    torch.manual_seed(args.seed)
    inputs, wanted = (torch.as_tensor(x, dtype=torch.float32) for x in (observations, actions))
    module = perceptron(inputs.shape[1], settings["net_arch"], wanted.shape[1])
    steps = settings["gradient_steps"]
    descent = torch.optim.Adam(module.parameters(), settings["learning_rate"])
    decay = torch.optim.lr_scheduler.LinearLR(descent, 1.0, 0.01, total_iters=steps)

    def loss() -> torch.Tensor:
        batch = torch.randint(len(inputs), (settings["batch_size"],))
        return smooth_l1_loss(module(inputs[batch]), wanted[batch], beta=settings["beta"])

    descend(loss, descent, decay, steps)
    return plain_network(module, "clip", settings["action_mode"])


def descend(
    loss: Callable[[], torch.Tensor],
    descent: torch.optim.Optimizer,
    schedule: torch.optim.lr_scheduler.LRScheduler,
    steps: int,
) -> None:
    """Take so many steps down the gradient of a loss, which draws its batch itself."""
    for _ in range(steps):
        descent.zero_grad()
        loss().backward()
        descent.step()
        schedule.step()


def perceptron(
    n_in: int, widths: Sequence[int], n_out: int, unit: type[torch.nn.Module] = torch.nn.Tanh
) -> torch.nn.Sequential:
    """Return a perceptron, by default with tanh units: PPO goes on with such networks."""
    sizes, layers = [n_in, *widths], list[torch.nn.Module]()
    for before, after in itertools.pairwise(sizes):
        layers += [torch.nn.Linear(before, after), unit()]
    return torch.nn.Sequential(*layers, torch.nn.Linear(sizes[-1], n_out))


if __name__ == "__main__":
    launch(train, ImitationArgs, __doc__)
