"""What PPO, SAC and DQN share: environments on threads, callbacks, interruption, export."""

import shutil
import sys
import warnings
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch
import yaml
from stable_baselines3 import DQN, PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import (
    BaseCallback,
    CallbackList,
    CheckpointCallback,
    EvalCallback,
)
from stable_baselines3.common.monitor import Monitor

from agents.policies import trained_network
from sph_gym.controllers import Network
from sph_gym.env import env_id
from sph_gym.env.stable_baselines import TuningVecEnv

HYPERPARAMS = Path(__file__).parent / "hyperparams"
# Largest change of an action that the exported network may show against the original.
EXPORT_TOLERANCE = 1e-5
# Algorithms that choose between actions.
CHOOSING = ("dqn",)


@dataclass
class Args:
    """Train on the training instances, keep the best model on the validation instances."""

    scene: str = "dam_break"
    """scene of the environment"""
    steps: int = 300_000
    """environment steps"""
    n_envs: int = 2
    """environments, side by side on threads"""
    seed: int = 0
    """seed of everything"""
    output: Path = Path("runs")
    """folder for checkpoints, TensorBoard logs and models"""
    evaluate_every: int = 10_000
    """steps between two evaluations"""
    n_evaluations: int = 8
    """validation episodes of an evaluation"""
    resume: bool = False
    """go on from the newest checkpoint; needs --trust-checkpoints"""
    trust_checkpoints: bool = False
    """checkpoints are pickles: loading one runs whatever code is in it; say that they are yours"""
    ship: bool = False
    """also write the best model to agents/trained"""


class ValidationEnv(gym.Wrapper[Any, Any, Any, Any]):
    """Plays the validation instances in turn, so that every evaluation sees the same ones."""

    def __init__(self, env: gym.Env[Any, Any], scene: str, count: int) -> None:
        super().__init__(env)
        self._ids = [f"{scene}/val/{k}" for k in range(count)]
        self._next = 0

    def reset(self, **arguments: Any) -> Any:
        """The next validation instance."""
        arguments["options"] = {"instance": self._ids[self._next % len(self._ids)]}
        self._next += 1
        return self.env.reset(**arguments)


def hyperparameters(algorithm: str, scene: str) -> dict[str, Any]:
    """The YAML entry of an environment id, or the default one."""
    table = yaml.safe_load((HYPERPARAMS / f"{algorithm}.yml").read_text())
    return dict(table.get(env_id(scene), table["default"]))


def linear(start: float) -> Any:
    """A learning rate that falls to zero with the remaining progress."""
    return lambda remaining: start * remaining


def action_mode(algorithm: str) -> str:
    """The kind of actions that an algorithm can learn."""
    return "discrete" if algorithm in CHOOSING else "absolute"


def make_envs(algorithm: str, args: Args) -> TuningVecEnv:
    """Training environments, side by side on threads."""
    envs = TuningVecEnv(
        args.n_envs, scene=args.scene, instances="train", action_mode=action_mode(algorithm)
    )
    envs.seed(args.seed)
    return envs


def folder(algorithm: str, args: Args) -> Path:
    """Where a training run keeps its files."""
    return args.output / f"{algorithm}_{args.scene}"


def newest_checkpoint(path: Path) -> Path:
    """The checkpoint to go on from: the newest that is whole.

    Raises FileNotFoundError if there is none.
    """
    found = sorted((path / "checkpoints").glob("*.zip"), key=lambda file: file.stat().st_mtime)
    for file in reversed(found):
        if _is_whole(file):
            return file
        print(f"damaged, and left out: {file}", file=sys.stderr)
    raise FileNotFoundError(f"nothing to resume: no checkpoints in {path / 'checkpoints'}")


def _is_whole(path: Path) -> bool:
    """Whether a model's file was written to its end; nothing in it is unpickled."""
    try:
        with zipfile.ZipFile(path) as archive:
            # torn within one of the archives that it holds, it ends like a whole one
            return "data" in archive.namelist() and archive.testzip() is None
    except (OSError, zipfile.BadZipFile, zlib.error):
        return False


def load(kind: type[BaseAlgorithm], path: Path, envs: TuningVecEnv, trusted: bool) -> BaseAlgorithm:
    """A Stable-Baselines3 model, which is a pickle.

    Raises ValueError unless the user has said that it is to be trusted.
    """
    if not trusted:
        raise ValueError(
            f"trust_checkpoints: expected True to load {path}: Stable-Baselines3 files are "
            "pickles, and loading one runs whatever code is in it, got False; exported networks "
            "(.npz) hold numbers only"
        )
    return kind.load(path, env=envs, device="cpu")


