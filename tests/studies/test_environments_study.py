import numpy as np
import pytest

from sph_gym.solver import stepping
from sph_gym.studies import environments, throughput

PLAN = environments.EnvironmentPlan(n_envs=2, skipped=2, steps=3, rounds=2)


@pytest.fixture(scope="module")
def rows():
    return list(environments.measure(PLAN, "dam_break", 0.08, 0.07))


def test_bounds_are_those_of_both_spacings(rows):
    bounded = [row for row in rows if row.bound is not None]
    python = [row for row in bounded if row.quantity == "Python in an env step"]
    assert [row.bound for row in python] == [14.0, 8.0]
    assert len({row.case.split(",")[1] for row in rows}) == 2
    policy = [row for row in bounded if row.quantity == "the policy against an env step"]
    assert [row.bound for row in policy] == [1.0, 1.0]
    others = [row for row in bounded if row not in (*python, *policy)]
    larger = {row.case.split(",")[1] for row in (python[-1], *others)}
    assert larger == {rows[-1].case.split(",")[1]}
    assert {row.quantity for row in others} <= {"vector against one environment"}
    assert all(np.isfinite(row.value) and row.value > 0 for row in rows)


def test_python_is_a_part_of_what_is_around_the_time_steps(rows):
    [python, *_] = [row.value for row in rows if (row.quantity, row.unit) == (
        "Python in an env step", "%")]  # fmt: skip
    [around, *_] = [row.value for row in rows if row.quantity == "all but the time steps"]
    assert 0 < python < around < 100


def test_the_compiled_calls_of_a_step_are_timed_and_put_back():
    before = [getattr(stepping, name) for name in environments.COMPILED]
    track = environments.Track("dam_break", 0.08, PLAN)
    ticks = iter(range(1000))
    with environments.spent(lambda: next(ticks)) as seconds:
        track.one()
    assert seconds["advance"] >= PLAN.steps
    assert seconds["examine"] == PLAN.steps
    assert [getattr(stepping, name) for name in environments.COMPILED] == before


def test_every_run_is_the_same():
    track = environments.Track("dam_break", 0.08, PLAN)
    track.one()
    first = track.env.sim.x
    track.one()
    assert np.array_equal(track.env.sim.x, first)


def test_both_plans_have_fluids_of_about_the_sizes_that_are_asked_for():
    from sph_gym.env import instances

    for plan in (throughput.FULL, throughput.QUICK):
        for scene, *spacings in plan.agents.spacings:
            for n, dx in zip((300, 600), spacings, strict=True):
                built = instances.instance(scene, "nominal", 0, dx).build()
                assert 0.9 * n < len(built.x) < 1.1 * n
