"""Proximal policy optimisation: `python -m agents.ppo --scene dam_break --steps 250000`."""

import tyro
from stable_baselines3 import PPO

from agents.training import Args, train

if __name__ == "__main__":
    train(PPO, "ppo", tyro.cli(Args, description=__doc__))
