from dataclasses import dataclass, replace

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
import torch

from agents import rollout, tries
from agents.rollout import RolloutArgs
from agents.tries import Exploration, Tries, TrySettings
from sph_gym.controllers import AdaptiveRule, shipped
from sph_gym.env.oracle import Step
from sph_gym.env.rewards import WORST
from sph_gym.env.tuning import TuningEnv
from tests.networks import tiny

INSTANCE = "patch_impact/train/0"
HOW = {
    "share": 0.5, "hold": 3, "near": 2, "anywhere": 1, "spread": [0.1, 0.2, 0.2],
    "lowest": [0.1, -1.0, -1.0], "follow": 0.5,
}  # fmt: skip
SETTINGS = {
    "action_mode": "stable",
    "tries": HOW,
    "value": {
        "n": 2, "net_arch": [16], "gradient_steps": 400, "batch_size": 64, "learning_rate": 1e-2
    },
    "policy": {"net_arch": [8], "gradient_steps": 300, "batch_size": 64, "learning_rate": 1e-2},
    "doubt": 0.5,
    "price": 0.0,
}  # fmt: skip


@pytest.fixture
def at_once(monkeypatch, jobs_here):
    """Plays episodes in this process; returns those that were played."""
    torch.set_num_threads(1)
    run_jobs, played = jobs_here
    monkeypatch.setattr(rollout, "run_jobs", run_jobs)
    monkeypatch.setattr(rollout, "hyperparameters", lambda *_: SETTINGS)
    return played


def test_a_try_earns_what_the_environment_pays_and_leaves_no_trace():
    env = TuningEnv("patch_impact", action_mode="stable")
    env.reset(options={"instance": INSTANCE})
    action = np.array([0.4, 0.0, -0.2], np.float32)
    before = env.episode.observe()
    found, blown = tries.worth(env.episode, action, 3)
    assert not blown
    assert np.array_equal(env.episode.observe(), before)
    rewards = [env.step(action)[1] for _ in range(3)]
    assert found == pytest.approx(np.mean(rewards), rel=1e-6)


@dataclass
class Fragile:
    """An episode of so many steps that blows up in one of them."""

    n_steps: int
    fatal: int
    step: int = 0

    def state(self):
        return self.step

    def restore(self, state):
        self.step = state


@pytest.mark.parametrize(("n_steps", "planned"), [(100, 8), (8, 8), (5, 5)])
def test_a_blowup_costs_the_rest_of_the_try(monkeypatch, n_steps, planned):
    def play_one(episode, action):
        episode.step += 1
        ended = episode.step == episode.fatal
        return Step(0.0 if ended else 0.5, 0.0, 1, over=ended, blowup=ended)

    monkeypatch.setattr(tries, "play", play_one)
    episode = Fragile(n_steps, fatal=3)
    found, blown = tries.worth(episode, None, 8)
    assert blown
    assert episode.step == 0
    assert found == pytest.approx((2 * 0.5 - WORST * (planned - 2)) / planned)


def test_the_policys_own_action_is_tried_first_and_all_are_within_bounds():
    own = np.array([0.9, -0.9, 0.0], np.float32)
    settings = TrySettings(**HOW | {"near": 40, "anywhere": 40})
    found = tries.candidates(own, settings, np.random.default_rng(0))
    assert found.shape == (81, 3)
    assert np.array_equal(found[0], own)
    assert np.abs(found).max() <= 1.0
    assert (found[41:, 0] >= 0.1 - 1e-6).all()
    near, anywhere = (np.abs(part - own).mean() for part in (found[1:41], found[41:]))
    assert 0.0 < near < anywhere


def test_an_episode_is_the_same_again_and_its_tries_are_of_states_that_it_visits():
    job = Exploration(None, None, INSTANCE, 3, "stable", TrySettings(**HOW))
    found, again = (tries.explore(job) for _ in range(2))
    assert found == again
    gathered = tries.gather([found])
    n = len(gathered.observations)
    assert gathered.actions.shape == (n, 4, 3)
    assert gathered.values.shape == gathered.blowups.shape == (n, 4)
    env = TuningEnv("patch_impact", action_mode="stable")
    observation, _ = env.reset(options={"instance": INSTANCE})
    visited = [observation]
    while not env.episode.over:
        observation, *_ = env.step(env.action_toward(AdaptiveRule()(env.sim)))
        visited.append(observation)
    # until it follows another action for the first time
    assert min(np.abs(np.array(visited) - gathered.observations[0]).max(axis=1)) < 1e-4
    assert 0.2 * env.n_steps < n < 0.8 * env.n_steps


