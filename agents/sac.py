"""Soft actor-critic: `python -m agents.sac --scene dam_break --ship`."""

import torch
import tyro
from stable_baselines3 import SAC

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
    """Train SAC and export the best policy."""
    # the networks are small, and the processes of the environments want the cores
    torch.set_num_threads(1)
    path, envs = folder("sac", args), make_envs(args)
    if args.resume:
        model = SAC.load(newest_checkpoint(path), env=envs, device="cpu")
    else:
        settings = hyperparameters("sac", args.scene)
        policy = {"net_arch": settings.pop("net_arch")}
        settings["learning_rate"] = linear(settings["learning_rate"])
        model = SAC(
            "MlpPolicy",
            envs,
            policy_kwargs=policy,
            tensorboard_log=str(path / "tensorboard"),
            seed=args.seed,
            device="cpu",
            **settings,
        )
    learn(model, "sac", args)
    envs.close()


if __name__ == "__main__":
    train(tyro.cli(Args, description=__doc__))
