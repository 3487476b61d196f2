"""Controllers of a run by name: rules, networks of the package, and files."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from sph_gym import Simulation, TuningEnv, scenes
from sph_gym.command_line.run import CONTROLLERS
from sph_gym.controllers import RULES, AdaptiveRule
from sph_gym.pilot import Pilot, controller, controllers
from tests.controllers.test_shipped import choose, put
from tests.networks import tiny

DX = 0.05


@pytest.fixture
def folder(monkeypatch, tmp_path):
    """Return the folder of the shipped networks, which is empty."""
    monkeypatch.setattr(sys.modules["sph_gym.controllers.shipped"], "SHIPPED", tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def scene():
    return scenes.make("dam_break", dx=DX)


def test_the_command_line_names_every_rule():
    assert (*RULES, "best") == CONTROLLERS


def test_a_rule_is_new_in_every_run(scene):
    first, second = (controller("adaptive", scene) for _ in range(2))
    assert isinstance(first, AdaptiveRule)
    assert first is not second


def test_networks_of_the_package_that_fit_are_controllers(folder, scene):
    put(folder, "ppo_dam_break")
    put(folder, "sac_benchmark", tiny(n_out=2))
    choose(folder, dam_break="ppo_dam_break")
    assert [*controllers(scene)] == [*RULES, "ppo", "best"]
    assert isinstance(controller("best", scene), Pilot)
    with pytest.raises(
        ValueError, match=r"network: expected \d+ features in and 3 coordinates out"
    ):
        controller("sac", scene)
    assert [*controllers(scenes.make("relaxation", dx=0.1))] == [*RULES]


def test_unknown_names_are_refused_with_all_that_are_known(folder, scene):
    put(folder, "ppo_benchmark")
    wanted = "controller: expected one of default, cfl, tuned_cfl, adaptive, pi, ppo, FILE.npz, got"
    with pytest.raises(ValueError, match=f"{wanted} 'pppo' .did you mean 'ppo'"):
        controller("pppo", scene)


@pytest.mark.parametrize("name", ["missing.npz", "text.npz"])
def test_files_that_are_no_networks_are_refused(name, scene, tmp_path):
    (tmp_path / "text.npz").write_text("hello")
    with pytest.raises(ValueError, match="is no exported network"):
        controller(str(tmp_path / name), scene)


@pytest.mark.parametrize(
    "rules",
    [
        {"action_mode": "stable"},
        {"action_mode": "delta"},
        {"action_mode": "discrete"},
        {"observation": "features+context"},
    ],
    ids=str,
)
def test_networks_of_every_kind_steer_as_in_their_environment(rules, scene, tmp_path):
    discrete = rules.get("action_mode") == "discrete"
    network = tiny(*((27, "none") if discrete else (3, "tanh")), seed=3, **rules)
    network.save(tmp_path / "n.npz")
    env = TuningEnv("dam_break", dx=DX, **rules)
    observation, _ = env.reset(seed=0)
    sim, steer = Simulation(env.sim.scene), controller(str(tmp_path / "n.npz"), scene)
    seen = []
    for _ in range(4):
        values = network(observation)
        observation, *_ = env.step(int(values.argmax()) if discrete else values)
        sim.controls = steer(sim)
        sim.advance(sim.scene.frame)
        np.testing.assert_allclose(sim.controls, env.sim.controls, rtol=1e-6)
        seen.append(sim.controls)
    assert len(set(seen)) > 1


def test_pictures_are_nothing_for_a_network_of_features(scene):
    network = replace(tiny(), observation="field v2")
    with pytest.raises(ValueError, match="network: its observations: expected one of features"):
        Pilot(network)
