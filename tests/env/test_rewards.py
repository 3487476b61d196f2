import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sph_gym import scenes
from sph_gym.env import rewards
from sph_gym.env.reference import WINDOW, Observables, ReferenceRun, spread
from sph_gym.env.rewards import Errors, Judge, Tolerances

SCENE = scenes.make("relaxation", dx=0.05)
N = 20
ERROR = st.floats(0, 1e12)
CALM = Errors(0.5, 0.5, 0.5)


def run(com=0.0, kinetic=1.0):
    flat = np.zeros(N + 1)
    return Observables(
        np.full((N + 1, 2), com), np.zeros((N + 1, 2)), np.full(N + 1, kinetic), flat, flat, flat
    )


def judge(*twins):
    return Judge(ReferenceRun(run(), spread(run(), twins), 5.0), SCENE, 1e-9, Tolerances())


def numbers(**changes):
    places = ("com_x", "com_y", "extent_x", "extent_y")
    calm = dict.fromkeys((*places, "density_error", "density_error_p99", "clumping"), 0.0)
    return calm | {"kinetic_energy": 1.0} | changes


@given(ERROR, ERROR, ERROR, st.floats(1e-3, 1e3))
def test_terms_are_bounded_and_only_one_speaks(density, clumping, fidelity, work):
    terms = rewards.terms(Errors(density, clumping, fidelity), work)
    assert set(terms) == set(rewards.TERMS)
    assert sum(value != 0 for value in terms.values()) <= 1
    assert -rewards.WORST <= sum(terms.values()) <= 1.0
    assert (terms["work"] != 0) <= (max(density, clumping, fidelity) <= 1)


def test_work_pays_by_its_ratio_to_the_rule():
    paid = [rewards.terms(CALM, work)["work"] for work in (0.0, 1.0, 2.0, 4.0, 1e9)]
    assert paid == pytest.approx([1.0, 0.5, 0.0, -1.0, -1.0])


@given(st.lists(st.floats(1e-3, rewards.MOST_WORK), min_size=1, max_size=30))
def test_uneven_work_earns_no_more_than_even_work(spent):
    even = len(spent) * rewards.terms(CALM, float(np.mean(spent)))["work"]
    assert sum(rewards.terms(CALM, work)["work"] for work in spent) == pytest.approx(even)


@given(ERROR.filter(lambda error: error > 1), st.floats(1e-3, 1e9))
def test_no_infidelity_is_cheaper_than_any_work(error, work):
    unfaithful = sum(rewards.terms(Errors(0.0, 0.0, error), work).values())
    assert unfaithful <= rewards.terms(CALM, rewards.MOST_WORK)["work"]


def test_the_penalty_is_booked_to_the_worst_error():
    terms = rewards.terms(Errors(2.0, 5.0, 3.0), 1.0)
    assert terms["clumping"] == pytest.approx(-(1.0 + np.log10(5.0)))


def test_no_early_death_pays():
    worst_alive = rewards.terms(Errors(1e9, 0, 0), 1.0)["density"]
    for left in (1, 10, 100):
        assert rewards.blowup_terms(left)["blowup"] <= left * worst_alive


def test_one_bad_frame_is_forgiven_after_the_window():
    watch = judge()
    off = numbers(com_x=3 * SCENE.dx)
    errors = [watch.errors(frame, off).fidelity for frame in range(1, N)]
    assert errors[0] == pytest.approx(3.0)
    assert errors[WINDOW] == pytest.approx(0.0)


def test_the_spread_of_equally_fine_references_widens_the_tolerance():
    drifting = run()._replace(com=np.linspace(0, 1, N + 1)[:, None] * [1.0, 0.0])
    off = numbers(com_x=3 * SCENE.dx)
    assert judge(drifting).errors(5, off).fidelity < judge(run()).errors(5, off).fidelity


def test_clumping_counts_only_beyond_the_reference():
    lumpy = run()._replace(clumping=np.full(N + 1, 0.3))
    watch = Judge(ReferenceRun(lumpy, spread(lumpy, ()), 5.0), SCENE, 1e-9, Tolerances())
    assert watch.errors(1, numbers(clumping=0.3)).clumping == 0.0
    assert watch.errors(2, numbers(clumping=0.45)).clumping == pytest.approx(1.0)


def test_a_fluid_that_spreads_is_not_faithful():
    watch = judge()
    assert watch.errors(1, numbers(extent_y=2 * SCENE.dx)).fidelity == pytest.approx(2.0)


def test_given_tolerances_replace_the_usual_ones():
    assert rewards.check_tolerances({"com_drift": 3}) == Tolerances(com_drift=3.0)
    assert rewards.check_tolerances(None) == Tolerances()


@pytest.mark.parametrize(
    "weights",
    [{"speed": 1.0}, {"work": float("nan")}, {"work": "much"}, {"work": 1e308}, {"density": -1e7}],
)
def test_wrong_weights_are_refused(weights):
    with pytest.raises(ValueError, match="reward_weights"):
        rewards.check_weights(weights)


def test_the_heaviest_weights_leave_rewards_finite():
    weights = rewards.check_weights(dict.fromkeys(rewards.TERMS, rewards.HEAVIEST))
    worst = weights["blowup"] * rewards.blowup_terms(10**9)["blowup"]
    assert np.isfinite(np.float32(worst))
