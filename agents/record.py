"""Writes the episodes of an agent as a Minari dataset, for offline learning."""

from dataclasses import dataclass

import tyro

from agents.evaluate import instance_ids
from agents.policies import LEARNED, Spec, build, trained_network
from sph_gym.env import env_id
from sph_gym.env.dataset import record


@dataclass
class Args:
    """Play an agent on numbered instances of a scene and write a Minari dataset."""

    dataset: str
    """name of the dataset: NAMESPACE/NAME-vNUMBER"""
    scene: str = "dam_break"
    """scene of the environment"""
    agent: str = "tuned_cfl"
    """random, default, cfl, tuned_cfl, grid_search (with its settings), ppo, sac or dqn"""
    episodes: int = 8
    """how many, each on an instance of its own"""
    instances: str = "train"
    """nominal, train, val, test or ood"""
    settings: tuple[float, float, float] | None = None
    """of grid_search: Courant multiple, sound speed / c0, xsph"""
    network: str | None = None
    """of ppo, sac and dqn: file of the exported network, by default the one that is shipped"""
    seed: int = 0
    """of the first episode; the next ones count on"""


def main(args: Args) -> None:
    """Record what the arguments ask for, and tell where it is."""
    network = args.network
    if network is None and args.agent in LEARNED:
        network = str(trained_network(args.agent, args.scene))
    dataset = record(
        env_id(args.scene),
        build(Spec(args.agent, args.settings, network), args.seed),
        args.episodes,
        args.dataset,
        instance_ids(args.scene, args.instances, args.episodes),
        args.seed,
        algorithm_name=args.agent,
        description=f"{args.agent} on {args.scene}, instances of the set {args.instances!r}",
    )
    print(
        f"{dataset.total_episodes} episodes, {dataset.total_steps} steps: "
        f"{dataset.storage.data_path}"
    )


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
