"""Validation during a training: episodes side by side on threads, their curve, the best network."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
from stable_baselines3.common.callbacks import BaseCallback

from agents.evaluate import play, summarise, write_csv
from agents.exports import checked_export
from agents.policies import play_network
from sph_gym.controllers import Network
from sph_gym.env.instances import SIZES
from sph_gym.env.selection import members
from sph_gym.env.tuning import TuningEnv
from sph_gym.env.vector import side_by_side
from sph_gym.solver.checks import whole

# File of the best network.
NETWORK = "network.npz"
# Columns of the curve besides the mean return of every scene.
STEPS, RETURN, WORK, BLOWUP = "steps", "return", "work", "blowup"


def validation_ids(scene: str, count: int) -> list[str]:
    """Return the first `count` validation instances of a scene, or of each scene of a group.

    Raises ValueError for unknown scenes, and for more than there are.
    """
    if not 1 <= whole("n_evaluations", count) <= SIZES["val"]:
        raise ValueError(f"n_evaluations: expected 1 to {SIZES['val']}, got {count}")
    return [f"{name}/val/{k}" for name in members(scene) for k in range(count)]


def training_ids(scene: str, first: int, count: int) -> list[tuple[int, str]]:
    """Return `count` training instances of a scene, or of each of a group, each with its number.

    They begin with number `first`; after the last instance the first one comes again.
    """
    size = SIZES["train"]
    return [
        (k, f"{name}/train/{k % size}")
        for name in members(scene)
        for k in range(first, first + count)
    ]


def play_episode(network: Network, action_mode: str, id_: str) -> dict[str, Any]:
    """Play an episode on an instance; return its summary, with "scene"."""
    scene = id_.split("/")[0]
    env = TuningEnv(scene, action_mode=action_mode)
    return summarise(play(env, play_network(network), id_, seed=0), env.n_steps) | {"scene": scene}


@dataclass
class Validation:
    """Validation of a training; `judge` is to be called now and then.

    instances: the episodes of every validation; folder: gets validation.csv, a row a validation,
    and network.npz, the best network so far, at first in place of a former run's; resume: go on
    from the curve that is there.
    The measure is the mean return per planned step, so that all episodes count alike.
    """

    instances: list[str]
    folder: Path
    action_mode: str
    resume: bool = False

    def __post_init__(self) -> None:
        self.curve = self._read() if self.resume else []

    @property
    def network(self) -> Path:
        """File of the best network."""
        return self.folder / NETWORK

    def judge(self, network: Network, steps: int) -> bool:
        """Play all instances after so many training steps; return whether it is the best so far."""
        tasks = [partial(play_episode, network, self.action_mode, id_) for id_ in self.instances]
        episodes = pd.DataFrame(side_by_side(tasks))
        row = {STEPS: steps} | episodes[[RETURN, WORK, BLOWUP]].mean().to_dict()
        row |= episodes.groupby("scene")[RETURN].mean().to_dict()
        best = all(row[RETURN] > former[RETURN] for former in self.curve)
        self.curve.append(row)
        if best:
            network.save(self.network)
        write_csv(pd.DataFrame(self.curve), self.folder / "validation.csv")
        return best

    def end_round(self, number: int, network: Network, count: int, lessons: str) -> Path:
        """Judge the network of a round, keep it, and return its file, the next learner.

        count, lessons: how many of what it has learned from.
        """
        self.judge(network, count)
        path = self.folder / f"round{number}.npz"
        network.save(path)
        earned = self.curve[-1][RETURN]
        print(f"round {number}: {count} {lessons}, mean return {earned:.3f}")
        return path

    def _read(self) -> list[dict[str, Any]]:
        path = self.folder / "validation.csv"
        try:
            table = pd.read_csv(path)
            table[[STEPS, RETURN]].to_numpy(float)
            return [dict(row) for row in table.to_dict("records")]
        except FileNotFoundError:
            return []
        except (ValueError, KeyError, TypeError) as error:
            warnings.warn(f"{path} is damaged, the curve starts again: {error}", stacklevel=2)
            return []


class ValidationCallback(BaseCallback):
    """Validates a model of Stable-Baselines3 every so many of its calls, and at the end.

    every: calls, of one step of all environments each; export: makes a plain network of the model;
    report: is told the steps and the mean return. Keeps best_model.zip beside the best network.
    """

    def __init__(
        self,
        validation: Validation,
        every: int,
        export: Callable[[Any], Network],
        report: Callable[[int, float], None] | None = None,
    ) -> None:
        super().__init__()
        self._validation, self._every = validation, every
        self._export, self._report = export, report

    def _on_step(self) -> bool:
        if self.n_calls % self._every == 0:
            self._validate()
        return True

    def _on_training_end(self) -> None:
        curve = self._validation.curve
        if not curve or curve[-1][STEPS] < self.num_timesteps:
            self._validate()

    def _validate(self) -> None:
        network = checked_export(self.model, self._export)
        if self._validation.judge(network, self.num_timesteps):
            self.model.save(self._validation.folder / "best_model")
        row = self._validation.curve[-1]
        for name, value in row.items():
            if name != STEPS:
                self.logger.record(f"validation/{name}", value)
        self.logger.dump(self.num_timesteps)
        if self._report is not None:
            self._report(self.num_timesteps, row[RETURN])