def test_a_policy_plays_what_earns_most(at_once):
    rng = np.random.default_rng(0)
    seen = rng.uniform(-1, 1, (300, 23)).astype(np.float32)
    tried = rng.uniform(-1, 1, (300, 6, 3)).astype(np.float32)
    best = 0.5 * seen[:, None, :3]
    known = Tries(seen, tried, -np.square(tried - best).sum(axis=2), np.zeros((300, 6), "f4"))
    args = RolloutArgs()
    network = rollout.fit_policy(args, known, [rollout.fit_value(args, known, k) for k in (0, 1)])
    found = np.array([network(row) for row in seen])
    assert np.abs(found - best[:, 0]).mean() < 0.5 * np.abs(best).mean()


def test_doubt_keeps_a_policy_away_from_what_values_disagree_about(at_once, monkeypatch):
    known = Tries(np.zeros((20, 23), np.float32), *(np.zeros((20, 1)),) * 3)

    def value(slope):
        """Earns more or less in larger actions, and never blows up."""
        return lambda inputs: torch.stack(
            [slope * inputs[:, 23], torch.full((len(inputs),), -99.0)], 1
        )

    # both see more in larger actions, but one of them a loss
    values = [value(3.0), value(-2.0)]
    chosen = {}
    for doubt in (0.0, 1.0):
        monkeypatch.setitem(SETTINGS, "doubt", doubt)
        network = rollout.fit_policy(RolloutArgs(), known, values)
        chosen[doubt] = network(np.zeros(23, np.float32))[0]
    assert chosen[0.0] > 0.5
    # all that they agree on is to stay at zero
    assert abs(chosen[1.0]) < 0.1


def test_a_price_keeps_a_policy_away_from_blowups(at_once, monkeypatch):
    rng = np.random.default_rng(0)
    seen = rng.uniform(-1, 1, (300, 23)).astype(np.float32)
    tried = rng.uniform(-1, 1, (300, 6, 3)).astype(np.float32)
    # longer steps earn more, and from 0.2 on the fluid blows up once in four times
    blown = (tried[:, :, 0] > 0.2) & (rng.random((300, 6)) < 0.25)
    known = Tries(seen, tried, tried[:, :, 0], blown.astype(np.float32))
    chosen = {}
    for price in (0.0, 20.0):
        monkeypatch.setitem(SETTINGS, "price", price)
        args = RolloutArgs()
        values = [rollout.fit_value(args, known, k) for k in (0, 1)]
        network = rollout.fit_policy(args, known, values)
        chosen[price] = np.array([network(row)[0] for row in seen])
    assert np.median(chosen[0.0]) > 0.6
    assert np.mean(chosen[20.0] < 0.2) > 0.9
    assert np.median(chosen[20.0]) > -0.4


def test_it_learns_in_rounds_and_tries_nothing_twice(tmp_path, at_once, shipped_here, monkeypatch):
    args = RolloutArgs(scene="patch_impact", rounds=2, episodes=1, n_evaluations=1, output=tmp_path)
    fit_policy, learned = rollout.fit_policy, []

    def fit(args, found, values):
        learned.append(len(found.observations))
        return fit_policy(args, found, values)

    monkeypatch.setattr(rollout, "fit_policy", fit)
    rollout.train(args)
    assert not shipped_here.exists()
    assert [job.instance for job in at_once] == ["patch_impact/train/0", "patch_impact/train/1"]
    assert at_once[0].learner is None
    assert at_once[1].learner.endswith("round0.npz")
    # the second network learns from the tries of both rounds
    assert len(learned) == 2
    assert learned[1] > learned[0]
    content = (args.folder / "network.npz").read_bytes()
    at_once.clear()
    rollout.train(replace(args, ship=True))
    assert not at_once
    assert (args.folder / "network.npz").read_bytes() == content
    assert shipped("patch_impact", "stable").card["seeds"] == [0]
    assert (shipped_here / "rollout_patch_impact.npz").read_bytes() == content


