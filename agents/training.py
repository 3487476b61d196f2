"""Shared parts of PPO, SAC and DQN: environments, checkpoints, evaluation, interruption, export."""

import shutil
import sys
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch
import yaml
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import (
    BaseCallback,
    CallbackList,
    CheckpointCallback,
    EvalCallback,
)
from stable_baselines3.common.monitor import Monitor

from agents.arguments import option
from sph_gym.controllers import Network
from sph_gym.controllers.network import shipped_network
from sph_gym.env import env_id
from sph_gym.env.layouts import action_layout, observation_layout
from sph_gym.env.rules import Rules
from sph_gym.env.stable_baselines import TuningVecEnv

FOLDER = Path(__file__).parent
# Largest change of an action that the exported network may show against the original.
EXPORT_TOLERANCE = 1e-5


@dataclass
class TrainingArgs:
    """Arguments of a training, the same for every algorithm; hyperparams/*.yml has the others."""

    scene: str = option("scene of the environment", "dam_break")
    steps: int = option("environment steps", 300_000)
    n_envs: int = option("environments, side by side on threads", 2)
    seed: int = option("seed of everything", 0)
    output: Path = option("folder for checkpoints, TensorBoard logs and models", Path("runs"))
    evaluate_every: int = option("steps between two evaluations", 10_000)
    n_evaluations: int = option("validation episodes of an evaluation", 8)
    resume: bool = option("go on from the newest checkpoint; needs --trust-checkpoints", False)
    trust_checkpoints: bool = option(
        "checkpoints are pickles: loading one runs whatever code is in it; say that they are yours",
        False,
    )
    ship: bool = option("also put the best network into the package", False)


