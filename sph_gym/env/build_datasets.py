"""Write Minari datasets of the rule, the oracle and random actions for every environment."""

import json
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from sph_gym import provenance
from sph_gym.controllers import AdaptiveRule, TunedCfl
from sph_gym.env import dataset, instances
from sph_gym.env.dataset import EpisodeRecord
from sph_gym.env.distributions import FAMILIES
from sph_gym.env.oracle import Oracle
from sph_gym.env.policies import Policy, draw_at_random, follow
from sph_gym.env.registration import VERSION, env_id
from sph_gym.extras import needs_extra, progress_bar
from sph_gym.files import atomic_write, cache_home
from sph_gym.solver import jit
from sph_gym.solver.checks import known, whole

# Parts of an `EpisodeRecord` that have one array each; the others are texts.
ARRAYS = ("observations", "actions", "rewards", "terminations", "truncations")


class Recorded(NamedTuple):
    """A policy of the datasets: what makes it for the episode of a seed, and what it does."""

    make: Callable[[int], Policy]
    description: str


POLICIES = {
    "tuned-rule": Recorded(lambda seed: follow(TunedCfl()), "the tuned CFL rule"),
    "oracle": Recorded(
        lambda seed: Oracle(), "a search that sees the reference and the future: a bound"
    ),
    "random": Recorded(draw_at_random, "actions that are drawn evenly from the whole box"),
    "adaptive-rule": Recorded(
        lambda seed: follow(AdaptiveRule()), "the tuned CFL rule, its epsilon by measured noise"
    ),
}
# Policies that are recorded by default.
USUAL = ("tuned-rule", "oracle", "random")
# The set that ids of datasets don't name.
USUAL_SET = "train"


class Plan(NamedTuple):
    """A dataset to be written: the policy plays episode k on flow k of a set, with the seed k."""

    scene: str
    policy: str
    split: str
    n_episodes: int

    @property
    def id(self) -> str:
        """Id of the dataset."""
        split = "" if self.split == USUAL_SET else f"-{self.split}"
        return f"sph_gym/{self.scene}/{self.policy}{split}-{VERSION}"

    def instance(self, k: int) -> str:
        """Return the id of the flow of episode k."""
        return f"{self.scene}/{self.split}/{k}"


def collect(
    scenes: Sequence[str] | None = None,
    policies: Sequence[str] | None = None,
    n_episodes: int = 8,
    split: str = USUAL_SET,
) -> Iterator[str]:
    """Write a dataset for each scene and policy, with a progress bar; yield ids as they are done.

    Finished episodes are kept on disk until their dataset is written, and datasets that are there
    are left alone: it can be stopped and run again. Raises ValueError for unknown names, for more
    episodes than the set has flows, and for a dataset that is there with other episodes, all
    before anything is played; ImportError that names the extra to install.
    """
    plans = _plans(scenes, policies, n_episodes, split)
    left = [plan for plan in plans if not _is_there(plan)]
    with progress_bar(len(left) * n_episodes, unit="episode") as bar:
        for plan in plans:
            if plan in left:
                bar.set_description(f"{plan.scene} {plan.policy}")
                _write(plan, bar)
            yield plan.id


def _plans(
    scenes: Sequence[str] | None, policies: Sequence[str] | None, n_episodes: int, split: str
) -> list[Plan]:
    names = [known("scenes", name, FAMILIES) for name in scenes or FAMILIES]
    chosen = [known("policies", name, POLICIES) for name in policies or USUAL]
    most = instances.SIZES[known("instances", split, instances.SIZES)]
    n_episodes = whole("episodes", n_episodes, at_least=1)
    if n_episodes > most:
        raise ValueError(
            f"episodes: expected at most {most}, the flows of {split!r}, got {n_episodes}"
        )
    return [Plan(name, policy, split, n_episodes) for name in names for policy in chosen]


def _is_there(plan: Plan) -> bool:
    """Return whether the dataset is there.

    Raises ValueError if it holds other episodes, or observations or actions of other layouts.
    """
    with needs_extra("agents"):
        import minari
        from minari.storage.datasets_root_dir import get_dataset_path
    place = get_dataset_path(plan.id)
    if not place.exists():
        return False
    wanted = [plan.instance(k) for k in range(plan.n_episodes)]
    found = minari.load_dataset(plan.id)
    about = found.storage.get_episode_metadata(range(found.total_episodes))
    if [one["instance_id"] for one in about] != wanted:
        raise ValueError(
            f"dataset: {plan.id} is there with other episodes ({found.total_episodes} of them); "
            f"delete {place} to write it anew, or ask for the same ones"
        )
    present = dataset.layouts(gym.make(env_id(plan.scene)))
    written = found.storage.metadata.get("layouts")
    if written != present:
        raise ValueError(
            f"dataset: {plan.id} has the layouts {written}, and environments have {present}: "
            f"delete {place} to write it anew"
        )
    return True


def _write(plan: Plan, bar: Any) -> None:
    dataset.prepare(plan.id)
    env = gym.make(env_id(plan.scene))
    kept = [_kept(plan, k) for k in range(plan.n_episodes)]
    episodes = []
    for k, path in enumerate(kept):
        episode = _read(path)
        if episode is None:
            policy = POLICIES[plan.policy].make(k)
            episode = dataset.play(env, policy, k, plan.instance(k))
            with atomic_write(path) as draft:
                np.savez_compressed(draft, **_as_arrays(episode))
        episodes.append(episode)
        bar.update()
    dataset.write(
        plan.id,
        env,
        episodes,
        algorithm_name=plan.policy,
        description=f"{POLICIES[plan.policy].description}; {plan.scene}, set {plan.split!r}",
    )
    env.close()
    for path in kept:
        path.unlink(missing_ok=True)


# --- Episodes on disk -----------------------------------------------------------------------


def _kept(plan: Plan, k: int) -> Path:
    """Return where a finished episode is kept until its dataset is written."""
    sources = provenance.source_hash("solver", "scenes", "controllers", "env")
    key = provenance.content_hash(sources, jit.source_hash(), plan.policy, plan.instance(k), k)
    return cache_home() / "episodes" / f"{key}.npz"


def _as_arrays(episode: EpisodeRecord) -> dict[str, Any]:
    arrays = {name: np.array(getattr(episode, name)) for name in ARRAYS}
    infos = {f"info_{name}": np.array(values) for name, values in episode.infos.items()}
    about = json.dumps([episode.seed, episode.instance, episode.shown])
    return arrays | infos | {"about": about}


def _read(path: Path) -> EpisodeRecord | None:
    """Return a kept episode, None if there is none that can be read: it is played again then."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
            seed, instance, shown = json.loads(str(data["about"]))
            # observations and actions stay arrays, all else are plain numbers and texts
            lists: list[Any] = [list(data[name]) for name in ARRAYS[:2]]
            lists += [data[name].tolist() for name in ARRAYS[2:]]
            infos = {
                name.removeprefix("info_"): data[name].tolist()
                for name in data.files
                if name.startswith("info_")
            }
            return EpisodeRecord._make([seed, instance, shown, *lists, infos])
    except FileNotFoundError:
        return None
    except Exception as error:  # zipfile.BadZipFile and what else a torn file can raise
        warnings.warn(f"{path} is damaged, its episode is played again: {error}", stacklevel=2)
        return None