def callbacks(algorithm: str, args: Args) -> BaseCallback:
    """Checkpoints, and evaluation on the validation instances with the best model kept."""
    path = folder(algorithm, args)
    every = max(args.evaluate_every // args.n_envs, 1)
    one = gym.make(env_id(args.scene), instances="val", action_mode=action_mode(algorithm))
    validation = Monitor(ValidationEnv(one, args.scene, args.n_evaluations))
    evaluation = EvalCallback(
        validation,
        n_eval_episodes=args.n_evaluations,
        eval_freq=every,
        best_model_save_path=str(path),
        callback_on_new_best=_Exporter(path / "network.npz"),
        log_path=str(path),
        verbose=1,
    )
    if args.resume:
        recall(evaluation, path / "evaluations.npz")
    checkpoints = CheckpointCallback(every, str(path / "checkpoints"), name_prefix=algorithm)
    return CallbackList([checkpoints, evaluation])


def recall(evaluation: EvalCallback, log: Path) -> None:
    """Take up the evaluations of the run that goes on: its best model is the one to beat."""
    try:
        with log.open("rb") as file, np.load(file, allow_pickle=False) as found:
            steps, results, lengths = (found[n] for n in ("timesteps", "results", "ep_lengths"))
    except FileNotFoundError:
        return
    except Exception as error:  # zipfile.BadZipFile and what else a torn file can raise
        warnings.warn(f"{log} is damaged, evaluations begin anew: {error}", stacklevel=2)
        return
    evaluation.best_mean_reward = float(results.mean(axis=1).max())
    if results.shape[1] == evaluation.n_eval_episodes:
        evaluation.evaluations_timesteps = steps.tolist()
        evaluation.evaluations_results = results.tolist()
        evaluation.evaluations_length = lengths.tolist()


def train(kind: type[BaseAlgorithm], algorithm: str, args: Args) -> None:
    """Train a stable-baselines3 algorithm, with everything it leaves behind in its folder.

    kind: PPO, SAC or DQN; algorithm: the name of its YAML file and of its folder.
    """
    # the networks are small, and the threads of the environments want the cores
    torch.set_num_threads(1)
    path, envs = folder(algorithm, args), make_envs(algorithm, args)
    if args.resume:
        model = load(kind, newest_checkpoint(path), envs, args.trust_checkpoints)
    else:
        # a former run's is not this one's best
        for old in (path / "network.npz", path / "best_model.zip"):
            old.unlink(missing_ok=True)
        settings = hyperparameters(algorithm, args.scene)
        settings["learning_rate"] = linear(settings["learning_rate"])
        logs = str(path / "tensorboard")
        make: Any = kind
        model = make(
            "MlpPolicy", envs, tensorboard_log=logs, seed=args.seed, device="cpu", **settings
        )
    learn(model, algorithm, args)
    envs.close()


def learn(model: BaseAlgorithm, algorithm: str, args: Args) -> None:
    """Train, export the best model; Ctrl-C ends the training and still exports."""
    path = folder(algorithm, args)
    left = args.steps - model.num_timesteps
    try:
        model.learn(
            max(left, 0),
            callback=callbacks(algorithm, args),
            tb_log_name="train",
            reset_num_timesteps=not args.resume,
            progress_bar=True,
        )
    except KeyboardInterrupt:
        print("interrupted: what has been learned so far is kept")
    model.save(path / "last_model")
    # the best one is there if there was an evaluation; its .zip is not loaded for it
    network, best = path / "network.npz", path / "best_model.zip"
    if not network.exists():
        export(model).save(network)
    print(f"policy: {network}")
    if args.ship:
        target = trained_network(algorithm, args.scene)
        shutil.copyfile(network, target)
        archive = best if best.exists() else path / "last_model.zip"
        shutil.copyfile(archive, target.with_suffix(".zip"))
        print(f"shipped: {target}")


class _Exporter(BaseCallback):
    """Writes the network of the model that has just turned out best."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = path

    def _on_step(self) -> bool:
        export(self.model).save(self._path)
        return True


def export(model: BaseAlgorithm) -> Network:
    """The deterministic policy of a model as a plain network, checked against it.

    Of DQN that is the network of the values; whoever uses it chooses the largest.
    """
    if isinstance(model, PPO):
        policy: Any = model.policy
        layers = [*policy.mlp_extractor.policy_net, policy.action_net]
        squash = "clip"
    elif isinstance(model, SAC):
        actor: Any = model.actor
        layers = [*actor.latent_pi, actor.mu]
        squash = "tanh"
    elif isinstance(model, DQN):
        layers, squash = [*model.q_net.q_net], "none"
    else:
        raise ValueError(f"model: expected PPO, SAC or DQN, got {type(model).__name__}")
    linears = [layer for layer in layers if isinstance(layer, torch.nn.Linear)]
    smooth = any(isinstance(layer, torch.nn.Tanh) for layer in layers)
    network = Network(
        tuple(layer.weight.detach().numpy().copy() for layer in linears),
        tuple(layer.bias.detach().numpy().copy() for layer in linears),
        "tanh" if smooth else "relu",
        squash,
    )
    _check_export(model, network)
    return network


def _check_export(model: BaseAlgorithm, network: Network) -> None:
    model.observation_space.seed(0)
    for _ in range(20):
        observation = model.observation_space.sample()
        wanted, _ = model.predict(observation, deterministic=True)
        found: Any = network(observation)
        if network.squash == "none":
            found = found.argmax()
        difference = abs(wanted - found).max()
        if difference > EXPORT_TOLERANCE:
            raise RuntimeError(f"the exported network is off by {difference:g}")
