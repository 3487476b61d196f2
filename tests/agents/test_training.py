"""Training in miniature: it runs, exports what it learned, and goes on from a checkpoint."""

import io
import json
import os
import zipfile
from importlib import import_module

import gymnasium as gym
import pandas as pd
import pytest

pytest.importorskip("stable_baselines3")
import yaml
from stable_baselines3 import PPO

from agents import cards, entries, ppo, scores, training
from agents.arguments import make_parser, parse
from agents.exports import checked_export, plain_network
from agents.imitation import ImitationArgs, perceptron
from agents.policies import Spec, build
from agents.ppo_warm import WarmArgs
from agents.rollout import RolloutArgs
from sph_gym.controllers import shipped
from sph_gym.controllers.network import shipped_network
from sph_gym.controllers.shipped import fitting, load, names
from sph_gym.env import env_id
from sph_gym.env.stable_baselines import TuningVecEnv
from tests.networks import tiny


@pytest.fixture
def small(monkeypatch):
    ppo = {"n_steps": 32, "batch_size": 32, "n_epochs": 1}
    settings = {
        "ppo": ppo | {"env": {"reward_weights": {"blowup": 0.1}}},
        "ppo_lagrangian": ppo,
        "sac": {"learning_starts": 20, "batch_size": 16, "buffer_size": 200},
        "dqn": {"learning_starts": 20, "batch_size": 16, "buffer_size": 200},
    }
    common = {"learning_rate": 1e-3, "policy_kwargs": {"net_arch": [8]}}

    def look_up(algorithm, scene, file):
        found = settings[algorithm]
        mode = "discrete" if algorithm == "dqn" else "stable"
        return found | common | {"env": {"action_mode": mode, **found.get("env", {})}}

    monkeypatch.setattr(training, "hyperparameters", look_up)


@pytest.mark.parametrize("algorithm", ["ppo", "ppo_lagrangian", "sac", "dqn"])
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.filterwarnings("ignore:rich is experimental")
def test_train_export_resume(tmp_path, small, algorithm):
    train = import_module(f"agents.{algorithm}").train
    arguments = training.TrainingArgs(
        scene="relaxation", steps=64, n_envs=1, output=tmp_path, evaluate_every=64, n_evaluations=1
    )
    train(arguments)
    path = tmp_path / f"{algorithm}_relaxation_seed0"
    env = gym.make(env_id("relaxation"), dx=0.1)
    observation, _ = env.reset(seed=0)
    policy = build(Spec(algorithm, network=str(path / "network.npz")), seed=0)
    assert env.action_space.contains(policy(env, observation))
    arguments.steps, arguments.resume = 96, True
    with pytest.raises(ValueError, match=r"trust_checkpoints: .* pickles"):
        train(arguments)
    arguments.trust_checkpoints = True
    # killed while it wrote the newest
    torn = training.newest_checkpoint(path).with_name(f"{algorithm}_999999_steps.zip")
    torn.write_bytes(b"PK half of it")
    train(arguments)
    assert training.newest_checkpoint(path).exists()
    assert list((path / "tensorboard").rglob("events*"))
    # the second run goes on with the curve of the first, and validates at its end
    curve = pd.read_csv(path / "validation.csv")
    assert curve["steps"].tolist() == [64, 96]
    assert curve["relaxation"].equals(curve["return"])


def test_a_checkpoint_torn_within_one_of_its_archives_is_left_out(tmp_path):
    inner = io.BytesIO()
    with zipfile.ZipFile(inner, "w") as archive:
        archive.writestr("data.pkl", b"weights")
    places = [tmp_path / "checkpoints" / f"{name}.zip" for name in ("whole", "torn")]
    places[0].parent.mkdir()
    for place in places:
        with zipfile.ZipFile(place, "w") as archive:
            archive.writestr("data", b"model")
            archive.writestr("policy.pth", inner.getvalue())
    whole, torn = places
    content = torn.read_bytes()
    end = content.index(inner.getvalue()) + len(inner.getvalue())
    torn.write_bytes(content[:end])
    os.utime(whole, (0, 0))
    # its end is that of the inner one
    assert zipfile.is_zipfile(torn)
    assert training.newest_checkpoint(tmp_path) == whole


def test_hyperparameters_within_groups_are_replaced():
    given = {"a": 1, "env": {"reward_weights": {"blowup": 1.0, "work": 2.0}}}
    found = training.replaced(given, {"a": 2, "env.reward_weights.blowup": 0.5, "new.b": 3})
    weights = {"blowup": 0.5, "work": 2.0}
    assert found == {"a": 2, "env": {"reward_weights": weights}, "new": {"b": 3}}
    assert given["env"]["reward_weights"]["blowup"] == 1.0


