"""PPO that goes on with a network: `python -m agents.ppo_warm --scene benchmark --n-envs 8`.

By default with one that imitates the adaptive rule, which takes a minute: what PPO learns first by
itself, not to blow up, is there from the start.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from agents import imitation
from agents.arguments import launch, option
from agents.imitation import ImitationArgs
from agents.ppo import export, layers
from agents.training import Training, TrainingArgs, Trial
from agents.validation import NETWORK
from sph_gym.controllers import Network
from sph_gym.env import actions
from sph_gym.solver.checks import finite_array, in_range, known, positive


@dataclass(kw_only=True)
class WarmArgs(TrainingArgs):
    """Arguments of a training that goes on with a network."""

    start: Path | None = option(
        "exported network to begin with, by default one that imitates the adaptive rule", None
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.resume and self.start is not None:
            raise ValueError(f"start: expected none with --resume, got {self.start}")


@dataclass(frozen=True)
class Caution:
    """Hyperparameters besides those of PPO, for a policy that is good already.

    courant: largest multiple of the stable step that the policy may ask for; spread: standard
    deviations with which dt, stiffness and epsilon are explored at the start, in coordinates of the
    action; held: share of the steps during which the policy stays as it is, while its value is
    learned. Raises ValueError for what is out of range.
    """

    courant: float
    spread: Sequence[float]
    held: float

    def __post_init__(self) -> None:
        in_range("courant", self.courant, *actions.COURANT)
        for value in finite_array("spread", self.spread, (3,)):
            positive("spread", value)
        in_range("held", self.held, 0.0, 1.0)


def imitate(args: TrainingArgs, action_mode: str) -> Path:
    """Return a network that imitates the adaptive rule; its lessons are kept.

    It has a folder of its own: one of `agents.imitation` may hold a network that took hours.
    """
    lessons = ImitationArgs(
        scene=args.scene, teacher="adaptive", rounds=3, lessons=6, seed=args.seed,
        output=args.output / "ppo_warm_starts", n_evaluations=1, action_mode=action_mode,
    )  # fmt: skip
    imitation.train(lessons)
    return lessons.folder / NETWORK


def common_start(args: TrainingArgs, action_mode: str) -> Path:
    """Return the network with which all trainings of a study begin; it is made once.

    Processes that work on one study may make it at the same time: each in a folder of its own, and
    all get the same.
    """
    path = args.output / "start.npz"
    if not path.exists():
        args.output.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=args.output) as folder:
            alone = replace(args, output=Path(folder), seed=0)
            Network.load(imitate(alone, action_mode)).save(path)
    return path


def begin_with(model: PPO, network: Network, action_mode: str) -> None:
    """Give the mean of the policy the weights of a network.

    Raises ValueError unless it was trained with the same layouts, layers, units and squashing.
    """
    own = export(model, action_mode)
    network.check(own.observation, own.action)
    shapes = [[weight.shape for weight in each.weights] for each in (network, own)]
    kinds = [(each.activation, each.squash) for each in (network, own)]
    if shapes[0] != shapes[1] or kinds[0] != kinds[1]:
        raise ValueError(
            f"start: expected a network with layers {shapes[1]} and {kinds[1]}, "
            f"got {shapes[0]} and {kinds[0]}"
        )
    linears = [layer for layer in layers(model) if isinstance(layer, torch.nn.Linear)]
    with torch.no_grad():
        for layer, weight, bias in zip(linears, network.weights, network.biases, strict=True):
            layer.weight.copy_(torch.from_numpy(weight))
            layer.bias.copy_(torch.from_numpy(bias))


def explore(model: PPO, spread: Sequence[float]) -> None:
    """Set the standard deviation of each control, with which the policy explores."""
    policy: Any = model.policy
    with torch.no_grad():
        policy.log_std.copy_(torch.log(torch.tensor(spread)))


class Hold(BaseCallback):
    """Keeps the policy as it is for so many steps.

    The value of a policy that comes from elsewhere is unknown: its first gradients would spoil it.
    """

    def __init__(self, steps: int) -> None:
        super().__init__()
        self._steps = steps

    def _on_rollout_start(self) -> None:
        model: Any = self.model
        free = self.num_timesteps >= self._steps
        for layer in layers(model):
            layer.requires_grad_(free)
        model.policy.log_std.requires_grad_(free)

    def _on_step(self) -> bool:
        return True


def train(args: TrainingArgs, trial: Trial | None = None, start: Path | None = None) -> None:
    """Train on the training instances; keep the model that is best on the validation instances.

    start: exported network to begin with; None for one that imitates the adaptive rule.
    """
    training = Training("ppo_warm", args, export, trial)
    # `courant` needs actions that say how long a step is
    mode = known("action_mode", training.action_mode, ("absolute", "stable"))
    settings = training.settings()
    caution = Caution(**{field.name: settings.pop(field.name) for field in fields(Caution)})
    envs = training.make_envs()
    highest = np.array([actions.locate(caution.courant, 1.0, 0.0)[0], 1.0, 1.0], np.float32)
    envs.action_space = spaces.Box(-1.0, highest, dtype=np.float32)
    # made before the model, which sets the seed of all that follows
    make = imitate if trial is None else common_start
    start = None if args.resume else start or make(args, mode)
    model = training.model(PPO, envs, settings)
    if start is not None:
        begin_with(model, Network.load(start), mode)
        explore(model, caution.spread)
    training.learn(model, [Hold(round(caution.held * args.steps))])


def main(args: WarmArgs) -> None:
    """Train with the arguments of the command line."""
    train(args, start=args.start)


if __name__ == "__main__":
    launch(main, WarmArgs, __doc__)
