"""Proximal policy optimisation: `python -m agents.ppo --scene dam_break --steps 250000`."""

from typing import Any

from stable_baselines3 import PPO

from agents.arguments import parse
from agents.exports import plain_network
from agents.training import Training, TrainingArgs
from sph_gym.controllers import Network


def export(model: PPO) -> Network:
    """Return the mean of the policy as a plain network; actions are clipped to the box."""
    policy: Any = model.policy
    return plain_network([*policy.mlp_extractor.policy_net, policy.action_net], "clip", "absolute")


def train(args: TrainingArgs) -> None:
    """Train on the training instances; keep the model that is best on the validation instances."""
    training = Training("ppo", args, export)
    envs = training.make_envs()
    if args.resume:
        model = PPO.load(training.checkpoint(), env=envs, device="cpu")
    else:
        model = PPO("MlpPolicy", envs, **training.settings())
    training.learn(model)
    envs.close()


if __name__ == "__main__":
    train(parse(TrainingArgs, __doc__))
