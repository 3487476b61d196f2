"""The search for hyperparameters, with made-up trainings."""

import math
from types import SimpleNamespace

import pytest
import yaml

pytest.importorskip("optuna")
pytest.importorskip("stable_baselines3")

from agents import tune
from agents.tune import TuneArgs


@pytest.fixture
def trainings(monkeypatch):
    """Trainings do well at a rate of 3e-4; returns those that ran, and where each was ended."""
    ran = []

    def train(args, trial):
        rate = trial.settings["learning_rate"]
        ran.append(SimpleNamespace(args=args, settings=trial.settings, ended=0))
        for step in range(1, 6):
            ran[-1].ended = step
            trial.report(step * args.evaluate_every, -abs(math.log(rate / 3e-4)))

    monkeypatch.setattr(tune, "import_module", lambda name: SimpleNamespace(train=train))
    return ran


def test_it_begins_with_the_present_settings_and_finds_better_ones(tmp_path, trainings):
    args = TuneArgs(trials=15, output=tmp_path)
    tune.main(args)
    assert len(trainings) == 15
    present = tune.hyperparameters("ppo", "dam_break")
    assert trainings[0].settings["learning_rate"] == present["learning_rate"] == 7e-4
    assert trainings[0].settings["policy_kwargs.log_std_init"] == -0.7
    assert min(each.ended for each in trainings) < 5 == trainings[0].ended
    best = yaml.safe_load((args.folder / "best.yml").read_text())["sph_gym/DamBreak-v1"]
    assert 1.5e-4 < best["learning_rate"] < 6e-4
    assert best["policy_kwargs"]["net_arch"] == present["policy_kwargs"]["net_arch"]
    assert best.keys() == present.keys()


def test_only_the_worst_quarter_is_ended_early(tmp_path):
    args = TuneArgs(output=tmp_path)
    study = tune.open_study(args)
    for value in (1.0, 2.0, 3.0, 4.0):
        trial = study.ask()
        trial.report(value, 3 * args.evaluate_every)
        study.tell(trial, value)
    for value, ended in ((1.5, True), (2.0, False)):
        trial = study.ask()
        trial.report(value, 3 * args.evaluate_every)
        assert trial.should_prune() == ended
        study.tell(trial, value)


def test_a_study_goes_on(tmp_path, trainings):
    tune.tune(TuneArgs(trials=2, output=tmp_path))
    study = tune.tune(TuneArgs(trials=5, output=tmp_path))
    assert len(trainings) == 5
    assert len(study.trials) == 5
    tune.tune(TuneArgs(trials=5, output=tmp_path))
    assert len(trainings) == 5
    assert len({each.args.seed for each in trainings}) == 5


def test_trainings_side_by_side_are_as_many_as_the_study_lacks(
    tmp_path, trainings, jobs_here, monkeypatch
):
    run_jobs, jobs = jobs_here
    monkeypatch.setattr(tune, "run_jobs", run_jobs)
    tune.tune(TuneArgs(trials=2, output=tmp_path))
    args = TuneArgs(trials=5, workers=2, seed=7, output=tmp_path)
    study = tune.tune(args)
    assert [job.seed for job in jobs] == [7, 8, 9]
    assert len(trainings) == len(study.trials) == 5
    assert len({each.args.seed for each in trainings}) == 5
    assert len({each.settings["learning_rate"] for each in trainings}) == 5
    tune.tune(args)
    assert len(jobs) == 3


def test_where_trainings_go():
    assert TuneArgs().where() == tune.ALONE
    assert TuneArgs(backend="dask", address="a:1").where() == ("dask", "a:1", None)
    with pytest.raises(ValueError, match="workers: a cluster with an address"):
        TuneArgs(backend="dask", address="a:1", workers=4)


def test_an_interrupted_training_does_not_count(tmp_path, trainings, monkeypatch, capsys):
    def interrupt(args, trial):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(tune, "import_module", lambda name: SimpleNamespace(train=interrupt))
        with pytest.raises(SystemExit):
            tune.main(TuneArgs(trials=2, output=tmp_path))
    assert "goes on with the study" in capsys.readouterr().out
    tune.main(TuneArgs(trials=2, output=tmp_path))
    assert len(trainings) == 2
    # it was that of the present settings
    present = tune.hyperparameters("ppo", "dam_break")["learning_rate"]
    assert trainings[0].settings["learning_rate"] == present


@pytest.mark.parametrize("algorithm", ["ppo", "ppo_lagrangian", "ppo_warm", "sac", "dqn"])
def test_present_settings_are_within_what_is_tried(tmp_path, algorithm):
    args = TuneArgs(algorithm=algorithm, scene="benchmark", output=tmp_path)
    space = {k: tune.distribution(each) for k, each in tune.spaces()[algorithm].items()}
    # Optuna warns of values outside, and a warning is an error here
    trial = tune.open_study(args).ask(space)
    assert trial.params == pytest.approx(tune.present(args))
    assert trial.params.keys() == space.keys()


@pytest.mark.parametrize(
    "other", [{"steps": 5}, {"n_envs": 3}, {"evaluate_every": 5}, {"n_evaluations": 1}]
)
def test_trainings_of_a_study_can_be_compared(tmp_path, trainings, other):
    args = TuneArgs(trials=1, output=tmp_path)
    tune.tune(args)
    [name] = other
    with pytest.raises(ValueError, match=f"{name}: expected {getattr(args, name)}, with which"):
        tune.tune(TuneArgs(trials=2, output=tmp_path, **other))
    assert len(trainings) == 1


def test_a_study_that_is_only_looked_at_stays_as_it_is(tmp_path, trainings):
    args = TuneArgs(trials=2, output=tmp_path)
    tune.tune(args)
    before = (args.folder / "study.log").read_bytes()
    tune.main(args)
    assert (args.folder / "study.log").read_bytes() == before


@pytest.mark.parametrize(
    ("wrong", "message"),
    [({"scene": "benchmark-foo"}, "scene: "), ({"steps": 0}, "steps: "), ({"seed": -1}, "seed: ")],
)
def test_wrong_arguments_leave_no_folder(tmp_path, wrong, message):
    with pytest.raises(ValueError, match=message):
        tune.tune(TuneArgs(output=tmp_path, **wrong))
    assert not list(tmp_path.iterdir())


def test_unknown_algorithms_are_refused():
    with pytest.raises(ValueError, match="algorithm: expected one of ppo, ppo_lagrangian"):
        TuneArgs(algorithm="magic")
