"""PPO under a bound on the share of steps out of tolerance: `python -m agents.ppo_lagrangian`."""

from typing import Any

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnvWrapper

from agents.arguments import launch
from agents.ppo import export
from agents.training import Training, TrainingArgs, Trial
from sph_gym.env.rewards import WORST


class Priced(VecEnvWrapper):
    """Environments that charge `price` for every step out of tolerance, as info["cost"] counts.

    A blow-up costs as many steps as are left. costs: of all steps since the list was emptied.
    """

    def __init__(self, venv: Any) -> None:
        super().__init__(venv)
        # what the reward charges for each of them
        self._charge = WORST * venv.get_attr("rules")[0].weights["blowup"]
        self.price, self.costs = 0.0, list[float]()

    def reset(self) -> Any:
        """Start an episode in all environments."""
        return self.venv.reset()

    def step_wait(self) -> Any:
        """Return observations, rewards less the price of the costs, dones and infos."""
        observations, rewards, dones, infos = self.venv.step_wait()
        costs = [max(info["cost"], -info["reward_blowup"] / self._charge) for info in infos]
        self.costs += costs
        charges: Any = np.array(costs, np.float32) * np.float32(self.price)
        return observations, rewards - charges, dones, infos


class LagrangianPPO(PPO):
    """PPO with a Lagrange multiplier: the price that keeps the costs of a step at `cost_limit`.

    After every rollout the multiplier changes by `multiplier_rate` times what the mean cost is
    above the limit. It is stored with the model, but begins at 0. To be trained on `Priced`.
    Source: Ray et al. 2019, benchmarking safe exploration.
    """

    def __init__(
        self,
        *arguments: Any,
        cost_limit: float = 0.02,
        multiplier_rate: float = 1.0,
        **more: Any,
    ) -> None:
        super().__init__(*arguments, **more)
        self.cost_limit, self.multiplier_rate, self.multiplier = cost_limit, multiplier_rate, 0.0

    def collect_rollouts(self, env: Any, *arguments: Any, **more: Any) -> bool:
        """Play at the present price, then adapt it; return whether to go on."""
        env.price, env.costs = self.multiplier, []
        goes_on = super().collect_rollouts(env, *arguments, **more)
        cost = float(np.mean(env.costs)) if env.costs else self.cost_limit
        excess = cost - self.cost_limit
        self.multiplier = max(self.multiplier + self.multiplier_rate * excess, 0.0)
        self.logger.record("rollout/cost", cost)
        self.logger.record("rollout/multiplier", self.multiplier)
        return goes_on


def train(args: TrainingArgs, trial: Trial | None = None) -> None:
    """Train on the training instances; keep the model that is best on the validation instances."""
    training = Training("ppo_lagrangian", args, export, trial)
    training.learn(training.model(LagrangianPPO, Priced(training.make_envs())))


if __name__ == "__main__":
    launch(train, TrainingArgs, __doc__)
