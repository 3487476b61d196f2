"""Double deep Q-network on the 27 discrete actions: `python -m agents.dqn --scene dam_break`."""

from typing import Any

import numpy as np
import torch
from stable_baselines3 import DQN
from torch.nn.functional import smooth_l1_loss

from agents.arguments import launch
from agents.exports import plain_network
from agents.training import Training, TrainingArgs, Trial
from sph_gym.controllers import Network
from sph_gym.solver.checks import known


class DoubleDQN(DQN):
    """DQN in which one network chooses the next action and the other one values it.

    reward_shift: added to every reward, so that values begin where they belong: where a step
    earns 0.5 on average, networks that begin at 0 would first have to learn 0.5 / (1 - gamma). A
    terminal state counts as if the shift went on for ever, so that the best policy is the same.
    Sources: van Hasselt et al. 2016, double Q-learning; Sun et al. 2022, reward shifting.
    """

    def __init__(self, *arguments: Any, reward_shift: float = 0.0, **more: Any) -> None:
        super().__init__(*arguments, **more)
        self.reward_shift = reward_shift

    def train(self, gradient_steps: int, batch_size: int = 100) -> None:
        """Make gradient steps on batches from the replay buffer."""
        self.policy.set_training_mode(True)
        self._update_learning_rate(self.policy.optimizer)
        losses = [self._descend(batch_size) for _ in range(gradient_steps)]
        self._n_updates += gradient_steps
        self.logger.record("train/loss", np.mean(losses))

    def _descend(self, batch_size: int) -> float:
        """Make one gradient step; return the loss."""
        assert self.replay_buffer is not None
        batch = self.replay_buffer.sample(batch_size)
        found = self.q_net(batch.observations).gather(1, batch.actions.long())
        loss = smooth_l1_loss(found, self._target(batch))
        self.policy.optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.policy.parameters(), self.max_grad_norm)
        self.policy.optimizer.step()
        return loss.item()

    @torch.no_grad()
    def _target(self, batch: Any) -> torch.Tensor:
        # the shift adds this to every value
        offset = self.reward_shift / (1 - self.gamma)
        choices = self.q_net(batch.next_observations).argmax(dim=1, keepdim=True)
        following = self.q_net_target(batch.next_observations).gather(1, choices) - offset
        return batch.rewards + (1 - batch.dones) * self.gamma * following + offset


def export(model: DoubleDQN, action_mode: str) -> Network:
    """Return the network of the values; the policy takes the action of the largest."""
    return plain_network(model.q_net.q_net, "none", action_mode)


def train(args: TrainingArgs, trial: Trial | None = None) -> None:
    """Train on the training instances; keep the model that is best on the validation instances."""
    training = Training("dqn", args, export, trial)
    known("action_mode", training.action_mode, ("discrete",))
    training.learn(training.model(DoubleDQN, training.make_envs()))


if __name__ == "__main__":
    launch(train, TrainingArgs, __doc__)
