"""Hyperparameters of an algorithm by Optuna: `python -m agents.tune --algorithm ppo`.

The study is a journal in the output folder, to which every training adds as it ends: a study that
was interrupted goes on, and several processes can work on one at the same time, also those of a
cluster that share this folder. A training is ended early if, at the same step, it is in the worst
quarter of those that ran to their end. The best settings are printed as an entry for
hyperparams/ALGORITHM.yml.
"""

from dataclasses import dataclass, replace
from functools import reduce
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import optuna
import yaml
from optuna.distributions import (
    BaseDistribution,
    CategoricalDistribution,
    FloatDistribution,
    IntDistribution,
)
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend
from optuna.trial import TrialState

from agents.arguments import SCENE_HELP, BackendArgs, launch, option
from agents.training import FOLDER, TrainingArgs, Trial, hyperparameters, replaced
from sph_gym.env import env_id
from sph_gym.files import atomic_write
from sph_gym.solver.checks import known, whole
from sph_gym.studies.backends import Backend
from sph_gym.studies.jobs import INTERRUPTED, run_jobs
from sph_gym.studies.results import Results

# Arguments that all trainings of a study share: others give returns that can't be compared.
SHARED = ("steps", "n_envs", "evaluate_every", "n_evaluations")
# Validations before which no training is ended early, trainings before the first that may be, and
# the share [%] of those that ran to their end that it has to be among. With the median, a few good
# first ones end nearly all that follow.
WARM_UP, FIRST, AMONG = 2, 4, 75.0
ENDED = (TrialState.COMPLETE, TrialState.PRUNED)
# In this process, one training after another.
ALONE = Backend(workers=1)


@dataclass
class TuneArgs(BackendArgs):
    """Arguments of a search for hyperparameters."""

    algorithm: str = option("ppo, ppo_lagrangian, ppo_warm, sac or dqn", "ppo")
    scene: str = option(SCENE_HELP, "dam_break")
    trials: int = option("trainings that the study has when it is over", 30)
    steps: int = option("environment steps of a training", 60_000)
    n_envs: int = option("environments, side by side on threads", 2)
    evaluate_every: int = option("steps between two validations", 10_000)
    n_evaluations: int = option("validation episodes on each scene", 4)
    seed: int = option("of the sampler; another one for every process on one study", 0)
    output: Path = option("folder of the study", Path("runs"))
    workers: int | None = option("trainings side by side on this machine", 1)

    def __post_init__(self) -> None:
        self.where()
        known("algorithm", self.algorithm, spaces())
        whole("trials", self.trials, at_least=1)
        self.training(self.seed)

    def where(self) -> Backend:
        """Return the backend. Raises ValueError for an unknown name and for wrong options."""
        # a cluster with an address has workers of its own
        workers = None if self.address is not None and self.workers == 1 else self.workers
        return Backend(self.backend, self.address, workers).checked()

    @property
    def folder(self) -> Path:
        """Folder of the study and its trainings."""
        return self.output / f"tune_{self.algorithm}_{self.scene}"

    def training(self, seed: int) -> TrainingArgs:
        """Return the arguments of a training. Raises ValueError that names a wrong one."""
        shared = {name: getattr(self, name) for name in SHARED}
        return TrainingArgs(self.scene, seed=seed, output=self.folder / "trainings", **shared)


def spaces() -> dict[str, Any]:
    """Return what is tried, by algorithm."""
    return yaml.safe_load((FOLDER / "hyperparams" / "spaces.yml").read_text())


def distribution(choice: dict[str, Any]) -> BaseDistribution:
    """Return the distribution of a hyperparameter, as hyperparams/spaces.yml describes it."""
    if "choices" in choice:
        return CategoricalDistribution(choice["choices"])
    whole_numbers = isinstance(choice["low"], int) and isinstance(choice["high"], int)
    return (IntDistribution if whole_numbers else FloatDistribution)(**choice)


