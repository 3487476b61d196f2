"""Soft actor-critic: `python -m agents.sac --scene dam_break --steps 60000`."""

import tyro
from stable_baselines3 import SAC

from agents.training import Args, train

if __name__ == "__main__":
    train(SAC, "sac", tyro.cli(Args, description=__doc__))
