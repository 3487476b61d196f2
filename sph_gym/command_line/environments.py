"""`sph-gym docs`, `manifest` and `dataset`: about the Gymnasium environments."""

import argparse
from pathlib import Path
from typing import Any

from sph_gym.command_line.outcome import Outcome
from sph_gym.command_line.parser import add_command, completed
from sph_gym.env import SCENES, env_id


def add(commands: Any) -> None:
    """Add the commands to a parser."""
    _add_docs(commands)
    _add_manifest(commands)
    _add_dataset(commands)


def _add_docs(commands: Any) -> None:
    docs = add_command(
        commands,
        "docs",
        _docs,
        help="everything about an environment, as Markdown",
        examples=(
            ("docs", "the ids of all environments"),
            ("docs sph_gym/DamBreak-v1", "the page of one"),
        ),
    )
    add = docs.add_argument
    id_ = add("id", nargs="?", help="such as sph_gym/DamBreak-v1; without: a list")
    completed(id_, [env_id(scene) for scene in SCENES])
    add("--output", metavar="FOLDER", help="write pages there, by default of all ids")


def _docs(options: argparse.Namespace) -> Outcome:
    from sph_gym.env import documentation

    chosen = [options.id] if options.id else None
    if options.output:
        print(*documentation.write(options.output, chosen), sep="\n")
    else:
        print(documentation.page(options.id) if options.id else documentation.index())
    return Outcome()


def _add_manifest(commands: Any) -> None:
    manifest = add_command(
        commands,
        "manifest",
        _manifest,
        help="draw the instances anew and compute their references (hours)",
        examples=(("manifest --scenes dam_break --output new", "of one environment, elsewhere"),),
    )
    add = manifest.add_argument
    only = add("--scenes", nargs="+", metavar="SCENE", help="only these environments")
    completed(only, SCENES)
    add("--output", metavar="FOLDER", help="by default, where sph_gym reads them")
    text = "let ids mean other flows than those of the same version did"
    add("--redefine", action="store_true", help=text)
    text = "compute all references, also those that the folder has"
    add("--again", action="store_true", help=text)
    add("--stamp", action="store_true", help="only write the digests of what is there anew")


def _manifest(options: argparse.Namespace) -> Outcome:
    from sph_gym.env.build_manifests import prepare, stamp
    from sph_gym.env.manifest import FOLDER

    folder = Path(options.output) if options.output else FOLDER
    if options.stamp:
        print(*stamp(options.scenes, folder), sep="\n")
    else:
        print(*prepare(options.scenes, folder, options.redefine, options.again), sep="\n")
    return Outcome()


def _add_dataset(commands: Any) -> None:
    dataset = add_command(
        commands,
        "dataset",
        _dataset,
        help="record Minari datasets of the rule, the oracle and random actions",
        description="Writes sph_gym/SCENE/POLICY-v1 for each scene and policy, and of other sets "
        "than train sph_gym/SCENE/POLICY-SET-v1. Stop it when you like: finished episodes are "
        "kept, and the same command goes on from there.",
        examples=(
            ("dataset --scenes dam_break --policies tuned-rule", "one dataset of 8 episodes"),
        ),
    )
    add = dataset.add_argument
    only = add("--scenes", nargs="+", metavar="SCENE", help="only these environments")
    completed(only, SCENES)
    text = "of tuned-rule, oracle, random, adaptive-rule; by default the first three"
    add("--policies", nargs="+", metavar="POLICY", help=text)
    add("--episodes", type=int, default=8, help="of each dataset, each on a flow of its own")
    add("--instances", default="train", help="set of the flows: nominal, train, val, test or ood")


def _dataset(options: argparse.Namespace) -> Outcome:
    from sph_gym.env.build_datasets import collect

    for id_ in collect(options.scenes, options.policies, options.episodes, options.instances):
        print(id_, flush=True)
    return Outcome()