def open_study(args: TuneArgs) -> optuna.Study:
    """Return the study of the output folder; a new one begins with the present settings.

    Raises ValueError if its trainings were of another length, or judged in another way.
    """
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    args.folder.mkdir(parents=True, exist_ok=True)
    storage = JournalStorage(JournalFileBackend(str(args.folder / "study.log")))
    warm_up = WARM_UP * args.evaluate_every
    pruner = optuna.pruners.PercentilePruner(AMONG, FIRST, n_warmup_steps=warm_up)
    about: dict[str, Any] = {"study_name": args.folder.name, "storage": storage, "pruner": pruner}
    if args.folder.name in optuna.get_all_study_names(storage):
        # a study that is only looked at stays as it is
        study = optuna.load_study(**about)
    else:
        study = optuna.create_study(direction="maximize", load_if_exists=True, **about)
    for name in SHARED:
        value = getattr(args, name)
        if name not in study.user_attrs:
            study.set_user_attr(name, value)
        elif study.user_attrs[name] != value:
            raise ValueError(
                f"{name}: expected {study.user_attrs[name]}, with which the study in {args.folder} "
                f"has begun, got {value}"
            )
    # a study that goes on draws other settings than it began with, and every process its own
    (seed,) = np.random.SeedSequence([args.seed, len(study.trials)]).generate_state(1).tolist()
    study.sampler = optuna.samplers.TPESampler(seed=seed, constant_liar=True)
    if all(trial.state == TrialState.FAIL for trial in study.trials):
        study.enqueue_trial(present(args))
    return study


def present(args: TuneArgs) -> dict[str, Any]:
    """Return the values that the YAML file has of what is tried. KeyError for one it lacks."""
    found = hyperparameters(args.algorithm, args.scene)
    names = spaces()[args.algorithm]
    return {name: reduce(lambda place, part: place[part], name.split("."), found) for name in names}


def run_trial(args: TuneArgs, trial: optuna.Trial) -> float:
    """Train with the settings of a trial; return the best validation.

    Raises TrialPruned as soon as the training turns out worse than others.
    """
    returns: list[float] = []

    def report(steps: int, value: float) -> None:
        returns.append(value)
        trial.report(value, steps)
        if trial.should_prune():
            raise optuna.TrialPruned

    train = import_module(f"agents.{args.algorithm}").train
    train(args.training(trial.number), Trial(trial.params, report, silent=args.where() != ALONE))
    return max(returns)


def tune(args: TuneArgs) -> optuna.Study:
    """Run the trainings that the study lacks, and return it."""
    study = open_study(args)
    if args.where() != ALONE:
        first = len(study.trials)
        jobs = [(replace(args, seed=args.seed + k),) for k in range(args.trials - count(study))]
        # the journal knows what is done: no result is ever taken instead of a training
        keys = [[first, k] for k in range(len(jobs))]
        run_jobs(train_once, jobs, keys, Results(args.folder / "done"), "trainings", args.where())
    while count(study) < args.trials:
        number, value = train_with(args, study)
        if value is not None:
            print(f"training {number}: {value:.3f}, the best so far {study.best_value:.3f}")
    return study


def count(study: optuna.Study) -> int:
    """Return how many trainings have ended."""
    return sum(trial.state in ENDED for trial in study.trials)


def train_once(args: TuneArgs) -> list[Any]:
    """Open the study and add one training to it; return its number and best validation."""
    return list(train_with(args, open_study(args)))


def train_with(args: TuneArgs, study: optuna.Study) -> tuple[int, float | None]:
    """Add a training to the study; return its number and best validation, None if ended early."""
    space = {name: distribution(each) for name, each in spaces()[args.algorithm].items()}
    trial = study.ask(space)
    try:
        value = run_trial(args, trial)
    except optuna.TrialPruned:
        study.tell(trial, state=TrialState.PRUNED)
        return trial.number, None
    except BaseException:
        # it doesn't count, Ctrl-C above all
        study.tell(trial, state=TrialState.FAIL)
        raise
    study.tell(trial, value)
    return trial.number, value


def entry(args: TuneArgs, study: optuna.Study) -> str:
    """Return the best settings as an entry of hyperparams/ALGORITHM.yml."""
    found = replaced(hyperparameters(args.algorithm, args.scene), study.best_params)
    return yaml.safe_dump({env_id(args.scene): found}, sort_keys=False)


def main(args: TuneArgs) -> None:
    """Search, and print the best settings; Ctrl-C loses only the training in hand."""
    try:
        study = tune(args)
    except KeyboardInterrupt:
        print(f"interrupted: the same command goes on with the study in {args.folder}")
        raise SystemExit(INTERRUPTED) from None
    best = args.folder / "best.yml"
    with atomic_write(best) as draft:
        draft.write_text(entry(args, study))
    print(f"{best.read_text()}best of {count(study)} trainings: {study.best_value:.3f}; {best}")
    usual = present(args)
    for trial in study.trials:
        if trial.state == TrialState.COMPLETE and trial.params == usual:
            print(f"the settings of hyperparams/{args.algorithm}.yml: {trial.value:.3f}")


if __name__ == "__main__":
    launch(main, TuneArgs, __doc__)