def test_other_settings_and_seeds_are_other_tries(tmp_path, at_once, monkeypatch):
    monkeypatch.setattr(rollout, "explore", lambda *job: {})
    args = RolloutArgs(scene="patch_impact", episodes=2, output=tmp_path)
    rollout.visit(args, 0, None)
    assert [job.instance for job in at_once] == ["patch_impact/train/0", "patch_impact/train/1"]
    at_once.clear()
    rollout.visit(args, 0, None)
    assert not at_once
    # a quarter of the training flows further on, however many rounds there are
    rollout.visit(replace(args, seed=1, rounds=9), 0, None)
    assert [job.instance for job in at_once] == ["patch_impact/train/64", "patch_impact/train/65"]
    at_once.clear()
    monkeypatch.setitem(SETTINGS, "tries", HOW | {"hold": 4})
    rollout.visit(replace(args), 0, None)
    assert len(at_once) == 2


def test_every_flow_has_its_own_chances():
    how = TrySettings(**HOW | {"anywhere": 6})
    drawn = []
    for k in range(2):
        job = Exploration(None, None, f"patch_impact/train/{k}", 3, "stable", how)
        drawn.append(np.array(tries.explore(job)["actions"])[0, -6:])
    assert not np.array_equal(*drawn)


def test_tries_are_not_kept_as_those_of_another_network(tmp_path):
    path = tmp_path / "round0.npz"
    tiny().save(path)
    job = Exploration(str(path), "another", INSTANCE, 0, "stable", TrySettings(**HOW))
    with pytest.raises(RuntimeError, match=r"round0.npz has changed: does another training"):
        tries.explore(job)


def test_a_repeat_that_is_refused_leaves_the_network(tmp_path, at_once):
    args = RolloutArgs(scene="patch_impact", output=tmp_path)
    args.folder.mkdir()
    (args.folder / "network.npz").write_bytes(b"kept")
    with pytest.raises(ValueError, match="backend: expected one of"):
        RolloutArgs(scene="patch_impact", output=tmp_path, backend="moon")

    def interrupt(*_):
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rollout, "visit", interrupt)
        with pytest.raises(KeyboardInterrupt):
            rollout.train(args)
    assert (args.folder / "network.npz").read_bytes() == b"kept"


@pytest.mark.parametrize(
    ("group", "entries", "text"),
    [
        ("tries", HOW | {"hold": 0}, "hold: expected a number at least 1, got 0"),
        ("tries", HOW | {"near": 2.5}, "near: expected a whole number, got 2.5"),
        ("tries", HOW | {"share": 0.0}, "share: expected a number above 0"),
        ("tries", HOW | {"spread": [0.1, 0.2]}, "spread: "),
        ("tries", {}, "hyperparams: expected share, hold, .* in tries of rollout.yml"),
        ("tries", None, "hyperparams: expected share, hold"),
        ("value", SETTINGS["value"] | {"n": 0}, "n: expected a number at least 1"),
        ("policy", SETTINGS["policy"] | {"learning_rate": "3e-3"}, "learning_rate: expected a num"),
        ("policy", SETTINGS["policy"] | {"dropout": 0.1}, "hyperparams: .* in policy"),
        ("doubt", -1.0, "doubt: expected"),
        ("price", -1.0, "price: expected"),
    ],
    ids=str,
)
def test_wrong_entries_of_the_table_are_told_before_anything_is_played(
    monkeypatch, group, entries, text
):
    monkeypatch.setattr(rollout, "hyperparameters", lambda *_: SETTINGS | {group: entries})
    with pytest.raises(ValueError, match=text):
        RolloutArgs()


def test_an_episode_without_tries_is_told():
    with pytest.raises(ValueError, match="episodes: no state was tried"):
        tries.gather([{name: [] for name in Tries._fields}])


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"rounds": 0}, "rounds: expected"),
        ({"episodes": 0}, "episodes: expected"),
        ({"seed": 1.5}, "seed: expected"),
        ({"seed": 10**17}, "seed: expected"),
        ({"episodes": 257}, "episodes: expected"),
        ({"workers": 0}, "workers: expected"),
        ({"scene": "nowhere"}, "nowhere"),
    ],
    ids=str,
)
def test_wrong_arguments_are_refused(given, text):
    with pytest.raises(ValueError, match=text):
        RolloutArgs(**given)


def test_actions_that_mean_something_else_in_every_state_are_refused(monkeypatch):
    monkeypatch.setattr(rollout, "hyperparameters", lambda *_: SETTINGS | {"action_mode": "delta"})
    with pytest.raises(ValueError, match="action_mode: expected one of absolute, stable, got"):
        RolloutArgs()
