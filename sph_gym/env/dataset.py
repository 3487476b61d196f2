"""Episodes as a Minari dataset, for offline learning."""

import json
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from sph_gym.env import manifest
from sph_gym.extras import needs_extra
from sph_gym.solver.checks import whole

# (environment, observation) -> action
Policy = Callable[[gym.Env[Any, Any], NDArray[Any]], Any]


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
    _prepare(dataset_id)
    import minari

    made = dict(arguments or {})
    if made.get("reward") == "vector":
        # Gymnasium's checker knows scalars only
        made = {"disable_env_checker": True} | made
    env = gym.make(env_id, **made)
    buffers, shown = [], list[str]()
    for k in range(n_episodes):
        options = {"instance": instance_ids[k % len(instance_ids)]} if instance_ids else None
        buffers.append(_play(env, policy, seed + k, options))
        unwrapped: Any = env.unwrapped
        shown.append(json.dumps(unwrapped.instance._asdict()))
    with warnings.catch_warnings():
        # author, e-mail and link to the code are optional
        warnings.filterwarnings("ignore", r".* is set to None", UserWarning)
        # a picture of numbers must come back as it was
        dataset = minari.create_dataset_from_buffers(
            dataset_id, buffers, env=env, jpeg_encoding=False, **metadata
        )
    env.close()
    dataset.storage.update_metadata({"manifest_version": manifest.VERSION})
    dataset.storage.update_episode_metadata(map(_summary, buffers, shown))
    return dataset


def _prepare(dataset_id: str) -> None:
    """Check that the dataset can be written, before anything is played."""
    with needs_extra("agents"):
        from minari.dataset.minari_dataset import parse_dataset_id
        from minari.namespace import create_namespace, list_local_namespaces
        from minari.storage.datasets_root_dir import get_dataset_path
    try:
        namespace, _, _ = parse_dataset_id(dataset_id)
    except (ValueError, TypeError):  # minari trips over a name without a version
        raise ValueError(
            f"dataset: expected a name such as sph_gym/dam_break/mine-v0, got {dataset_id!r}"
        ) from None
    if get_dataset_path(dataset_id).exists():
        raise ValueError(f"dataset: {dataset_id} exists already, choose another name or version")
    if namespace is not None and namespace not in list_local_namespaces():
        create_namespace(namespace)


def _play(env: gym.Env[Any, Any], policy: Policy, seed: int, options: dict[str, Any] | None) -> Any:
    """Play one episode and return it as an `EpisodeBuffer`.

    `minari.DataCollector` would do the same, but asks for jax to append to lists.
    """
    from minari.data_collector.episode_buffer import EpisodeBuffer

    observation, info = env.reset(seed=seed, options=options)
    observations, infos = [observation], {key: [value] for key, value in info.items()}
    actions: list[Any] = []
    buffer = EpisodeBuffer(
        seed=seed, options=options, observations=observations, actions=actions, infos=infos
    )
    over = False
    while not over:
        action = policy(env, observation)
        observation, reward, terminated, truncated, info = env.step(action)
        over = terminated or truncated
        actions.append(action)
        observations.append(observation)
        buffer.rewards.append(reward)
        buffer.terminations.append(terminated)
        buffer.truncations.append(truncated)
        for key, value in info.items():
            infos[key].append(value)
    return buffer


def _summary(buffer: Any, instance: str) -> dict[str, Any]:
    """Return an episode's metadata besides seed and options."""
    return {
        "instance": instance,
        "instance_id": buffer.infos["instance_id"][0],
        "blowup_cause": buffer.infos["blowup_cause"][-1],
        "rewards_sum": float(np.sum(buffer.rewards)),
    }
