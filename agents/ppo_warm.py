"""PPO that goes on with a network: `python -m agents.ppo_warm --scene benchmark --n-envs 8`.

By default with one that imitates the adaptive rule, which takes a minute: what PPO learns first by
itself, not to blow up, is there from the start.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
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
from agents.training import Training, TrainingArgs
from agents.validation import NETWORK
from sph_gym.controllers import Network
from sph_gym.env import actions
from sph_gym.solver.checks import in_range, known, positive, whole


@dataclass(kw_only=True)
class WarmArgs(TrainingArgs):
    """Arguments of a training that goes on with a network."""

    start: Path | None = option(
        "exported network to begin with, by default one that imitates the adaptive rule", None
    )
    courant: float = option(
        "largest multiple of the stable step that the policy may ask for: with longer steps, "
        "impacts blow up; the tuned rule takes 0.75",
        1.0,
    )
    spread: tuple[float, float, float] = option(
        "standard deviations with which dt, stiffness and epsilon are explored at the start, in "
        "coordinates of the action: a longer step soon blows up, so that dt gets less",
        (0.05, 0.14, 0.14),
    )
    held: int = option("steps during which it stays as it is, while its value is learned", 20_000)

    def __post_init__(self) -> None:
        super().__post_init__()
        whole("held", self.held)
        in_range("courant", self.courant, *actions.COURANT)
        for value in self.spread:
            positive("spread", value)


def imitate(args: WarmArgs, action_mode: str) -> Path:
    """Return a network that imitates the adaptive rule; its lessons are kept."""
    lessons = ImitationArgs(
        scene=args.scene, teacher="adaptive", rounds=3, lessons=6, seed=args.seed,
        output=args.output, n_evaluations=1, action_mode=action_mode,
    )  # fmt: skip
    imitation.train(lessons)
    return lessons.folder / NETWORK


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


def train(args: WarmArgs) -> None:
    """Train on the training instances; keep the model that is best on the validation instances."""
    training = Training("ppo_warm", args, export)
    # before minutes of lessons; `courant` needs actions that say how long a step is
    mode = known("action_mode", training.action_mode, ("absolute", "stable"))
    start = None if args.resume else args.start or imitate(args, mode)
    envs = training.make_envs()
    highest = np.array([actions.locate(args.courant, 1.0, 0.0)[0], 1.0, 1.0], np.float32)
    envs.action_space = spaces.Box(-1.0, highest, dtype=np.float32)
    if start is None:
        model = PPO.load(training.checkpoint(), env=envs, device="cpu")
    else:
        model = PPO("MlpPolicy", envs, **training.settings())
        begin_with(model, Network.load(start), mode)
        explore(model, args.spread)
    training.learn(model, [Hold(args.held)])
    envs.close()


if __name__ == "__main__":
    launch(train, WarmArgs, __doc__)
