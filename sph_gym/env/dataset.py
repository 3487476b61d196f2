"""Episodes as a Minari dataset, for offline learning."""

import json
import os
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from sph_gym.env import manifest
from sph_gym.env.layouts import action_layout, observation_layout
from sph_gym.env.policies import Policy
from sph_gym.extras import needs_extra
from sph_gym.files import atomic_write
from sph_gym.solver.checks import whole

# Variable by which minari finds its datasets.
ROOT = "MINARI_DATASETS_PATH"


class EpisodeRecord(NamedTuple):
    """A played episode.

    seed: of its reset; instance: id that was asked for, None if it was drawn; shown: identity of
    its flow (`sph_gym.env.identity.Identity`) as JSON. Then lists: observations and, by name, infos
    of the reset and of every step; actions, rewards, terminations, truncations of every step.
    """

    seed: int
    instance: str | None
    shown: str
    observations: list[Any]
    actions: list[Any]
    rewards: list[Any]
    terminations: list[bool]
    truncations: list[bool]
    infos: dict[str, list[Any]]


def record(
    env_id: str,
    policy: Policy,
    n_episodes: int,
    dataset_id: str,
    instance_ids: Sequence[str] | None = None,
    seed: int = 0,
    arguments: dict[str, Any] | None = None,
    **metadata: Any,
) -> Any:
    """Play episodes and write them as the Minari dataset `dataset_id`, which is returned.

    Episode k shows `instance_ids[k]` (over again from the first if there are fewer), or what the
    environment draws with seed + k. arguments: of the environment; metadata: what else
    `minari.create_dataset_from_buffers` takes, such as author, algorithm_name, description.
    An episode's metadata holds seed, options, instance_id, blowup_cause and rewards_sum, so that
    the recovered environment can play it again, and as "instance" the identity of its flow
    (`sph_gym.env.identity.Identity`, as JSON); the dataset's holds the manifest_version. With
    reward="vector" rewards are (n_steps, n_terms), and rewards_sum is over all terms.

    Raises ValueError for less than one episode and for a dataset that exists or whose name isn't
    NAMESPACE/NAME-vNUMBER, ImportError that names the extra to install.
    """
    n_episodes = whole("n_episodes", n_episodes, at_least=1)
    prepare(dataset_id)
    made = dict(arguments or {})
    if made.get("reward") == "vector":
        # Gymnasium's checker knows scalars only
        made = {"disable_env_checker": True} | made
    env = gym.make(env_id, **made)
    episodes = []
    for k in range(n_episodes):
        instance = instance_ids[k % len(instance_ids)] if instance_ids else None
        episodes.append(play(env, policy, seed + k, instance))
    dataset = write(dataset_id, env, episodes, **metadata)
    env.close()
    return dataset


def write(
    dataset_id: str, env: gym.Env[Any, Any], episodes: Sequence[EpisodeRecord], **metadata: Any
) -> Any:
    """Write played episodes as a new Minari dataset, which is complete or absent; return it.

    env: what they were played in; metadata: as for `record`. Raises OSError that names the file.
    """
    import minari
    from minari.storage.datasets_root_dir import get_dataset_path

    place = get_dataset_path(dataset_id)
    buffers = [_buffer(episode) for episode in episodes]
    with atomic_write(place) as draft:
        with _datasets_in(draft.parent), warnings.catch_warnings():
            # author, e-mail and link to the code are optional
            warnings.filterwarnings("ignore", r".* is set to None", UserWarning)
            # a picture of numbers must come back as it was
            dataset = minari.create_dataset_from_buffers(
                dataset_id, buffers, env=env, jpeg_encoding=False, **metadata
            )
            about = {"manifest_version": manifest.VERSION, "layouts": layouts(env)}
            dataset.storage.update_metadata(about)
            dataset.storage.update_episode_metadata(map(_summary, episodes))
            written = get_dataset_path(dataset_id)
        os.replace(written, draft)
    return minari.load_dataset(dataset_id)


def layouts(env: gym.Env[Any, Any]) -> str:
    """Return the layouts of what a dataset of an environment holds."""
    rules = env.unwrapped.rules  # type: ignore[attr-defined]
    return f"{observation_layout(rules)}, {action_layout(rules.action_mode)}"


@contextmanager
def _datasets_in(folder: Path) -> Iterator[None]:
    """Let minari look for datasets in a folder."""
    usual = os.environ.get(ROOT)
    os.environ[ROOT] = str(folder)
    try:
        yield
    finally:
        if usual is None:
            del os.environ[ROOT]
        else:
            os.environ[ROOT] = usual


def prepare(dataset_id: str) -> None:
    """Make ready for a new dataset, before anything is played.

    Raises ValueError for a dataset that exists or whose name isn't NAMESPACE/NAME-vNUMBER,
    ImportError that names the extra to install.
    """
    with needs_extra("agents"):
        from minari.dataset.minari_dataset import parse_dataset_id
        from minari.namespace import create_namespace, list_local_namespaces
        from minari.storage.datasets_root_dir import get_dataset_path
    try:
        namespace, _, _ = parse_dataset_id(dataset_id)
    except (ValueError, TypeError):  # minari trips over a name without a version
        raise ValueError(
            f"dataset: expected a name such as sph_gym/dam_break/mine-v1, got {dataset_id!r}"
        ) from None
    if get_dataset_path(dataset_id).exists():
        raise ValueError(f"dataset: {dataset_id} exists already, choose another name or version")
    if namespace is not None and namespace not in list_local_namespaces():
        create_namespace(namespace)


def play(
    env: gym.Env[Any, Any], policy: Policy, seed: int, instance: str | None = None
) -> EpisodeRecord:
    """Play one episode, on an instance or on what the environment draws."""
    options = None if instance is None else {"instance": instance}
    observation, info = env.reset(seed=seed, options=options)
    observations, infos = [observation], {key: [value] for key, value in info.items()}
    actions, outcomes, over = [], [], False
    while not over:
        action = policy(env, observation)
        observation, reward, terminated, truncated, info = env.step(action)
        over = terminated or truncated
        actions.append(action)
        observations.append(observation)
        outcomes.append((reward, terminated, truncated))
        for key, value in info.items():
            infos[key].append(value)
    rewards, terminations, truncations = map(list, zip(*outcomes, strict=True))
    unwrapped: Any = env.unwrapped
    shown = json.dumps(unwrapped.instance._asdict())
    return EpisodeRecord(
        seed, instance, shown, observations, actions, rewards, terminations, truncations, infos
    )


def _buffer(episode: EpisodeRecord) -> Any:
    """Return an episode as an `EpisodeBuffer`.

    `minari.DataCollector` would do the same, but asks for jax to append to lists.
    """
    from minari.data_collector.episode_buffer import EpisodeBuffer

    return EpisodeBuffer(
        seed=episode.seed,
        options=None if episode.instance is None else {"instance": episode.instance},
        observations=episode.observations,
        actions=episode.actions,
        rewards=episode.rewards,
        terminations=episode.terminations,
        truncations=episode.truncations,
        infos=episode.infos,
    )


def _summary(episode: EpisodeRecord) -> dict[str, Any]:
    """Return an episode's metadata besides seed and options."""
    return {
        "instance": episode.shown,
        "instance_id": episode.infos["instance_id"][0],
        "blowup_cause": episode.infos["blowup_cause"][-1],
        "rewards_sum": float(np.sum(episode.rewards)),
    }
