"""Write the episodes of an agent as a Minari dataset, for offline learning."""

from dataclasses import dataclass

from agents.arguments import launch, option
from agents.evaluate import instance_ids
from agents.policies import LEARNED, NAMES, STATIC, Spec, build
from sph_gym.controllers.shipped import network_of
from sph_gym.env import env_id
from sph_gym.env.dataset import record
from sph_gym.env.instances import SIZES
from sph_gym.solver.checks import known, whole


@dataclass
class RecordingArgs:
    """Arguments of a recording: the agent, and the instances that it plays."""

    dataset: str = option("name of the dataset: NAMESPACE/NAME-vNUMBER")
    scene: str = option("scene of the environment", "dam_break")
    agent: str = option(
        f"one of {', '.join(NAMES)}; static ones with --settings, learned ones with --network",
        "tuned_cfl",
    )
    episodes: int = option("how many, each on an instance of its own", 8)
    instances: str = option("nominal, train, val, test or ood", "train")
    settings: tuple[float, float, float] | None = option(
        "of a static agent: Courant multiple, sound speed / c0, xsph", None
    )
    network: str | None = option(
        "of a learned agent: file of the exported network; None: the one that is shipped", None
    )
    seed: int = option("of the first episode; the next ones count on", 0)

    def __post_init__(self) -> None:
        known("agent", self.agent, NAMES)
        most = SIZES[known("instances", self.instances, SIZES)]
        if whole("episodes", self.episodes, at_least=1) > most:
            raise ValueError(
                f"episodes: expected at most {most}, the flows of {self.instances!r}, got "
                f"{self.episodes}"
            )
        if self.network is not None and self.agent not in LEARNED:
            raise ValueError(f"network: expected none for {self.agent}, got {self.network}")
        whole("seed", self.seed)
        if (self.agent in STATIC) != (self.settings is not None):
            needed = "three numbers" if self.agent in STATIC else "none"
            raise ValueError(f"settings: expected {needed} for {self.agent}, got {self.settings}")


def main(args: RecordingArgs) -> None:
    """Record what the arguments ask for, and print where it is."""
    network = args.network
    if network is None and args.agent in LEARNED:
        found = network_of(args.agent, args.scene)
        if found is None:
            raise ValueError(
                f"network: expected a file, for no network of {args.agent} comes with the package, "
                "got None"
            )
        network = str(found)
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
    launch(main, RecordingArgs, __doc__)
