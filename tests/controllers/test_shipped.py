import json
import sys

import numpy as np
import pytest

from sph_gym.controllers import RULES, shipped
from sph_gym.controllers.shipped import BEST, CARD, SHIPPED, fitting, load, names
from sph_gym.env import SCENES
from tests.networks import tiny


@pytest.fixture
def folder(monkeypatch, tmp_path):
    """Return the folder of the shipped networks, which is empty."""
    # the module has the name of the function
    monkeypatch.setattr(sys.modules["sph_gym.controllers.shipped"], "SHIPPED", tmp_path)
    return tmp_path


def observation():
    network = tiny()
    return np.linspace(-1, 1, network.weights[0].shape[1], dtype=np.float32)


def put(folder, name, network=None, **card):
    (network or tiny()).save(folder / f"{name}.npz")
    texts = {entry: f"{entry} of {name}" for entry in CARD} | card
    (folder / f"{name}.json").write_text(json.dumps(texts))


def choose(folder, **best):
    lists = {family: [names] if isinstance(names, str) else names for family, names in best.items()}
    (folder / f"{BEST}.json").write_text(json.dumps(lists))


def test_the_best_network_of_a_family_is_a_policy_with_a_card(folder):
    put(folder, "ppo_benchmark", tiny(seed=1))
    put(folder, "sac_dam_break", tiny(seed=2), limits="none known")
    choose(folder, dam_break="sac_dam_break", drop_impact="ppo_benchmark")
    policy = shipped("dam_break")
    x = observation()
    assert np.array_equal(policy(x), tiny(seed=2)(x))
    assert policy.name == "sac_dam_break"
    assert policy.card["limits"] == "none known"
    assert set(CARD) <= set(policy.card)
    assert shipped("drop_impact").card["what"] == "what of ppo_benchmark"


def test_the_best_network_is_that_of_the_action_mode(folder):
    put(folder, "ppo_benchmark", tiny(seed=1))
    put(folder, "sac_benchmark", tiny(seed=2, action_mode="stable"))
    choose(folder, dam_break=["sac_benchmark", "ppo_benchmark"])
    assert shipped("dam_break").name == "ppo_benchmark"
    assert shipped("dam_break", action_mode="stable").name == "sac_benchmark"
    assert fitting("dam_break")[BEST] == "sac_benchmark"
    with pytest.raises(ValueError, match="action_mode: expected one of absolute, stable, got 'de"):
        shipped("dam_break", action_mode="delta")


def test_a_network_of_choices_returns_the_one_of_most_value(folder):
    put(folder, "dqn_benchmark", tiny(27, "none"))
    x = observation()
    values = tiny(27, "none")(x)
    chosen = load("dqn_benchmark")(x)
    assert values[chosen] == values.max()
    assert chosen.shape == ()


def test_without_any_network_it_says_so(folder):
    with pytest.raises(ValueError, match="family: no network comes with this version"):
        shipped("dam_break")


def test_unknown_names_are_refused(folder):
    put(folder, "ppo_benchmark")
    choose(folder, dam_break="ppo_benchmark")
    with pytest.raises(ValueError, match="family: expected one of dam_break, got 'dambreak'"):
        shipped("dambreak")
    with pytest.raises(ValueError, match="network: expected one of ppo_benchmark, got 'ppo'"):
        load("ppo")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "is no card"),
        ("3", "is no card"),
        (json.dumps(dict.fromkeys(CARD[1:], "")), "expected what in the card"),
    ],
)
def test_cards_that_are_none_are_refused(folder, text, message):
    put(folder, "ppo_benchmark")
    (folder / "ppo_benchmark.json").write_text(text)
    with pytest.raises(ValueError, match=message):
        load("ppo_benchmark")


def test_an_algorithm_stands_for_its_network_of_the_family_or_for_the_benchmark_one(folder):
    for name in ("ppo_benchmark", "ppo_dam_break", "dqn_benchmark", "sac_long_fall"):
        put(folder, name)
    choose(folder, dam_break="dqn_benchmark")
    assert fitting("dam_break") == {
        "ppo": "ppo_dam_break", "dqn": "dqn_benchmark", "best": "dqn_benchmark",
    }  # fmt: skip
    assert fitting("droplet") == {"ppo": "ppo_benchmark", "dqn": "dqn_benchmark"}


def test_what_is_shipped_is_complete():
    """Every network has a card, every family a network that is there, no name is that of a rule."""
    best = SHIPPED / f"{BEST}.json"
    chosen = json.loads(best.read_text()) if best.is_file() else {}
    assert set(chosen) <= {*SCENES, "benchmark"}
    assert {name for ranked in chosen.values() for name in ranked} <= set(names())
    assert bool(names()) == bool(chosen)
    for name in names():
        assert load(name).card["limits"]
        assert name.partition("_")[0] not in RULES
