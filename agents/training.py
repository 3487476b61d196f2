"""Shared parts of all trainings: arguments, environments, checkpoints, interruption, export."""

import copy
import shutil
import sys
import time
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from inspect import signature
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import torch
import yaml
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback, CallbackList, CheckpointCallback
from stable_baselines3.common.vec_env import VecEnv

from agents import cards
from agents.arguments import SCENE_HELP, command, option
from agents.exports import checked_export
from agents.validation import NETWORK, Validation, ValidationCallback, validation_ids
from sph_gym.controllers import Network
from sph_gym.env import actions, env_id
from sph_gym.env.layouts import action_layout, observation_layout
from sph_gym.env.rules import Rules
from sph_gym.env.stable_baselines import TuningVecEnv
from sph_gym.solver.checks import known, whole

Model = TypeVar("Model", bound=BaseAlgorithm)
FOLDER = Path(__file__).parent
# Kinds of actions for algorithms that learn three numbers.
CONTINUOUS = tuple(mode for mode in actions.MODES if mode != "discrete")


@dataclass
class TrainingArgs:
    """Arguments of a training, the same for every algorithm; hyperparams/*.yml has the others."""

    scene: str = option(SCENE_HELP, "dam_break")
    steps: int = option("environment steps", 300_000)
    n_envs: int = option("environments, side by side on threads", 2)
    seed: int = option("seed of everything", 0)
    output: Path = option("folder for checkpoints, TensorBoard logs and models", Path("runs"))
    evaluate_every: int = option("steps between two validations", 20_000)
    n_evaluations: int = option("validation episodes on each scene", 4)
    resume: bool = option("go on from the newest checkpoint; needs --trust-checkpoints", False)
    trust_checkpoints: bool = option(
        "checkpoints are pickles: loading one runs whatever code is in it; say that they are yours",
        False,
    )
    ship: bool = option("also put the best network into the package, with a card", False)
    hyperparams: Path | None = option(
        "file of hyperparameters instead of agents/hyperparams/ALGORITHM.yml", None
    )

    def __post_init__(self) -> None:
        for name in ("steps", "n_envs", "evaluate_every"):
            whole(name, getattr(self, name), at_least=1)
        whole("seed", self.seed)
        validation_ids(self.scene, self.n_evaluations)
        if self.hyperparams is not None and not self.hyperparams.is_file():
            raise ValueError(f"hyperparams: there is no file {self.hyperparams}")


class Trial(NamedTuple):
    """A training that is one of many, to find hyperparameters.

    settings: hyperparameters instead of those of the YAML file, those within groups as
    "group.name"; report: is told steps and mean return of every validation, and may raise to end
    the training; silent: whether it shows no progress bar of its own.
    """

    settings: dict[str, Any]
    report: Callable[[int, float], None]
    silent: bool = False


