"""The main job in its shortest form, and the pieces that it is made of."""

import re

import gymnasium as gym
import numpy as np
import pandas as pd
import pytest

from agents import compare, evaluate, report
from agents.policies import NAMES, Spec, build, play_network
from sph_gym.controllers.network import SHIPPED
from sph_gym.controllers.shipped import network_of
from sph_gym.env import SCENES, actions, env_id, observations
from sph_gym.env.instances import ODD, SIZES
from sph_gym.studies.averages import bootstrap_interval
from tests.networks import tiny

RULES = ("random", "default", "cfl", "tuned_cfl")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("compare")
    network = tmp_path_factory.mktemp("networks") / "network.npz"
    tiny().save(network)
    arguments = compare.ComparisonArgs(
        agents=("random", "tuned_cfl", "grid_search", "ppo"),
        networks=("ppo", str(network)),
        n_instances=2,
        n_search=1,
        grid=(1, 2, 1),
        output=path,
    )
    compare.compare(arguments)
    return path


def test_the_folder_holds_all_that_is_promised(folder):
    names = {file.name for file in folder.iterdir()}
    tables = {"table.csv", "table.md", "runs.csv", "grid_search_dam_break_train_per_scene.csv"}
    assert {"report.html", report.ANIMATION, "side_by_side.png", *report.PLOTS, *tables} <= names


def test_every_agent_met_the_same_instances_and_seeds(folder):
    runs = pd.read_csv(folder / "runs.csv")
    met = runs.groupby("agent")[["instance", "seed"]].agg(list)
    assert len(met) == 4
    assert all(sorted(row) == sorted(met["instance"].iloc[0]) for row in met["instance"])


def test_reported_returns_are_the_sum_of_their_terms(folder):
    runs = pd.read_csv(folder / "runs.csv")
    terms = runs[[name for name in runs.columns if name.startswith("reward_")]].sum(axis=1)
    assert np.allclose(runs["return"], terms)


def test_the_tuned_rule_beats_random_actions(folder):
    table = pd.read_csv(folder / "table.csv").set_index("agent")["return"]
    assert table["tuned_cfl"] > 0.3 > table["random"]


@pytest.mark.parametrize("name", RULES)
def test_rules_act_within_the_space(name):
    env = gym.make(env_id("relaxation"), dx=0.08)
    observation, _ = env.reset(seed=0)
    assert env.action_space.contains(build(Spec(name), 0)(env, observation))


def test_random_actions_follow_their_seed():
    env = gym.make(env_id("relaxation"), dx=0.08)
    observation, _ = env.reset(seed=0)
    drawn = [build(Spec("random"), seed)(env, observation) for seed in (1, 1, 2)]
    assert np.array_equal(drawn[0], drawn[1])
    assert not np.array_equal(drawn[0], drawn[2])


def shipped():
    """Yield algorithm, scene and file of every network that comes with the package."""
    for path in sorted(SHIPPED.glob("*.npz")):
        family = next(each for each in (*SCENES, "benchmark") if path.stem.endswith(f"_{each}"))
        yield path.stem.removesuffix(f"_{family}"), family, path


def test_every_shipped_network_fits_its_environment():
    for algorithm, scene, path in shipped():
        assert path == network_of(algorithm, scene)
        env = gym.make(env_id(scene), dx=0.08)
        observation, _ = env.reset(seed=0)
        action = build(Spec(algorithm.partition("-")[0], network=str(path)), 0)(env, observation)
        assert env.action_space.contains(action)


@pytest.mark.parametrize("squash", ["tanh", "none"])
def test_a_network_plays_where_it_fits_and_nowhere_else(squash):
    policy = play_network(tiny(27 if squash == "none" else 3, squash))
    env = gym.make(env_id("relaxation"), dx=0.1)
    observation, _ = env.reset(seed=0)
    assert env.action_space.contains(policy(env, observation))
    for wrong, what in (
        ({"observation": "features+context"}, "observations"),
        ({"on_blowup": "rollback"}, "observations"),
        ({"action_mode": "delta" if squash == "tanh" else "stable"}, "actions"),
    ):
        other = gym.make(env_id("relaxation"), dx=0.1, **wrong)
        with pytest.raises(ValueError, match=f"network: it was trained with {what} '"):
            policy(other, other.reset(seed=0)[0])


@pytest.mark.parametrize("module", [actions, observations])
def test_a_network_of_another_version_is_refused(module, monkeypatch):
    policy = play_network(tiny())
    env = gym.make(env_id("relaxation"), dx=0.1)
    observation, _ = env.reset(seed=0)
    monkeypatch.setattr(module, "VERSION", module.VERSION + 1)
    with pytest.raises(ValueError, match=rf"'\w+ v{module.VERSION}': choose a network that fits"):
        policy(env, observation)


@pytest.mark.parametrize("mode", ["stable", "delta", "discrete"])
def test_a_network_of_other_actions_plays_absolute_ones_too(mode):
    network = tiny(27, "none") if mode == "discrete" else tiny(action_mode=mode)
    absolute, own = (
        gym.make(env_id("relaxation"), dx=0.1, action_mode=each) for each in ("absolute", mode)
    )
    for env in (absolute, own):
        observation, _ = env.reset(seed=0)
        env.step(play_network(network)(env, observation))
    assert np.allclose(
        absolute.unwrapped.episode.coordinates, own.unwrapped.episode.coordinates, atol=1e-6
    )


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        (Spec("nobody"), f"expected one of {', '.join(NAMES)}, got 'nobody'"),
        (Spec("grid_search"), "grid_search needs its settings"),
        (Spec("ppo"), "ppo needs its network"),
    ],
)
def test_incomplete_specs_are_refused(spec, message):
    with pytest.raises(ValueError, match=message):
        build(spec, 0)


