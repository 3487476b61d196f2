"""Deep Q-network on the 27 discrete actions: `python -m agents.dqn --scene dam_break`."""

import tyro
from stable_baselines3 import DQN

from agents.training import Args, train

if __name__ == "__main__":
    train(DQN, "dqn", tyro.cli(Args, description=__doc__))
