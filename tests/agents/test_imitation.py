import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
import torch

from agents import imitation, lessons
from agents.imitation import ImitationArgs
from agents.lessons import Lesson
from agents.policies import Spec, build
from sph_gym.controllers import TunedCfl
from sph_gym.env.tuning import TuningEnv
from sph_gym.provenance import content_hash

INSTANCE, LONGER = "patch_impact/train/0", "drop_impact/val/2/dx=0.08"


@pytest.fixture
def at_once(monkeypatch, jobs_here):
    """Plays lessons in this process; returns those that were played."""
    torch.set_num_threads(1)
    run_jobs, played = jobs_here
    monkeypatch.setattr(imitation, "run_jobs", run_jobs)
    settings = {"net_arch": [8], "learning_rate": 1e-2, "batch_size": 64, "gradient_steps": 200}
    monkeypatch.setattr(
        imitation, "hyperparameters", lambda *_: settings | {"beta": 0.2, "action_mode": "absolute"}
    )
    return played


def test_a_rule_answers_for_every_state_that_it_visits():
    lesson = lessons.take(Lesson("tuned_cfl", None, None, INSTANCE, 0, "absolute"))
    env = TuningEnv("patch_impact")
    observation, _ = env.reset(options={"instance": INSTANCE})
    for seen, answer in zip(lesson["observations"], lesson["actions"], strict=True):
        expected = env.action_toward(TunedCfl()(env.sim))
        assert answer == pytest.approx(expected, abs=1e-5)
        assert seen == pytest.approx(observation, abs=1e-5)
        observation, *_ = env.step(expected)
    assert env.episode.over


def test_a_dear_teacher_takes_over_and_answers_from_there_on(tmp_path, monkeypatch):
    asked = []

    class Planner:
        def __call__(self, env, observation):
            asked.append(env.episode.step)
            return env.action_toward(TunedCfl()(env.sim))

    teacher = lessons.Teacher(Planner, dear=True)
    monkeypatch.setitem(lessons.TEACHERS, "planner", teacher)
    alone = lessons.take(Lesson("planner", None, None, LONGER, 0, "absolute"))
    n_steps = len(alone["actions"])
    assert asked == list(range(n_steps))
    assert n_steps > 20
    path = tmp_path / "learner.npz"
    quick = {"net_arch": [4], "learning_rate": 1e-2, "batch_size": 8, "gradient_steps": 300}
    monkeypatch.setattr(
        imitation, "hyperparameters", lambda *_: quick | {"beta": 0.2, "action_mode": "absolute"}
    )
    imitation.fit(ImitationArgs(), alone["observations"], alone["actions"]).save(path)
    firsts = set()
    for seed in range(3):
        asked.clear()
        job = Lesson("planner", str(path), content_hash(path), LONGER, seed, "absolute")
        lesson = lessons.take(job)
        assert asked == list(range(asked[0], n_steps))
        assert len(lesson["observations"]) == len(lesson["actions"]) == len(asked)
        firsts.add(asked[0])
    assert len(firsts) > 1


def test_all_states_of_an_episode_that_blows_up_have_the_same_chance():
    env = TuningEnv("hydrostatic_tank", dx=0.03)
    reckless = np.array([1.0, 1.0, -1.0], np.float32)
    states = {}
    for seed in range(12):
        observation, _ = env.reset(seed=0)
        first = lessons.visit(env, lambda *_: reckless, observation, seed)
        assert not env.episode.over
        assert np.array_equal(first, states.setdefault(env.episode.step, first))
    env.reset(seed=0)
    lived = 0
    while not env.episode.over:
        lived += 1
        env.step(reckless)
    assert env.episode.info["blowup"] == 1.0
    assert max(states) < lived
    assert len(states) >= min(lived, 3)


def test_a_network_learns_the_answers(at_once):
    rng = np.random.default_rng(0)
    inputs = rng.uniform(-1, 1, (400, 5))
    answers = 0.5 * np.tanh(inputs[:, :3] + inputs[:, 2:])
    network = imitation.fit(ImitationArgs(), inputs, answers)
    found = np.array([network(row) for row in inputs])
    assert np.abs(found - answers).mean() < 0.1 < np.abs(answers).mean()
    again = imitation.fit(ImitationArgs(), inputs, answers)
    assert all(map(np.array_equal, network.weights, again.weights))


def test_it_learns_in_rounds_and_takes_no_lesson_twice(tmp_path, at_once):
    args = ImitationArgs(
        scene="patch_impact", teacher="tuned_cfl", rounds=2, lessons=1, n_evaluations=1,
        output=tmp_path,
    )  # fmt: skip
    imitation.train(args)
    assert [job.instance for job in at_once] == ["patch_impact/train/0", "patch_impact/train/1"]
    assert at_once[0].learner is None
    assert at_once[1].learner.endswith("round0.npz")
    env = gym.make("sph_gym/PatchImpact-v1")
    observation, _ = env.reset(seed=0)
    network = args.folder / "network.npz"
    action = build(Spec("imitation", network=str(network)), 0)(env, observation)
    assert env.action_space.contains(action)
    content = network.read_bytes()
    at_once.clear()
    imitation.train(args)
    assert not at_once
    assert network.read_bytes() == content


def test_a_kind_of_actions_comes_before_that_of_the_table(at_once):
    assert ImitationArgs().settings["action_mode"] == "absolute"
    assert ImitationArgs(action_mode="delta").settings["action_mode"] == "delta"


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"teacher": "nobody"}, "teacher: expected one of oracle"),
        ({"rounds": 0}, "rounds: expected"),
        ({"lessons": 0}, "lessons: expected"),
        ({"seed": -1}, "seed: expected"),
        ({"scene": "nowhere"}, "nowhere"),
        ({"n_evaluations": 99}, "n_evaluations: expected 1 to"),
        ({"action_mode": "discrete"}, "action_mode: expected one of absolute, stable, delta, got"),
    ],
    ids=str,
)
def test_wrong_arguments_are_refused(given, text):
    with pytest.raises(ValueError, match=text):
        ImitationArgs(**given)