def test_unknown_agents_and_instances_are_refused(tmp_path):
    with pytest.raises(ValueError, match="'nobody'"):
        compare.specs(compare.ComparisonArgs(agents=("nobody",), output=tmp_path))
    with pytest.raises(ValueError, match="expected 1 to 32"):
        evaluate.instance_ids("dam_break", "test", 33)
    with pytest.raises(ValueError, match="exam"):
        evaluate.instance_ids("dam_break", "exam", 1)


def test_intervals_hold_the_mean():
    values = np.random.default_rng(0).normal(size=40)
    mean, low, high = bootstrap_interval(values)
    assert low < mean < high
    assert high - low == pytest.approx(2 * 1.96 * values.std() / np.sqrt(40), rel=0.2)
    assert bootstrap_interval(np.ones(5)) == (1.0, 1.0, 1.0)


def test_a_network_that_was_trained_anew_is_another_agent(tmp_path, monkeypatch):
    asked = []

    def run_jobs(function, jobs, keys, results, title, backend):
        asked.extend(keys)
        return [{} for _ in jobs]

    monkeypatch.setattr(evaluate, "run_jobs", run_jobs)
    network = tmp_path / "network.npz"

    def key(content, path=network):
        path.write_bytes(content)
        spec = Spec("ppo", network=str(path))
        runs = evaluate.evaluate([spec], "dam_break", ["dam_break/test/0"], tmp_path / "x.csv")
        assert runs["settings"][0].startswith("network.npz ")
        return asked.pop()

    first = key(b"once")
    assert key(b"again") != first
    (tmp_path / "elsewhere").mkdir()
    assert key(b"once", tmp_path / "elsewhere" / "network.npz") == first
    # another way to play or to sum up makes other episodes of all
    monkeypatch.setattr(evaluate, "SOURCES", (network,))
    assert key(b"once") != first


def test_networks_come_in_pairs_of_agent_and_file(tmp_path):
    network = tmp_path / "network.npz"
    tiny().save(network)
    given = compare.ComparisonArgs(agents=("sac",), networks=("sac", str(network)))
    assert compare.specs(given) == [Spec("sac", network=str(network))]
    for networks in (("sac",), ("nobody", str(network))):
        with pytest.raises(ValueError, match="expected"):
            compare.specs(compare.ComparisonArgs(agents=("sac",), networks=networks))


def made_up_runs():
    """A run of each flow of "ood", without playing it."""
    n = SIZES["ood"]
    return pd.DataFrame(
        {
            "agent": ["default"] * n,
            "instance": [f"relaxation/ood/{k}" for k in range(n)],
            "return": np.arange(float(n)),
            **{name: np.linspace(0.0, 0.5, n) for name in evaluate.MEASURES if name != "return"},
        }
    )


def test_each_shift_has_a_summary(tmp_path, capsys):
    runs = made_up_runs()
    found = evaluate.shift_table(runs)
    assert list(found["shift"]) == list(ODD)
    assert list(found["runs"]) == [2] * len(ODD)
    assert list(found["return"]) == [k + len(ODD) / 2 for k in range(len(ODD))]
    assert list(evaluate.shift_table(runs[: len(ODD) + 1])["runs"]) == [2] + [1] * (len(ODD) - 1)
    text = evaluate.readable(found)
    assert list(text.columns[:3]) == ["shift", "agent", "return"]
    report.write_tables(found, tmp_path, "table_by_shift")
    table = (tmp_path / "table_by_shift.md").read_text()
    assert all(re.search(rf"\| {shift} +\| default +\|", table) for shift in ODD)
    evaluate.show_summary(runs, "made up")
    assert "by what is out of distribution" in capsys.readouterr().out
    assert not len(evaluate.shift_table(runs.assign(instance="relaxation/test/0")))


# each shift of the numerics is another compiled version
@pytest.mark.slow
def test_an_agent_plays_every_shift(tmp_path):
    evaluate.play_agent(
        Spec("default"), evaluate.EvaluationArgs("relaxation", "ood", len(ODD), tmp_path)
    )
    runs = pd.read_csv(tmp_path / "default_relaxation_ood.csv")
    assert list(evaluate.shift_table(runs)["shift"]) == list(ODD)


def test_the_report_says_that_shifts_are_mixed():
    (note,) = compare._notes(compare.ComparisonArgs(instances="ood"), [Spec("random")])
    assert "table_by_shift.md" in note
    assert compare._notes(compare.ComparisonArgs(), [Spec("random")]) == []


def test_networks_are_read_before_anything_is_played(tmp_path):
    chosen = {"agents": ("tuned_cfl", "ppo")}
    absent = compare.ComparisonArgs(**chosen, networks=("ppo", str(tmp_path / "none.npz")))
    with pytest.raises((ValueError, OSError), match=r"none\.npz"):
        compare.specs(absent)
    other = compare.ComparisonArgs(**chosen, networks=("sac", str(tmp_path / "none.npz")))
    with pytest.raises(ValueError, match="networks: expected one of ppo, got 'sac'"):
        compare.specs(other)