@dataclass(frozen=True)
class Training:
    """One training of an algorithm.

    algorithm: name of its YAML file and of its folder; export: makes a plain network of a model and
    its action mode; trial: None for a training by itself.
    """

    algorithm: str
    args: TrainingArgs
    export: Callable[[Any, str], Network]
    trial: Trial | None = None

    @property
    def name(self) -> str:
        """Name of what is trained: the algorithm, with other hyperparameters their file's too."""
        file = self.args.hyperparams
        if file is None:
            return self.algorithm
        own = file.stem.partition("-")[0] == self.algorithm
        return file.stem if own else f"{self.algorithm}-{file.stem}"

    @property
    def folder(self) -> Path:
        """Folder of everything that the training writes."""
        return self.args.output / f"{self.name}_{self.args.scene}_seed{self.args.seed}"

    def make_envs(self) -> TuningVecEnv:
        """Return the training environments, side by side on threads."""
        # the networks are small, and the threads of the environments want the cores
        torch.set_num_threads(1)
        args = self.args
        envs = TuningVecEnv(
            args.n_envs,
            scene=args.scene,
            instances="train",
            **self.hyperparameters["env"],
        )
        envs.seed(args.seed)
        return envs

    @cached_property
    def hyperparameters(self) -> dict[str, Any]:
        """Those of the YAML file, or of the trial; "env" has those of the environments.

        Read once: who edits the file meanwhile means the next training.
        """
        found = hyperparameters(self.algorithm, self.args.scene, self.args.hyperparams)
        return found if self.trial is None else replaced(found, self.trial.settings)

    @property
    def action_mode(self) -> str:
        """Kind of the actions that it learns."""
        return self.hyperparameters["env"]["action_mode"]

    def plain(self, model: Any) -> Network:
        """Return a model as a plain network."""
        return self.export(model, self.action_mode)

    def settings(self) -> dict[str, Any]:
        """Return the arguments of a new model; its learning rate falls linearly to zero."""
        found = copy.deepcopy(self.hyperparameters)
        del found["env"]
        return found | {
            "learning_rate": linear(found["learning_rate"]),
            "tensorboard_log": str(self.folder / "tensorboard"),
            "seed": self.args.seed,
            "device": "cpu",
        }

    def model(
        self, kind: type[Model], envs: VecEnv, settings: Mapping[str, Any] | None = None
    ) -> Model:
        """Return a new model, or that of the newest checkpoint if the training is resumed.

        settings: arguments of a new one, by default all hyperparameters.
        """
        if self.args.resume:
            return kind.load(self.checkpoint(), env=envs, device="cpu")
        return new_model(kind, envs, self.settings() if settings is None else settings)

    def checkpoint(self) -> Path:
        """Return the newest complete checkpoint, which is a pickle.

        Raises FileNotFoundError if there is none, ValueError unless it is to be trusted and was
        made with the same layouts.
        """
        path = newest_checkpoint(self.folder)
        self._check_layouts()
        if not self.args.trust_checkpoints:
            raise ValueError(
                f"trust_checkpoints: expected True to load {path}: Stable-Baselines3 files are "
                "pickles, and loading one runs whatever code is in it, got False; exported "
                "networks (.npz) hold numbers only"
            )
        return path

    def _check_layouts(self) -> None:
        """Raise ValueError if the network that is there has other layouts than this training.

        Spaces don't tell: those of "absolute", "stable" and "delta" are equal.
        """
        path, mode = self.folder / NETWORK, self.action_mode
        if not path.exists():
            return
        kept = Network.load(path)
        found = kept.observation, kept.action
        wanted = observation_layout(Rules(action_mode=mode)), action_layout(mode)
        if found != wanted:
            raise ValueError(
                f"resume: expected a training with layouts {wanted}, as the hyperparameters have "
                f"them now, got one with {found} ({path})"
            )

    def learn(self, model: BaseAlgorithm, more: Sequence[BaseCallback] = ()) -> None:
        """Train, export the best model, close its environments.

        more: callbacks besides checkpoints and validations. Ctrl-C ends the training, which still
        exports; of a trial, it ends the others, too.
        """
        args, began = self.args, time.monotonic()
        ids = validation_ids(args.scene, args.n_evaluations)
        validation = Validation(ids, self.folder, self.action_mode, args.resume)
        if not validation.curve:
            # one of a former run would be exported as what this one has learned
            validation.network.unlink(missing_ok=True)
        if not args.resume:
            # else --resume could take up the training before this one
            (self.folder / "best_model.zip").unlink(missing_ok=True)
            shutil.rmtree(self.folder / "checkpoints", ignore_errors=True)
        try:
            model.learn(
                max(args.steps - model.num_timesteps, 0),
                callback=CallbackList([*more, *self._callbacks(validation)]),
                tb_log_name="train",
                reset_num_timesteps=not args.resume,
                progress_bar=self.trial is None or not self.trial.silent,
            )
        except KeyboardInterrupt:
            if self.trial is not None:
                raise
            print("interrupted: what has been learned so far is kept")
        model.save(self.folder / "last_model.zip")
        # without a validation there is no best model
        if not validation.network.exists():
            checked_export(model, self.plain).save(validation.network)
        print(f"policy: {validation.network}")
        if args.ship:
            self._ship(validation.network, minutes=round((time.monotonic() - began) / 60))
        if (envs := model.get_env()) is not None:
            envs.close()

    def _ship(self, network: Path, minutes: int) -> None:
        """Put the network into the package, with a card."""
        args = self.args
        target = cards.ship(
            network, self.name, args.scene,
            how=f"{args.steps} steps with the hyperparameters {self.hyperparameters}; kept is the "
            "network that was best on "
            f"{len(validation_ids(args.scene, args.n_evaluations))} validation flows.",
            command=command(), seed=args.seed, minutes=minutes,
        )  # fmt: skip
        print(f"shipped: {target}")

    def _callbacks(self, validation: Validation) -> list[BaseCallback]:
        """Return checkpoints, and validations that keep the best network."""
        every = max(self.args.evaluate_every // self.args.n_envs, 1)
        folder = str(self.folder / "checkpoints")
        report = None if self.trial is None else self.trial.report
        return [
            CheckpointCallback(every, folder, self.algorithm),
            ValidationCallback(validation, every, self.plain, report),
        ]


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


def new_model(kind: type[Model], envs: VecEnv, settings: Mapping[str, Any]) -> Model:
    """Return a new model with hyperparameters. Raises ValueError for one that it doesn't take."""
    taken = {name for base in kind.__mro__ for name in signature(base).parameters}
    names = sorted(taken - {"self", "args", "kwargs"})
    for name in settings:
        known("hyperparams", name, names)
    return kind("MlpPolicy", envs, **settings)


def hyperparameters(algorithm: str, scene: str, file: Path | None = None) -> dict[str, Any]:
    """Return those of an environment id; what its YAML entry doesn't name comes from `default`.

    file: instead of the algorithm's own. Raises ValueError for a file without such entries, for
    texts where the algorithm's own file has numbers, and for an unknown kind of actions.
    """
    own = FOLDER / "hyperparams" / f"{algorithm}.yml"
    path = file or own
    try:
        table = yaml.safe_load(path.read_text())
        found = merged(table["default"], table.get(env_id(scene), {}))
        mode = found.get("env", found).get("action_mode")
    except (yaml.YAMLError, UnicodeDecodeError, KeyError, TypeError, AttributeError) as error:
        text = " ".join(str(error).split())
        raise ValueError(
            f"hyperparams: expected entries like those of {own}, got {path} ({text})"
        ) from None
    known("action_mode", mode, actions.MODES)
    if file is not None:
        _check_numbers(found, hyperparameters(algorithm, scene), path)
    return found


def _check_numbers(found: dict[str, Any], usual: dict[str, Any], path: Path) -> None:
    """Raise ValueError for a text in the place of a number, as YAML reads 7e-4."""
    for name, value in found.items():
        if isinstance(usual.get(name), (int, float)) and not isinstance(value, (int, float)):
            raise ValueError(
                f"hyperparams: expected a number for {name} in {path}, got {value!r}; a point "
                "makes one of it: 7.0e-4"
            )


def merged(default: dict[str, Any], own: dict[str, Any]) -> dict[str, Any]:
    """Return settings, those of groups as well, from `default` where `own` doesn't name them."""
    groups = {
        name: merged(default[name], value)
        for name, value in own.items()
        if isinstance(value, dict) and isinstance(default.get(name), dict)
    }
    return default | own | groups


def replaced(settings: dict[str, Any], others: dict[str, Any]) -> dict[str, Any]:
    """Return settings with others in their place; "group.name" is one within a group."""
    found = copy.deepcopy(settings)
    for name, value in others.items():
        *groups, last = name.split(".")
        place = found
        for group in groups:
            place = place.setdefault(group, {})
        place[last] = value
    return found


def linear(start: float) -> Callable[[float], float]:
    """Return a learning rate that falls to zero with the remaining progress.

    The last batch may end beyond the last step: it must not undo what was learned.
    """
    return lambda remaining: start * max(remaining, 0.0)
