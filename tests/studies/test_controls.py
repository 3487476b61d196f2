"""The worth of a control held fixed: choices that are made on the other instances."""

import numpy as np
import pytest

from sph_gym.env import actions
from sph_gym.env.tuning import TuningEnv
from sph_gym.studies import controls
from sph_gym.studies.controls import ControlGrid, Table

GRID = ControlGrid((0.6, 0.9), (0.3, 0.6), (0.0, 0.5, 1.0))


def table(by_epsilon, kind="noisy", following=None):
    """Return a table whose rewards depend on epsilon alone."""
    static = np.broadcast_to(np.asarray(by_epsilon, float), (2, 2, 3)).copy()
    best = max(by_epsilon) if following is None else following
    return Table(static, np.full((2, 2), best), kind)


def told(tables):
    found = {"dam_break": tables[::2], "long_fall": tables[1::2]}
    return {(row.quantity, row.case): row for row in controls.rows(found, GRID)}


def test_a_control_is_held_with_the_others_at_their_best():
    static = np.arange(12.0).reshape(2, 2, 3)
    found = Table(static, np.zeros((2, 2)), "plain")
    assert found.best == 11
    assert found.held(0).tolist() == [5, 11]
    assert found.held(1).tolist() == [8, 11]
    assert found.held(2).tolist() == [9, 10, 11]


def test_no_instance_has_a_say_in_the_choice_that_it_is_judged_by():
    rewards = np.array([[1.0, 0.0], [0.0, 0.9], [0.0, 0.9]])
    # without the first, the second column is best; without another one, the first
    assert controls._chosen_elsewhere(rewards).tolist() == [0.0, 0.0, 0.0]
    assert controls._chosen_elsewhere(np.array([[1.0, 2.0, 3.0]])).tolist() == [2.0]


def test_one_epsilon_for_two_kinds_costs_what_each_kind_would_win():
    noisy, damped = (0.0, 0.5, 0.8), (0.8, 0.5, 0.0)
    tables = [table(noisy), table(damped, "damped")] * 4
    rows = told([one for pair in zip(tables[::2], tables[1::2], strict=True) for one in pair])
    lost = rows["lost by one epsilon for all, against one for each context", "all"]
    assert lost.value == pytest.approx(0.3)
    assert lost.holds
    back = rows["given back by an epsilon that follows the observed noise", "all"]
    assert back.value == pytest.approx(100)
    worst = rows["families where the worst epsilon costs at least 0.2", "all"]
    assert (worst.value, worst.holds) == (2, True)


def test_where_one_epsilon_serves_all_nothing_is_lost():
    rows = told([table((0.1, 0.7, 0.2)), table((0.2, 0.7, 0.1), "damped")] * 4)
    lost = rows["lost by one epsilon for all, against one for each context", "all"]
    assert lost.value == pytest.approx(0.0)
    assert not lost.holds
    assert rows["one epsilon for all: reward lost", "all"].value == pytest.approx(0.0)


def test_the_policy_sees_nothing_but_the_observation():
    env = TuningEnv("patch_impact")
    env.reset(options={"instance": "patch_impact/val/0"})
    place = actions.locate(0.8, 0.5, 0.0)
    action = controls.follow_noise(env, None, place)
    assert action[:2] == pytest.approx(place[:2], abs=1e-6)
    seen = env.episode.observe()[controls.NOISE_SHARE]
    epsilon = controls.smoothing(0.01 * seen / (1 - seen))
    assert action[2] == pytest.approx(2 * epsilon - 1, abs=1e-6)