def test_nothing_to_resume_is_said(tmp_path):
    with pytest.raises(FileNotFoundError, match="nothing to resume"):
        training.newest_checkpoint(tmp_path)


@pytest.mark.parametrize("algorithm", ["ppo", "ppo_lagrangian", "ppo_warm", "sac", "dqn"])
def test_hyperparameters_fall_back_to_the_default(algorithm):
    named = training.hyperparameters(algorithm, "dam_break")
    assert set(training.hyperparameters(algorithm, "relaxation")) == set(named)


@pytest.fixture
def table(tmp_path, monkeypatch):
    """Writes the table of an algorithm, which takes the place of the real one."""

    def write(algorithm, **entries):
        path = tmp_path / "hyperparams" / f"{algorithm}.yml"
        path.parent.mkdir(exist_ok=True)
        path.write_text(yaml.safe_dump(entries))

    monkeypatch.setattr(training, "FOLDER", tmp_path)
    return write


def test_an_edited_table_is_for_the_next_training(table):
    entry = {"env": {"action_mode": "stable"}, "learning_rate": 1e-3, "policy_kwargs": {}}
    table("ppo", default=entry)
    one = training.Training("ppo", training.TrainingArgs(), export=None)
    # a learner may add to what it is given
    one.settings()["policy_kwargs"]["added"] = 1
    table("ppo", default=entry | {"env": {"action_mode": "absolute"}, "gamma": 0.9})
    assert one.action_mode == "stable"
    assert "gamma" not in one.settings()
    assert one.settings()["policy_kwargs"] == {}


def test_an_edited_table_is_for_the_next_imitation(table):
    table("imitation", default={"action_mode": "stable"})
    args = ImitationArgs()
    assert args.settings["action_mode"] == "stable"
    table("imitation", default={"action_mode": "absolute"})
    assert args.settings["action_mode"] == "stable"


def test_what_an_id_does_not_name_comes_from_default(table):
    default = {"env": {"action_mode": "stable", "rate_limit": 2.0}, "gamma": 0.9, "n_steps": 8}
    own = {"env": {"rate_limit": 3.0}, "gamma": 0.8}
    table("ppo", default=default, **{env_id("dam_break"): own})
    assert training.hyperparameters("ppo", "dam_break") == {
        "env": {"action_mode": "stable", "rate_limit": 3.0},
        "gamma": 0.8,
        "n_steps": 8,
    }
    assert training.hyperparameters("ppo", "relaxation") == default


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "hyperparams: expected entries like those of .*ppo.yml, got .*mine.yml"),
        ("gamma: 0.9", "hyperparams: expected entries like .*'default'"),
        ("default: [1", "hyperparams: expected entries like"),
        ("default: 3", "hyperparams: expected entries like"),
        (
            "default: {env: {action_mode: stable}, learning_rate: 7e-4}",
            "hyperparams: expected a number for learning_rate in .*mine.yml, got '7e-4'",
        ),
    ],
)
def test_a_file_without_entries_is_refused(tmp_path, text, message):
    path = tmp_path / "mine.yml"
    path.write_text(text)
    with pytest.raises(ValueError, match=message):
        training.hyperparameters("ppo", "dam_break", path)


@pytest.mark.parametrize("algorithm", ["ppo", "ppo_lagrangian", "sac", "dqn"])
def test_a_hyperparameter_that_does_not_exist_is_told(table, tmp_path, algorithm):
    mode = "discrete" if algorithm == "dqn" else "stable"
    table(algorithm, default={"env": {"action_mode": mode}, "gama": 0.9, "learning_rate": 1e-3})
    train = import_module(f"agents.{algorithm}").train
    with pytest.raises(ValueError, match=r"hyperparams: expected one of .*gamma.*, got 'gama'"):
        train(training.TrainingArgs("relaxation", n_envs=1, output=tmp_path))


def test_trainings_with_other_hyperparameters_have_names_of_their_own(tmp_path):
    found = []
    for name in ("mine.yml", "ppo-mine.yml"):
        (tmp_path / name).write_text("default: {env: {action_mode: stable}}")
        args = training.TrainingArgs(output=tmp_path, hyperparams=tmp_path / name)
        found.append(training.Training("ppo", args, export=None).folder.name)
    assert found == ["ppo-mine_dam_break_seed0"] * 2


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.filterwarnings("ignore:rich is experimental")
def test_a_new_training_leaves_no_checkpoint_of_the_one_before(tmp_path, small):
    args = training.TrainingArgs(
        "relaxation", steps=32, n_envs=1, output=tmp_path, evaluate_every=64, n_evaluations=1
    )
    old = tmp_path / "ppo_relaxation_seed0" / "checkpoints" / "ppo_900000_steps.zip"
    old.parent.mkdir(parents=True)
    old.touch()
    ppo.train(args)
    assert not old.exists()