@dataclass(frozen=True)
class Training:
    """One training of an algorithm.

    algorithm: name of its YAML file and of its folder; export: makes a plain network of a model;
    action_mode: the kind of actions that it can learn.
    """

    algorithm: str
    args: TrainingArgs
    export: Callable[[Any], Network]
    action_mode: str = "absolute"

    @property
    def folder(self) -> Path:
        """Folder of everything that the training writes."""
        return self.args.output / f"{self.algorithm}_{self.args.scene}"

    def make_envs(self) -> TuningVecEnv:
        """Return the training environments, side by side on threads."""
        # the networks are small, and the threads of the environments want the cores
        torch.set_num_threads(1)
        args = self.args
        envs = TuningVecEnv(
            args.n_envs, scene=args.scene, instances="train", action_mode=self.action_mode
        )
        envs.seed(args.seed)
        return envs

    def settings(self) -> dict[str, Any]:
        """Return the arguments of a new model; its learning rate falls linearly to zero."""
        found = hyperparameters(self.algorithm, self.args.scene)
        return found | {
            "learning_rate": linear(found["learning_rate"]),
            "tensorboard_log": str(self.folder / "tensorboard"),
            "seed": self.args.seed,
            "device": "cpu",
        }

    def checkpoint(self) -> Path:
        """Return the newest complete checkpoint, which is a pickle.

        Raises FileNotFoundError if there is none, ValueError unless it is to be trusted.
        """
        path = newest_checkpoint(self.folder)
        if not self.args.trust_checkpoints:
            raise ValueError(
                f"trust_checkpoints: expected True to load {path}: Stable-Baselines3 files are "
                "pickles, and loading one runs whatever code is in it, got False; exported "
                "networks (.npz) hold numbers only"
            )
        return path

    def learn(self, model: BaseAlgorithm) -> None:
        """Train, and export the best model; Ctrl-C ends the training and still exports."""
        network, best = self.folder / "network.npz", self.folder / "best_model.zip"
        if not self.args.resume:
            # the best model of a former run is not that of this one
            network.unlink(missing_ok=True)
            best.unlink(missing_ok=True)
        try:
            model.learn(
                max(self.args.steps - model.num_timesteps, 0),
                callback=self._callbacks(),
                tb_log_name="train",
                reset_num_timesteps=not self.args.resume,
                progress_bar=True,
            )
        except KeyboardInterrupt:
            print("interrupted: what has been learned so far is kept")
        model.save(self.folder / "last_model")
        # without an evaluation there is no best model
        if not network.exists():
            checked_export(model, self.exported).save(network)
        print(f"policy: {network}")
        if self.args.ship:
            self._ship(network, best if best.exists() else self.folder / "last_model.zip")

    def exported(self, model: Any) -> Network:
        """Return the plain network of a model, with the layouts that it was trained with."""
        rules = Rules(action_mode=self.action_mode)
        layouts = observation_layout(rules), action_layout(self.action_mode)
        return replace(self.export(model), observation=layouts[0], action=layouts[1])

    def _ship(self, network: Path, model: Path) -> None:
        """Copy the network into the package, and the model that it was made of beside this file."""
        target = shipped_network(self.algorithm, self.args.scene)
        origin = FOLDER / "trained" / f"{target.stem}.zip"
        for source, copy in ((network, target), (model, origin)):
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, copy)
        print(f"shipped: {target}")

    def _callbacks(self) -> BaseCallback:
        """Return checkpoints, and evaluations on the validation instances that keep the best."""
        args, count = self.args, self.args.n_evaluations
        every = max(args.evaluate_every // args.n_envs, 1)
        env = gym.make(env_id(args.scene), instances="val", action_mode=self.action_mode)
        evaluation = EvalCallback(
            Monitor(ValidationEnv(env, args.scene, count)),
            n_eval_episodes=count,
            eval_freq=every,
            best_model_save_path=str(self.folder),
            callback_on_new_best=_Exporter(self.exported, self.folder / "network.npz"),
            log_path=str(self.folder),
            verbose=1,
        )
        if args.resume:
            recall(evaluation, self.folder / "evaluations.npz")
        folder = str(self.folder / "checkpoints")
        return CallbackList([CheckpointCallback(every, folder, self.algorithm), evaluation])


class ValidationEnv(gym.Wrapper[Any, Any, Any, Any]):
    """Plays the validation instances in turn, so that every evaluation sees the same ones."""

    def __init__(self, env: gym.Env[Any, Any], scene: str, count: int) -> None:
        super().__init__(env)
        self._ids = [f"{scene}/val/{k}" for k in range(count)]
        self._next = 0

    def reset(self, **arguments: Any) -> Any:
        """Begin the next validation instance."""
        arguments["options"] = {"instance": self._ids[self._next % len(self._ids)]}
        self._next += 1
        return self.env.reset(**arguments)


class _Exporter(BaseCallback):
    """Writes the network of the model that has just turned out best."""

    def __init__(self, export: Callable[[Any], Network], path: Path) -> None:
        super().__init__()
        self._export, self._path = export, path

    def _on_step(self) -> bool:
        checked_export(self.model, self._export).save(self._path)
        return True


def hyperparameters(algorithm: str, scene: str) -> dict[str, Any]:
    """Return the YAML entry of an environment id, or the default one."""
    table = yaml.safe_load((FOLDER / "hyperparams" / f"{algorithm}.yml").read_text())
    return dict(table.get(env_id(scene), table["default"]))


def linear(start: float) -> Callable[[float], float]:
    """Return a learning rate that falls to zero with the remaining progress."""
    return lambda remaining: start * remaining


def newest_checkpoint(folder: Path) -> Path:
    """Return the newest checkpoint that was written to its end.

    Raises FileNotFoundError if there is none.
    """
    found = sorted((folder / "checkpoints").glob("*.zip"), key=lambda file: file.stat().st_mtime)
    for file in reversed(found):
        if _is_complete(file):
            return file
        print(f"damaged, and left out: {file}", file=sys.stderr)
    raise FileNotFoundError(f"nothing to resume: no checkpoints in {folder / 'checkpoints'}")


def _is_complete(path: Path) -> bool:
    """Return whether the file of a model was written to its end; nothing in it is unpickled."""
    try:
        with zipfile.ZipFile(path) as archive:
            # torn within one of the archives that it holds, it ends like a complete one
            return "data" in archive.namelist() and archive.testzip() is None
    except (OSError, zipfile.BadZipFile, zlib.error):
        return False


def recall(evaluation: EvalCallback, log: Path) -> None:
    """Take over the evaluations of the run that goes on: its best model is the one to beat."""
    try:
        with log.open("rb") as file, np.load(file, allow_pickle=False) as found:
            steps, results, lengths = (found[n] for n in ("timesteps", "results", "ep_lengths"))
    except FileNotFoundError:
        return
    except Exception as error:  # zipfile.BadZipFile and what else a torn file can raise
        warnings.warn(f"{log} is damaged, evaluations start again: {error}", stacklevel=2)
        return
    evaluation.best_mean_reward = float(results.mean(axis=1).max())
    if results.shape[1] == evaluation.n_eval_episodes:
        evaluation.evaluations_timesteps = steps.tolist()
        evaluation.evaluations_results = results.tolist()
        evaluation.evaluations_length = lengths.tolist()


def plain_network(layers: Iterable[torch.nn.Module], squash: str) -> Network:
    """Return the layers of a perceptron with tanh or ReLU units as a plain network."""
    layers = list(layers)
    linears = [layer for layer in layers if isinstance(layer, torch.nn.Linear)]
    smooth = any(isinstance(layer, torch.nn.Tanh) for layer in layers)
    return Network(
        tuple(layer.weight.detach().numpy().copy() for layer in linears),
        tuple(layer.bias.detach().numpy().copy() for layer in linears),
        "tanh" if smooth else "relu",
        squash,
    )


def checked_export(model: BaseAlgorithm, export: Callable[[Any], Network]) -> Network:
    """Return the exported network of a model; RuntimeError if it acts in another way."""
    network = export(model)
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
    return network
