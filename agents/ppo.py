"""Proximal policy optimisation: `python -m agents.ppo --scene dam_break --ship`."""

import torch
import tyro
from stable_baselines3 import PPO

from agents.training import (
    Args,
    folder,
    hyperparameters,
    learn,
    linear,
    make_envs,
    newest_checkpoint,
)


def train(args: Args) -> None:
    """Train PPO and export the best policy."""
    # the networks are small, and the processes of the environments want the cores
    torch.set_num_threads(1)
    path, envs = folder("ppo", args), make_envs(args)
    if args.resume:
        model = PPO.load(newest_checkpoint(path), env=envs, device="cpu")
    else:
        settings = hyperparameters("ppo", args.scene)
        policy = {
            "net_arch": settings.pop("net_arch"),
            "log_std_init": settings.pop("log_std_init"),
        }
        settings["learning_rate"] = linear(settings["learning_rate"])
        model = PPO(
            "MlpPolicy",
            envs,
            policy_kwargs=policy,
            tensorboard_log=str(path / "tensorboard"),
            seed=args.seed,
            device="cpu",
            **settings,
        )
    learn(model, "ppo", args)
    envs.close()


if __name__ == "__main__":
    train(tyro.cli(Args, description=__doc__))