@pytest.mark.parametrize("env", [{"env": {"action_mode": "stabel"}}, {"action_mode": "stabel"}, {}])
def test_an_unknown_kind_of_actions_is_refused(table, env):
    table("ppo", default={"gamma": 0.9} | env)
    with pytest.raises(ValueError, match=r"action_mode: expected one of absolute, .*, got"):
        training.hyperparameters("ppo", "dam_break")


@pytest.mark.parametrize(
    ("algorithm", "mode"), [("sac", "discrete"), ("dqn", "stable"), ("dqn", "absolute")]
)
def test_actions_that_cannot_be_learned_are_refused_at_the_door(table, tmp_path, algorithm, mode):
    table(algorithm, default={"env": {"action_mode": mode}})
    train = import_module(f"agents.{algorithm}").train
    with pytest.raises(ValueError, match=f"action_mode: expected one of .*, got '{mode}'"):
        train(training.TrainingArgs(output=tmp_path / "runs"))
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(("mode", "squash"), [("delta", "clip"), ("discrete", "none")])
def test_ppo_exports_all_kinds_of_actions(mode, squash):
    envs = TuningVecEnv(1, scene="relaxation", action_mode=mode)
    model = PPO("MlpPolicy", envs, policy_kwargs={"net_arch": [8]}, seed=0, device="cpu")
    # what only validations do, thousands of steps after the start
    network = checked_export(model, lambda model: ppo.export(model, mode))
    assert network.squash == squash
    assert network.action.startswith(mode)


@pytest.mark.parametrize("kept", ["stable", "absolute"])
def test_a_training_goes_on_with_the_actions_that_it_began_with(tmp_path, table, kept):
    table("ppo", default={"env": {"action_mode": "stable"}})
    args = training.TrainingArgs(output=tmp_path, resume=True, trust_checkpoints=True)
    one = training.Training("ppo", args, export=None)
    path = one.folder / "checkpoints" / "ppo_64_steps.zip"
    path.parent.mkdir(parents=True)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("data", b"model")
    plain_network(perceptron(5, [4], 3), "clip", kept).save(one.folder / "network.npz")
    if kept == "stable":
        assert one.checkpoint() == path
        return
    with pytest.raises(ValueError, match=r"resume: expected .*'stable v\d'.* got .*'absolute v\d'"):
        one.checkpoint()


def test_the_last_batch_does_not_undo_what_was_learned():
    # it ends beyond the last step, where no progress remains
    rate = training.linear(1e-3)
    assert [rate(remaining) for remaining in (1.0, 0.5, 0.0, -0.02)] == [1e-3, 5e-4, 0.0, 0.0]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"steps": 0}, "steps: "),
        ({"n_envs": 0}, "n_envs: "),
        ({"seed": -1}, "seed: "),
        ({"evaluate_every": 0}, "evaluate_every: "),
        ({"n_evaluations": 17}, "n_evaluations: expected 1 to 16, got 17"),
        ({"scene": "nope"}, "scene: "),
    ],
)
def test_wrong_arguments_are_named_before_anything_is_played(wrong, message):
    with pytest.raises(ValueError, match=message):
        training.TrainingArgs(**wrong)


def test_the_commands_of_cards_are_understood():
    for name in names():
        program, *words = load(name).card["command"].split("python -m agents.")[1].split()
        kinds = {"ppo_warm": WarmArgs, "rollout": RolloutArgs}
        kind = kinds.get(program, training.TrainingArgs)
        args = parse(make_parser(kind, None), kind, words)
        if program == "rollout":
            mode = args.settings.action_mode
        else:
            mode = training.Training(program, args, ppo.export).action_mode
        assert mode == load(name).network.action.partition(" ")[0]


def test_a_network_begins_with_a_card_and_has_figures_only_of_its_own(tmp_path, shipped_here):
    tiny().save(tmp_path / "trained.npz")
    made = {"how": "quickly", "command": "python -m agents.ppo", "seed": 3, "minutes": 1}
    path = cards.ship(tmp_path / "trained.npz", "ppo", "dam_break", **made)
    assert path == shipped_network("ppo", "dam_break")
    assert shipped("dam_break").card["seeds"] == [3]
    assert fitting("dam_break") == {"ppo": "ppo_dam_break", "best": "ppo_dam_break"}
    card_path = path.with_suffix(".json")
    old = json.loads(card_path.read_text()) | {"figures": {"work": "of a former network"}}
    card_path.write_text(json.dumps(old))
    # it has played nothing
    found = [each for each in entries.read_all(entries.FOLDER) if each.agent == "tuned_cfl"]
    cards.write(found, scores.runs_of(found))
    assert json.loads(card_path.read_text())["figures"] == {}
